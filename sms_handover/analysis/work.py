"""What mechanical work the joints did."""

from dataclasses import dataclass, fields

import numpy as np

from sms_handover.analysis.joints import joints_of
from sms_handover.analysis.phases import PhaseSpan
from sms_handover.run_data import RunData
from sms_handover.types import Array
from sms_handover.units import NS_PER_S


@dataclass(frozen=True, eq=False)
class JointWork:
    """Work of each joint in a phase or in the whole run, (n,) in the order of ``joint_names``.

    ``net`` J is what the joint put into the motion, less what it took out; ``absolute`` J is both
    together, what a motor that recovers nothing has to turn over; ``peak_power`` W is the largest size of
    the power, averaged over a tick. NaN where nothing was recorded.
    """

    joint_names: tuple[str, ...]
    net: Array
    absolute: Array
    peak_power: Array

    def __post_init__(self) -> None:
        for item in fields(self)[1:]:
            getattr(self, item.name).setflags(write=False)

    def of_arm(self, arm: str) -> "JointWork":
        """Return the same for the joints of one arm."""
        chosen = joints_of(self.joint_names, arm)
        names = tuple(self.joint_names[place] for place in chosen)
        return JointWork(names, self.net[chosen], self.absolute[chosen], self.peak_power[chosen])


def joint_work(run: RunData, phase: PhaseSpan | None = None) -> JointWork:
    """Return the work of a phase, or of the whole run.

    A torque is held from one state to the next, so u (q_k - q_(k-1)) is the exact work of a tick; its size
    is that of a tick in which the joint does not turn back. Ticks that were not recorded are left out.
    """
    efforts = phase.efforts if phase else slice(len(run.tick_ns))
    used = slice(max(efforts.start or 0, 1), max(efforts.stop, 1))
    before = slice(used.start - 1, used.stop - 1)
    work = run.joint_effort[used] * (run.joint_position[used] - run.joint_position[before])
    duration = (run.tick_ns[used] - run.tick_ns[before])[:, np.newaxis] / NS_PER_S
    known = np.any(np.isfinite(work), axis=0)
    return JointWork(
        run.joint_names,
        net=np.where(known, np.nansum(work, axis=0), np.nan),
        absolute=np.where(known, np.nansum(np.abs(work), axis=0), np.nan),
        peak_power=np.fmax.reduce(np.abs(work) / duration, axis=0, initial=np.nan),
    )
