"""Tracking of its target by a tool through one phase."""

from dataclasses import dataclass
from enum import Enum
from math import nan

import numpy as np

from sms_handover.analysis.joints import joints_of
from sms_handover.analysis.numbers import angle_between, complete, largest, lengths, mean
from sms_handover.analysis.orientation import OrientationTracking, orientation_tracking
from sms_handover.analysis.phases import PhaseSpan
from sms_handover.analysis.settling import SETTLING_BAND, settling_time, steady_rows
from sms_handover.run_data import RunData, Stamps
from sms_handover.types import Array

SETTLING_FLOOR = 1e-3  # [m] smallest band, and the shortest distance that counts as a motion
_MOVED = 1e-9  # [rad] smallest change of a joint reference that counts as a motion


class Motion(Enum):
    """What a phase asks of a tool; the value is shown to the user."""

    STEP = "step"  # the target jumps away from the tool when the phase begins
    SMOOTH = "smooth"  # the target starts at the tool and moves away
    HOLD = "hold"  # the joints, or the pose in ``world``, are kept


@dataclass(frozen=True, eq=False)
class ToolTracking:
    """Errors of one tool relative to its target in one phase; SI units, NaN where not defined.

    One row per reference period with a complete record: ``stamp_ns`` (R,), ``position_error`` (R,) m,
    ``orientation_error`` (R,) rad. ``step_length`` m is the distance from the tool at the start to its
    target. ``overshoot`` m and ``overshoot_ratio`` (of the step length) are not defined for a hold.
    ``settling_time`` s is NaN if the error is outside ``band`` m at the end. ``orientation`` has the
    same figures for the angle. ``docs/metrics.md`` has the formulas.
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
    orientation: OrientationTracking

    def __post_init__(self) -> None:
        for array in (self.stamp_ns, self.position_error, self.orientation_error):
            array.setflags(write=False)


def tool_tracking(run: RunData, phase: PhaseSpan, arm: str) -> ToolTracking:
    """Return how well the tool of an arm followed its target in a phase."""
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
        steady_state_error=mean(error[steady_rows(stamp_ns, phase)]),
        final_error=float(error[-1]) if error.size else nan,
        final_orientation_error=float(orientation_error[-1]) if error.size else nan,
        orientation=orientation_tracking(
            phase, stamp_ns, tool[:, 3:], target[:, 3:], smooth=motion is Motion.SMOOTH
        ),
    )


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
    """Whether the joint reference of an arm changes within a phase."""
    reference = run.reference_position[phase.rows][:, joints_of(run.joint_names, arm)]
    reference = reference[complete(reference)]
    return bool(reference.size) and bool(np.max(np.ptp(reference, axis=0)) > _MOVED)
