"""Free-floating plant: robot and deputy, advanced tick by tick under joint efforts."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sms_handover.errors import ConfigurationError
from sms_handover.graph.events import RunEvent
from sms_handover.model.conserved import ConservedQuantities
from sms_handover.model.robot_model import BASE_NQ, RobotModel
from sms_handover.plant.deputy import DeputyMotion, MasslessDeputy
from sms_handover.plant.enforced_limits import EnforcedLimits
from sms_handover.plant.grasping import execute_grasp
from sms_handover.plant.integrators import TABLEAUS
from sms_handover.plant.joint_limits import ENFORCE, Excess, JointLimitWatch
from sms_handover.plant.kinematics import PinocchioKinematics, PlantKinematics
from sms_handover.plant.parameters import PlantParameters
from sms_handover.plant.stepper import PinocchioStepper, Stepper
from sms_handover.types import (
    Array,
    DeputyState,
    GraspCommand,
    GraspEvent,
    Pose,
    RobotState,
    TickRows,
    frozen,
    read_only,
)
from sms_handover.units import ns_to_seconds

Counts = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class InitialState:
    """Where a run starts, at rest: base pose in ``world``, joint angles (n,) rad, the deputy."""

    base_in_world: Pose
    joint_position: Array
    deputy_in_world: Pose
    deputy_grasp_frames: Mapping[str, Pose]


@dataclass(frozen=True, eq=False)
class PlantState:
    """Everything that the later motion of a plant, its counts and its events depend on."""

    tick: int
    q: Array
    v: Array
    joint_effort: Array
    work: float
    losses: float
    saturated_ticks: tuple[int, ...]
    excesses: tuple[Excess, ...]
    deputy: DeputyMotion


class FreeFloatingPlant:
    """H(q) v' + c(q, v) = (0, u): a base without actuators that carries arms, and no gravity.

    The efforts of a tick are held constant over it. Time is counted in whole ticks, so stamps are exact.
    Enforced joint limits are in :class:`~sms_handover.plant.enforced_limits.EnforcedLimits`.
    ``q``, ``v`` and ``joint_effort`` are those of :attr:`state`, as read-only arrays, new ones each tick.
    """

    def __init__(
        self,
        robot: RobotModel,
        parameters: PlantParameters,
        initial: InitialState,
        tick_ns: int,
        stepper: Stepper | None = None,
        kinematics: PlantKinematics | None = None,
    ) -> None:
        """Place robot and deputy at rest; raises ConfigurationError on a joint outside its limits."""
        self._robot = robot
        self._tolerance = parameters.grasp_tolerance
        self._initial = initial
        self._tick_ns = tick_ns
        self._tick_s = ns_to_seconds(tick_ns)
        self._stepper = stepper or PinocchioStepper(robot, TABLEAUS[parameters.integrator], self._tick_s)
        self._kinematics = kinematics or PinocchioKinematics(robot)
        self._watch = JointLimitWatch(robot, tick_ns)
        self._enforced: EnforcedLimits | None = None
        if parameters.joint_limits == ENFORCE:
            self._enforced = EnforcedLimits(robot, self._stepper, parameters.rated_speed, self._tick_s)
        self._check_start()
        self.reset()

    def reset(self) -> None:
        """Go back to the initial state at time zero."""
        self.tick = 0  # integrated since the start
        robot, initial = self._robot, self._initial
        self.q = read_only(robot.configuration(initial.base_in_world, initial.joint_position))
        self.v = read_only(np.zeros(robot.pin.nv))
        self.joint_effort = read_only(np.zeros(robot.n_joints))
        self._work = self._losses = 0.0
        self._watch.reset()
        self._saturated_ticks = np.zeros(robot.n_joints, dtype=np.int64)
        self._deputy = MasslessDeputy(initial.deputy_in_world, initial.deputy_grasp_frames)

    def snapshot(self) -> PlantState:
        """Return the state to :meth:`restore`."""
        return PlantState(
            self.tick,
            self.q,
            self.v,
            self.joint_effort,
            self._work,
            self._losses,
            tuple(self._saturated_ticks.tolist()),
            self._watch.excesses(self.stamp_ns),
            self._deputy.motion,
        )

    def restore(self, state: PlantState) -> None:
        """Go back to a former state; raises ConfigurationError if it is that of another robot."""
        shapes = [array.shape for array in (state.q, state.v, state.joint_effort)]
        if shapes != [self.q.shape, self.v.shape, self.joint_effort.shape]:
            raise ConfigurationError(
                f"the snapshot has {state.joint_effort.size} joints, must have {self.joint_effort.size}"
            )
        self.tick, self._work, self._losses = state.tick, state.work, state.losses
        self.q, self.v, self.joint_effort = (read_only(a) for a in (state.q, state.v, state.joint_effort))
        self._saturated_ticks = np.array(state.saturated_ticks, dtype=np.int64)
        self._watch.restore(state.excesses)
        self._deputy.restore(state.deputy)

    @property
    def robot(self) -> RobotModel:
        """The robot as it is."""
        return self._robot

    @property
    def stamp_ns(self) -> int:
        """Simulation time in ns."""
        return self.tick * self._tick_ns

    @property
    def state(self) -> RobotState:
        """Return the state at this tick."""
        return RobotState(self.stamp_ns, self.q, self.v, self.joint_effort)

    @property
    def deputy(self) -> DeputyState:
        """Return where the deputy is and who holds it."""
        self._deputy_follow()
        return self._deputy.state

    @property
    def deputy_body(self) -> MasslessDeputy:
        """The deputy with its motion, which compiled periods take over and give back."""
        return self._deputy

    @property
    def work(self) -> float:
        """Work in J that the joint efforts have done since the start."""
        return self._work

    @property
    def losses(self) -> float:
        """Energy in J that has become heat since the start, in joint stops."""
        return self._losses

    @property
    def net_work(self) -> float:
        """Work less losses in J: by how much the kinetic energy has grown since the start."""
        return self._work - self._losses

    @property
    def saturated_ticks(self) -> dict[str, int]:
        """Return per joint the number of ticks whose command was at the effort limit or beyond."""
        return dict(zip(self._robot.joint_names, self._saturated_ticks.tolist(), strict=True))

    @property
    def tools_in_world(self) -> dict[str, Pose]:
        """Return the pose of every tool."""
        return self._kinematics.tools_at(self.q)

    @property
    def conserved(self) -> ConservedQuantities:
        """Return momenta, energy and centre of mass of the robot."""
        return self._kinematics.conserved(self.q, self.v)

    def execute(self, commands: tuple[GraspCommand, ...]) -> tuple[GraspEvent, ...]:
        """Execute grasp commands at this instant, in order, and return their events."""
        if not commands:
            return ()
        self._deputy_follow()
        motions = {arm: self._kinematics.tool_motion(self.q, self.v, arm) for arm in self._robot.arms}
        tools = {arm: pose for arm, (pose, _) in motions.items()}
        twists = {arm: twist for arm, (_, twist) in motions.items()}
        return tuple(
            execute_grasp(command, self._deputy, tools, twists, self._tolerance, self.stamp_ns)
            for command in commands
        )

    def take_excesses(self) -> tuple[RunEvent, ...]:
        """Return the excesses of joint limits that are over; to be asked once for every state."""
        return self._watch.add(self.tick, self.q, self.v)

    def take_excesses_of(self, first: int, rows: TickRows) -> dict[int, tuple[RunEvent, ...]]:
        """Return the same by row for the states of ticks from ``first`` on, each looked at only here."""
        return self._watch.add_rows(first, rows.q, rows.v)

    def end_excesses(self) -> tuple[RunEvent, ...]:
        """Return the excesses of joint limits that go on at the end of the run."""
        return self._watch.end(self.stamp_ns)

    def apply(self, asked: Array) -> None:
        """Integrate one tick under read-only efforts (n,), each limited to what its motor can give.

        The work is u . (q_m(t + h) - q_m(t)), exact because u is constant over the tick.
        """
        effort = self._limited(asked)
        before = self.q
        if self._enforced is None:
            q, v = self._stepper.step(before, self.v, effort)
        else:
            q, v, effort, lost = self._enforced.step(before, self.v, effort)
            self._losses += lost
        for part in (effort * (q[BASE_NQ:] - before[BASE_NQ:])).tolist():
            self._work += part
        self.q, self.v, self.joint_effort = q, v, effort
        self.tick += 1
        if not self._deputy.holder:
            self._deputy.drift(self._tick_s)

    def adopt(
        self, steps: int, q: Array, v: Array, joint_effort: Array, work: float, saturated: Counts
    ) -> None:
        """Take over the state that ``steps`` ticks have led to elsewhere, with the work since the start.

        The arrays are read-only; ``saturated`` (n,) has the ticks of each joint at its effort limit.
        """
        self.tick += steps
        self.q, self.v, self.joint_effort, self._work = q, v, joint_effort, work
        self._saturated_ticks += saturated
        if not self._deputy.holder:
            for _ in range(steps):  # a sum of ticks, as one after the other makes it
                self._deputy.drift(self._tick_s)

    def _limited(self, asked: Array) -> Array:
        """Return the efforts that act, and count those at their limit or beyond."""
        effort = asked
        at_limit = np.abs(asked) >= self._robot.effort_limit
        if np.count_nonzero(at_limit):
            self._saturated_ticks += at_limit
            effort = frozen(self._robot.limited(asked))
        return effort

    def _deputy_follow(self) -> None:
        """Move a held deputy with its tool."""
        if self._deputy.holder:
            self._kinematics.carry(self._deputy, self.q, self.v)

    def _check_start(self) -> None:
        """Raise ConfigurationError where a joint starts outside its limits."""
        robot, start = self._robot, np.asarray(self._initial.joint_position)
        for name, value, low, high in zip(robot.joint_names, start, robot.lower, robot.upper, strict=True):
            if not low <= value <= high:
                raise ConfigurationError(
                    f"initial position of {name} is {value} rad, must be in [{low}, {high}] rad"
                )
