"""Orientation tracking of a tool through one phase."""

from dataclasses import dataclass
from math import nan

import numpy as np

from sms_handover.analysis.numbers import largest, lengths, mean, rotation_vectors
from sms_handover.analysis.phases import PhaseSpan
from sms_handover.analysis.settling import SETTLING_BAND, settling_time, steady_rows
from sms_handover.run_data import Stamps
from sms_handover.types import Array
from sms_handover.units import DEG_PER_RAD

# [rad] smallest band, and smallest rotation that counts as one: a tenth of the shipped grasp tolerance,
# as the floor of 1 mm is a tenth of that of 10 mm
TURN_FLOOR = 0.2 / DEG_PER_RAD


@dataclass(frozen=True)
class OrientationTracking:
    """Orientation errors of one tool in one phase, in rad and s; NaN where not defined.

    ``step_angle`` is the rotation from the tool at the start to its goal. ``overshoot`` and
    ``overshoot_ratio`` (of that rotation) are defined only if it exceeds 0.2 degrees. ``settling_time``
    is NaN if the error is outside ``band`` at the end. ``docs/metrics.md`` has the formulas.
    """

    step_angle: float
    band: float
    overshoot: float
    overshoot_ratio: float
    settling_time: float
    largest_error: float
    steady_state_error: float


def orientation_tracking(
    phase: PhaseSpan, stamp_ns: Stamps, tool: Array, target: Array, *, smooth: bool
) -> OrientationTracking:
    """Return how a tool followed the orientation of its target, quaternions (R, 4) x y z w at ``stamp_ns``.

    The goal is the target at each instant, or, with ``smooth``, the target at the end of the phase.
    """
    off = rotation_vectors(target[-1:] if smooth else target, tool)
    error = lengths(rotation_vectors(target, tool))
    step = -off[0] if len(off) else np.full(3, nan)
    step_angle = float(np.linalg.norm(step))
    band = largest([SETTLING_BAND * step_angle, TURN_FLOOR])
    overshoot = max(0.0, largest(off @ (step / step_angle))) if step_angle > TURN_FLOOR else nan
    return OrientationTracking(
        step_angle=step_angle,
        band=band,
        overshoot=overshoot,
        overshoot_ratio=overshoot / step_angle if step_angle > TURN_FLOOR else nan,
        settling_time=settling_time(stamp_ns, lengths(off), band, phase.start_ns),
        largest_error=largest(error),
        steady_state_error=mean(error[steady_rows(stamp_ns, phase)]),
    )
