"""Motion of the free base over a whole phase, and after the tools have settled."""

from dataclasses import dataclass
from math import isnan, nan

import numpy as np

from sms_handover.analysis.numbers import angle_between, complete, lengths
from sms_handover.analysis.phases import PhaseSpan
from sms_handover.run_data import RunData
from sms_handover.units import ns_to_seconds, seconds_to_ns


@dataclass(frozen=True)
class BaseMotion:
    """Motion of ``base_link`` over a window that begins ``begin`` s after the start of a phase.

    ``position_change`` m and ``attitude_change`` rad are between the first and the last state;
    ``position_rate`` m/s and ``attitude_rate`` rad/s are these changes divided by ``duration`` s, the
    net drift: an oscillation about a fixed pose does not contribute. ``mean_speed`` m/s and
    ``mean_turn_rate`` rad/s average the norm of the velocity, to which it does. NaN where the window
    has fewer than two states.
    """

    begin: float
    duration: float
    position_change: float
    attitude_change: float
    position_rate: float
    attitude_rate: float
    mean_speed: float
    mean_turn_rate: float


UNKNOWN_MOTION = BaseMotion(nan, nan, nan, nan, nan, nan, nan, nan)


def base_motion(run: RunData, phase: PhaseSpan, begin: float = 0.0) -> BaseMotion:
    """Return the motion of the base from ``begin`` s after the start of a phase to the end of the phase.

    If ``begin`` is NaN, as the settling time of a tool that never settles, every figure is NaN.
    """
    if isnan(begin):
        return UNKNOWN_MOTION
    begin_ns = phase.start_ns + seconds_to_ns(begin)
    stamp_ns, pose = run.tick_ns[phase.states], run.base_pose[phase.states]
    twist = run.base_twist[phase.states]
    inside = (stamp_ns >= begin_ns) & complete(pose, twist)
    if np.count_nonzero(inside) <= 1:
        return UNKNOWN_MOTION
    stamp_ns, pose, twist = stamp_ns[inside], pose[inside], twist[inside]
    duration = ns_to_seconds(int(stamp_ns[-1] - stamp_ns[0]))
    position_change = float(np.linalg.norm(pose[-1, :3] - pose[0, :3]))
    attitude_change = float(angle_between(pose[0, 3:], pose[-1, 3:]))
    weight = np.diff(stamp_ns) / (stamp_ns[-1] - stamp_ns[0])
    speed, turn_rate = lengths(twist[:, :3]), lengths(twist[:, 3:])
    return BaseMotion(
        begin=begin,
        duration=duration,
        position_change=position_change,
        attitude_change=attitude_change,
        position_rate=position_change / duration,
        attitude_rate=attitude_change / duration,
        mean_speed=float(weight @ (speed[1:] + speed[:-1])) / 2.0,
        mean_turn_rate=float(weight @ (turn_rate[1:] + turn_rate[:-1])) / 2.0,
    )
