"""What the joints were asked for and what they gave."""

from dataclasses import dataclass, fields
from math import nan

import numpy as np
import numpy.typing as npt

from sms_handover.analysis.joints import joints_of
from sms_handover.analysis.phases import PhaseSpan
from sms_handover.run_data import RunData
from sms_handover.types import Array
from sms_handover.units import NS_PER_S

Counts = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class JointTorque:
    """Efforts that acted in a phase or in the whole run, per joint in the order of ``joint_names``.

    ``peak`` (n,) and ``rms`` (n,) in N m; ``effort`` (n,), the control effort, is the integral of the
    squared torque in (N m)^2 s. ``saturated_ticks`` (n,) counts the commands larger than any torque that
    the joint gave in the whole run; ``ticks_at_peak`` (n,) how often it gave exactly its largest
    one of the whole run, which a torque that nothing limits does once.
    """

    joint_names: tuple[str, ...]
    peak: Array
    rms: Array
    effort: Array
    saturated_ticks: Counts
    ticks_at_peak: Counts

    def __post_init__(self) -> None:
        for item in fields(self)[1:]:
            getattr(self, item.name).setflags(write=False)

    def of_arm(self, arm: str) -> "JointTorque":
        """Return the same for the joints of one arm."""
        chosen = joints_of(self.joint_names, arm)
        return JointTorque(
            tuple(self.joint_names[place] for place in chosen),
            self.peak[chosen],
            self.rms[chosen],
            self.effort[chosen],
            self.saturated_ticks[chosen],
            self.ticks_at_peak[chosen],
        )


def joint_torque(run: RunData, phase: PhaseSpan | None = None) -> JointTorque:
    """Return the torques of a phase, or of the whole run.

    A torque is held from one state to the next, so sums over ticks are exact integrals. Torques that were
    not recorded count neither in the sums nor in the time.
    """
    efforts = phase.efforts if phase else slice(len(run.tick_ns))
    # interval k lies between states k and k + 1: command[k] asks for what effort[k + 1] then is
    used = slice(max(efforts.start or 0, 1) - 1, max(efforts.stop, 1) - 1)
    size = np.abs(run.joint_effort[1:])
    ceiling = np.fmax.reduce(size, axis=0, initial=0.0)
    command = np.abs(run.joint_command[:-1])[used]
    size = size[used]
    known = ~np.isnan(size)
    held = (np.diff(run.tick_ns)[used] / NS_PER_S)[:, np.newaxis] * known
    duration = held.sum(axis=0)
    effort = np.sum(np.where(known, size, 0.0) ** 2 * held, axis=0)
    nothing = np.full(effort.shape, nan)
    return JointTorque(
        run.joint_names,
        peak=np.fmax.reduce(size, axis=0, initial=nan),
        rms=np.sqrt(np.divide(effort, duration, out=nothing.copy(), where=duration > 0.0)),
        effort=np.where(duration > 0.0, effort, nothing),
        saturated_ticks=np.sum(command > ceiling, axis=0),
        ticks_at_peak=np.sum((size == ceiling) & (ceiling > 0.0), axis=0),
    )
