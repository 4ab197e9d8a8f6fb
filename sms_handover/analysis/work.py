"""Mechanical work of the joints."""

from dataclasses import dataclass

import numpy as np

from sms_handover.analysis.joints import JointFigures
from sms_handover.analysis.phases import PhaseSpan
from sms_handover.run_data import RunData
from sms_handover.types import Array
from sms_handover.units import NS_PER_S


@dataclass(frozen=True, eq=False)
class JointWork(JointFigures):
    """Work of each joint in a phase or in the whole run.

    ``net`` J is the energy put into the motion less the energy taken out; ``absolute`` J is the sum of
    both, the energy a motor without recuperation needs; ``peak_power`` W is the largest magnitude of the
    power, averaged over a tick. NaN where nothing was recorded.
    """

    net: Array
    absolute: Array
    peak_power: Array


def joint_work(run: RunData, phase: PhaseSpan | None = None) -> JointWork:
    """Return the work of a phase, or of the whole run.

    A torque is constant over a tick, so u (q_k - q_(k-1)) is the exact work of a tick; its magnitude is
    the absolute work as long as the joint does not reverse within the tick. Ticks that were not recorded
    are left out.
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
