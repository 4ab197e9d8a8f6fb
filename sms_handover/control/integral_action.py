"""Integral action on the tracking error, as an acceleration that the computed torque asks for."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sms_handover.control.law import LinearFeedback
from sms_handover.types import Array


@dataclass(frozen=True)
class IntegralAction:
    """y' = (a_1 e + a_2 e') / T_i, taken off the acceleration that is asked for [Astrom1995].

    The feedback a_1 e + a_2 e' is that of a proportional and integral controller then. Under a constant
    disturbance d of the joint accelerations

        e'' + a_2 e' + (a_1 + a_2 / T_i) e + a_1 / T_i int e = d,

    whose integral is the error where the plan or the reference does not jump. It is stable for any T_i where
    a_2^2 >= a_1. Anti-windup is conditional integration: a joint whose effort is at its limit integrates only
    what leads it away from there.
    """

    time: float  # s, T_i > 0
    dt: float  # s

    def advanced(self, action: Array, feedback: Array, wanted: Array, given: Array) -> Array:
        """Return y (n,) rad/s^2 a tick after ``action``, under the feedback a_1 e + a_2 e' (n,) rad/s^2.

        ``wanted`` and ``given`` (n,) N m are the efforts before and after they are limited.
        """
        winds_up = (wanted != given) & (np.sign(wanted) == -np.sign(feedback))
        more: Array = np.where(winds_up, 0.0, (self.dt / self.time) * feedback)
        return action + more

    def linearised(
        self, law: Callable[[Any, Array], LinearFeedback]
    ) -> Callable[[Any, Array], LinearFeedback]:
        """Return the linearisation of a law with this action."""

        def with_action(gains: Any, inertia: Array) -> LinearFeedback:
            bare = law(gains, inertia)
            return LinearFeedback(
                bare.position + bare.velocity / self.time,
                bare.velocity,
                bare.integral + bare.position / self.time,
            )

        return with_action
