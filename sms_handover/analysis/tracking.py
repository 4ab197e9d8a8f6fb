"""How a tool followed its target through one phase."""

from dataclasses import dataclass
from enum import Enum
from math import nan

import numpy as np

from sms_handover.analysis.joints import joints_of
from sms_handover.analysis.numbers import angle_between, complete, largest, lengths, mean
from sms_handover.analysis.phases import PhaseSpan
from sms_handover.run_data import RunData, Stamps
from sms_handover.types import Array
from sms_handover.units import ns_to_seconds

SETTLING_BAND = 0.02  # [-] of the step length, the usual 2 % criterion
SETTLING_FLOOR = 1e-3  # [m] smallest band, and the shortest way that counts as a motion
STEADY_PART = 0.1  # [-] of the phase, at its end, over which the steady-state error is taken
_MOVED = 1e-9  # [rad] a joint reference that changes by less stands still


class Motion(Enum):
    """What a phase asks of a tool; the value is what a user reads."""

    STEP = "step"  # the target jumps away from the tool when the phase begins
    SMOOTH = "smooth"  # the target sets out from the tool
    HOLD = "hold"  # the joints, or the place in ``world``, are kept


@dataclass(frozen=True, eq=False)
class ToolTracking:
    """Errors of one tool against its target in one phase; SI units, NaN where not defined.

    A row per reference period that was recorded whole: ``stamp_ns`` (R,), ``position_error`` (R,)
    m, ``orientation_error`` (R,) rad. ``step_length`` m is the way from the tool at the start to its
    target. ``overshoot`` m and ``overshoot_ratio`` (of the step length) are not defined for a
    hold. ``settling_time`` s is NaN if the error is outside ``band`` m at the end. ``docs/metrics.md``
    has the formulas.
    """

    arm: str
    phase: PhaseSpan
    motion: Motion
    stamp_ns: Stamps
    position_error: Array
    orientation_error: Array
    step_length: float
    band: float
    overshoot: float
    overshoot_ratio: float
    settling_time: float
    largest_error: float
    steady_state_error: float
    final_error: float
    final_orientation_error: float

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for array in (self.stamp_ns, self.position_error, self.orientation_error):
            array.setflags(write=False)


def tool_tracking(run: RunData, phase: PhaseSpan, arm: str) -> ToolTracking:
    """Return how the tool of an arm followed its target in a phase."""
    tool, target = run.tool_pose[arm][phase.rows], run.target_pose[arm][phase.rows]
    known = complete(tool, target)
    stamp_ns, tool, target = run.reference_ns[phase.rows][known], tool[known], target[known]
    way = tool[:, :3] - target[:, :3]
    error = lengths(way)
    orientation_error = angle_between(target[:, 3:], tool[:, 3:])
    motion, step = _motion(run, phase, arm, tool[:, :3], target[:, :3])
    step_length = float(np.linalg.norm(step))
    band = largest([SETTLING_BAND * step_length, SETTLING_FLOOR])
    beyond = tool[:, :3] - target[-1, :3] if motion is Motion.SMOOTH else way
    overshoot = nan if motion is Motion.HOLD else max(0.0, largest(beyond @ (step / step_length)))
    steady = stamp_ns >= phase.end_ns - round(STEADY_PART * (phase.end_ns - phase.start_ns))
    return ToolTracking(
        arm=arm,
        phase=phase,
        motion=motion,
        stamp_ns=stamp_ns,
        position_error=error,
        orientation_error=orientation_error,
        step_length=step_length,
        band=band,
        overshoot=overshoot,
        overshoot_ratio=nan if motion is Motion.HOLD else overshoot / step_length,
        settling_time=settling_time(stamp_ns, lengths(beyond), band, phase.start_ns),
        largest_error=largest(error),
        steady_state_error=mean(error[steady]),
        final_error=float(error[-1]) if error.size else nan,
        final_orientation_error=float(orientation_error[-1]) if error.size else nan,
    )


def settling_time(stamp_ns: Stamps, error: Array, band: float, start_ns: int) -> float:
    """Return the time in s from ``start_ns`` after which an error stays within a band; NaN if it does not.

    It is the time of the first sample of the last stay within the band, so it is late by at most one
    sampling period.
    """
    outside = np.flatnonzero(error > band)
    if not error.size or (outside.size and outside[-1] == error.size - 1):
        return nan
    if not outside.size:
        return 0.0
    return ns_to_seconds(int(stamp_ns[outside[-1] + 1]) - start_ns)


def _motion(run: RunData, phase: PhaseSpan, arm: str, tool: Array, target: Array) -> tuple[Motion, Array]:
    """Return what the phase asks of the tool, and the vector (3,) m from its start to its goal."""
    if not len(tool):
        return Motion.HOLD, np.full(3, nan)
    jump: Array = target[0] - tool[0]
    if np.linalg.norm(jump) > SETTLING_FLOOR:
        return Motion.STEP, jump
    travel: Array = target[-1] - tool[0]
    if np.linalg.norm(travel) > SETTLING_FLOOR and _reference_moves(run, phase, arm):
        return Motion.SMOOTH, travel
    return Motion.HOLD, jump


def _reference_moves(run: RunData, phase: PhaseSpan, arm: str) -> bool:
    """Tell whether the joint reference of an arm changes within a phase; while held it does not."""
    reference = run.reference_position[phase.rows][:, joints_of(run.joint_names, arm)]
    reference = reference[complete(reference)]
    return bool(reference.size) and bool(np.max(np.ptp(reference, axis=0)) > _MOVED)
