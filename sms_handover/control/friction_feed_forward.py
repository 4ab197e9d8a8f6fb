"""Friction feed-forward: the friction that a law believes its joints to have, added to the efforts."""

from dataclasses import dataclass

import numpy as np

from sms_handover.types import Array


@dataclass(frozen=True)
class FrictionFeedForward:
    """tau = f_v w_d + tau_c tanh(w_d / v_s) at desired joint rates w_d [Armstrong1994].

    ``viscous`` f_v N m s/rad and ``coulomb`` tau_c N m are what the law believes, the same for every joint;
    what the joints of the plant have is a matter of its conditions. ``speed`` v_s rad/s, > 0, smooths the
    change of sign. The desired rate has neither noise nor delay, so that nothing alternates.
    """

    viscous: float
    coulomb: float
    speed: float

    def torque(self, desired_rate: Array) -> Array:
        """Return the efforts (n,) N m that overcome the friction at desired joint rates (n,) rad/s."""
        dry: Array = self.coulomb * np.tanh(desired_rate / self.speed)
        return self.viscous * desired_rate + dry
