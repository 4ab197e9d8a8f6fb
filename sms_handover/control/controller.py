"""The controller: one law, its gains phase by phase, and the reference it tracks."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from sms_handover.control.base import ControlLaw
from sms_handover.control.computed_torque import TrackingEfforts
from sms_handover.control.nmpc import NmpcGains, NmpcLaw
from sms_handover.control.pid import PidGains, PidLaw
from sms_handover.control.protocol import Guidance
from sms_handover.control.reference_track import ReferenceTrack
from sms_handover.control.stability import LoopStability, loop_stability
from sms_handover.errors import UnstableLoopError
from sms_handover.model.reduced import reduced_dynamics
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array, JointReference, PhaseState, TaskPhase, frozen
from sms_handover.units import ns_to_seconds

Gains = NmpcGains | PidGains


class JointController:
    """Tracks joint references with a law whose gains change with the phase of the task."""

    def __init__(
        self,
        robot: RobotModel,
        gains_by_phase: Sequence[Gains],
        tick_ns: int,
        base_configuration: Array,
        longest_ns: int | None = None,
        efforts: TrackingEfforts | None = None,
    ) -> None:
        """Make the law of the gains and check every gain set at the start configuration.

        ``gains_by_phase`` has one entry per phase of the schedule, all of one law; ``base_configuration`` is
        q (7 + n,) at the start. The desired motion stops at an age of ``longest_ns`` of its reference.
        ``efforts`` computes the torque of NMPC, by default with Pinocchio. Raises UnstableLoopError.
        """
        self._robot = robot
        self._efforts = efforts
        self._gains_by_phase = tuple(gains_by_phase)
        self._dt = ns_to_seconds(tick_ns)
        self._law = make_law(robot, self._gains_by_phase[0], efforts)
        self._track = ReferenceTrack(longest_ns)
        self._entry = (0, 1, PhaseState.ACTIVE)
        check_stability(robot, self._gains_by_phase, self._dt, base_configuration)

    def reset(self) -> None:
        """Return to the start of a run."""
        self._law = make_law(self._robot, self._gains_by_phase[0], self._efforts)
        self._track.reset()
        self._entry = (0, 1, PhaseState.ACTIVE)

    def guide(self, guidance: Guidance) -> None:
        """Use the gains of the phase and track the joint reference; tool targets are not used."""
        self.enter(guidance.phase)
        self.track(guidance.reference)

    def enter(self, phase: TaskPhase) -> None:
        """Switch to the gains of a phase where it begins, is repeated or fails."""
        if phase.entry != self._entry:
            self._entry = phase.entry
            self._law.use(self._gains_by_phase[phase.index])
            self._track.restart()

    def track(self, reference: JointReference) -> None:
        """Track the next joint reference."""
        self._track.update(reference)

    @property
    def reference_ns(self) -> int:
        """Return the stamp of the last reference, 0 before the first."""
        return self._track.stamp_ns

    def effort(self, stamp_ns: int, q: Array, v: Array) -> Array:
        """Return the efforts (n,) N m for a state, read-only; zero until a first reference has come."""
        if not self._track.ready:
            return frozen(np.zeros(self._robot.n_joints))
        return frozen(self._law.effort(q, v, self._track.at(stamp_ns), self._dt))


def make_law(robot: RobotModel, gains: Gains, efforts: TrackingEfforts | None = None) -> ControlLaw[Any]:
    """Return the law that these gains belong to."""
    if isinstance(gains, NmpcGains):
        return NmpcLaw(robot, gains, efforts)
    return PidLaw(robot, gains)


def check_stability(
    robot: RobotModel,
    gains_by_phase: Sequence[Gains],
    dt: float,
    q: Array,
    where: str = "at the start configuration",
) -> tuple[LoopStability, ...]:
    """Return the stability of the sampled loop of each gain set at rest in q (7 + n,).

    Raises UnstableLoopError if one diverges; ``where`` names q in its text.
    """
    inertia = reduced_dynamics(robot, q, np.zeros(robot.pin.nv)).inertia
    found = []
    for gains in gains_by_phase:
        feedback = make_law(robot, gains).linearised(inertia)
        stability = loop_stability(inertia, feedback, dt, robot.joint_names)
        if not stability.stable:
            raise UnstableLoopError(
                f"the loop of {gains} at a tick of {dt:g} s is unstable {where}: "
                f"spectral radius {stability.spectral_radius:.6f}, must be < 1, "
                f"first at {stability.joint}; use a shorter tick or smaller gains"
            )
        found.append(stability)
    return tuple(found)
