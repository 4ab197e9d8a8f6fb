"""Torque of the joints: commanded against applied."""

from dataclasses import dataclass
from math import nan

import numpy as np
import numpy.typing as npt

from sms_handover.analysis.joints import JointFigures
from sms_handover.analysis.phases import PhaseSpan
from sms_handover.run_data import RunData
from sms_handover.types import Array
from sms_handover.units import NS_PER_S

Counts = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class JointTorque(JointFigures):
    """Torques applied in a phase or in the whole run.

    ``peak`` and ``rms`` in N m; ``effort``, the control effort, is the integral of the squared torque in
    (N m)^2 s. ``saturated_ticks`` counts the commands larger than any torque that the joint applied in the
    whole run; ``ticks_at_peak`` how often it applied exactly its largest torque of the whole run, which
    without a limit happens once.
    """

    peak: Array
    rms: Array
    effort: Array
    saturated_ticks: Counts
    ticks_at_peak: Counts


def joint_torque(run: RunData, phase: PhaseSpan | None = None) -> JointTorque:
    """Return the torques of a phase, or of the whole run.

    A torque is constant over a tick, so sums over ticks are exact integrals. Torques that were not
    recorded are left out of the sums and of the time.
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
