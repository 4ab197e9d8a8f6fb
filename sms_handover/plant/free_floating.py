"""Free-floating plant: robot and deputy, advanced tick by tick under joint efforts."""

import numpy as np
import numpy.typing as npt

from sms_handover.conditions.conditions import IDEAL
from sms_handover.errors import ConfigurationError
from sms_handover.graph.events import RunEvent
from sms_handover.model.conserved import ConservedQuantities, together
from sms_handover.model.moving_panels import with_moving_panels
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.arm_part import ArmPart, PanelState
from sms_handover.plant.base_wrenches import BaseWrenches
from sms_handover.plant.damped_stepper import DampedStepper
from sms_handover.plant.deputy import MasslessDeputy
from sms_handover.plant.dynamics import MakeDynamics, PlantDynamics, pinocchio_dynamics
from sms_handover.plant.effects import PlantEffects
from sms_handover.plant.enforced_limits import EnforcedLimits
from sms_handover.plant.external_wrenches import NO_FORCE, Companion, ExternalAccount
from sms_handover.plant.hands import Hands
from sms_handover.plant.integrators import TABLEAUS
from sms_handover.plant.joint_limits import ENFORCE, JointLimitWatch, require_start_within_limits
from sms_handover.plant.parameters import PlantParameters
from sms_handover.plant.plant_state import InitialState, PlantState
from sms_handover.types import (
    Array,
    BaseWrench,
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
        make_dynamics: MakeDynamics | None = None,
        effects: PlantEffects | None = None,
    ) -> None:
        """Place robot and deputy; raises ConfigurationError on a joint outside its limits.

        ``make_dynamics`` is asked for every robot that comes about as the deputy changes hands, by default
        for Pinocchio's. ``effects`` are those of conditions that are not ideal.
        """
        self._arms, self._robot = ArmPart(robot), with_moving_panels(robot)
        self._tolerance = parameters.grasp_tolerance
        self._initial = initial
        self._tick_ns = tick_ns
        self._tick_s = ns_to_seconds(tick_ns)
        tableau = TABLEAUS[parameters.integrator]
        make = make_dynamics or pinocchio_dynamics(tableau, self._tick_s)
        self.base_wrenches = BaseWrenches(tick_ns)
        self._inner = self._make = make
        self._tableau = tableau
        self._watch = JointLimitWatch(robot, tick_ns)
        self._enforces, self._rated_speed = parameters.joint_limits == ENFORCE, parameters.rated_speed
        require_start_within_limits(robot, initial.joint_position)
        self._use(effects)
        self.reset()

    def _use(self, effects: PlantEffects | None) -> None:
        """Go on with effects, from the next integration on."""
        self._effects = effects
        if effects:
            self._make = effects.dynamics(self._inner, self._tableau)
        self._bare = self._dynamics_of(self._robot)

    def reset(self) -> None:
        """Go back to the initial state at time zero."""
        self.tick = 0  # integrated since the start
        robot, initial = self._robot, self._initial
        q = robot.configuration(initial.base_in_world, initial.joint_position)
        rest = np.zeros(robot.pin.nq - q.size)  # of the panels
        self._use_state(read_only([*q, *rest]), read_only(np.zeros(robot.pin.nv)))
        self.joint_effort = read_only(np.zeros(self._arms.robot.n_joints))
        self._work = self._losses = 0.0
        if self._effects:
            self._effects.reset()
        self._watch.reset()
        self._saturated_ticks = np.zeros(self._arms.robot.n_joints, dtype=np.int64)
        self._hands = Hands(robot, initial, self._tolerance, self._tick_s)
        self._load()

    def seed(self, seed: int) -> None:
        """Let every random stream of the conditions follow from a seed, from the start of a run on."""
        if self._effects:
            self._effects.seed(seed)

    def snapshot(self) -> PlantState:
        """Return the state to :meth:`restore`."""
        return PlantState(
            self.tick,
            self._q,
            self._v,
            self.joint_effort,
            self._work,
            self._losses,
            tuple(self._saturated_ticks.tolist()),
            self._watch.excesses(self.stamp_ns),
            self._hands.deputy.motion,
            self._effects.state if self._effects else None,
        )

    def restore(self, state: PlantState) -> None:
        """Go back to a former state; raises ConfigurationError on another robot, deputy or conditions."""
        shapes = [array.shape for array in (state.q, state.v, state.joint_effort)]
        if shapes != [self._q.shape, self._v.shape, self.joint_effort.shape]:
            count, wanted = (q.size - BASE_NQ for q in (state.q, self._q))
            raise ConfigurationError(f"the snapshot has {count} joints and hinges, must have {wanted}")
        self._hands.require_like(state.deputy)
        self.tick, self._work, self._losses = state.tick, state.work, state.losses
        self._use_state(read_only(state.q), read_only(state.v))
        self.joint_effort = read_only(state.joint_effort)
        self._saturated_ticks = np.array(state.saturated_ticks, dtype=np.int64)
        self._watch.restore(state.excesses)
        self._hands.restore(state.deputy)
        if self._effects is None and state.effects:
            self._use_ideal_effects()
        if self._effects:
            self._effects.restore(state.effects)
        self._load()

    @property
    def robot(self) -> RobotModel:
        """The robot without what it carries, with panels locked."""
        return self._arms.robot

    @property
    def loaded_robot(self) -> RobotModel:
        """The robot with what it carries, whose equations of motion hold from this instant on."""
        return self._hands.robot

    @property
    def jumps(self) -> bool:
        """Whether the velocity jumps at this instant, by a grasp, before it is integrated."""
        return self._hands.next_v is not None

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
        return self._hands.deputy.state

    @property
    def deputy_body(self) -> MasslessDeputy:
        """The deputy with its motion, which compiled periods take over and give back."""
        return self._hands.deputy

    @property
    def work(self) -> float:
        """Work in J that the joint efforts have done since the start."""
        return self._work

    @property
    def external_work(self) -> float:
        """Work in J that wrenches from outside have done since the start."""
        return self._effects.external.work if self._effects else 0.0

    @property
    def enforces_limits(self) -> bool:
        """Whether joints are kept within their limits."""
        return self._enforces

    @property
    def effects(self) -> PlantEffects | None:
        """The effects of conditions that are not ideal, which compiled ticks take over and give back."""
        return self._effects

    @property
    def external_impulse(self) -> ExternalAccount | None:
        """What wrenches from outside have given since the start, None where conditions have none."""
        return self._effects.given if self._effects else None

    @property
    def losses(self) -> float:
        """Energy in J that has become heat since the start, in joint stops, friction and grips that close."""
        return self._losses

    @property
    def saturated_ticks(self) -> dict[str, int]:
        """Return per joint the number of ticks whose command was at the effort limit or beyond."""
        return dict(zip(self._arms.robot.joint_names, self._saturated_ticks.tolist(), strict=True))

    @property
    def tools_in_world(self) -> dict[str, Pose]:
        """Return the pose of every tool."""
        return self._kinematics.tools_at(self._q)

    @property
    def conserved(self) -> ConservedQuantities:
        """Return momenta, energy and centre of mass of robot and deputy."""
        return self.with_deputy(self._kinematics.conserved(self._q, self._v))

    def with_deputy(self, of_robot: ConservedQuantities) -> ConservedQuantities:
        """Return what is conserved of robot and deputy, by that of the robot with what it carries."""
        deputy = self._hands.floating
        if deputy is None:
            return of_robot
        return together(of_robot, self._robot.mass, deputy.conserved, deputy.inertia.mass)

    def execute(self, commands: tuple[GraspCommand, ...]) -> tuple[GraspEvent, ...]:
        """Execute grasp commands at this instant, in order, and return their events.

        The state of this instant stays as it is: an impulse acts as its integration begins.
        """
        hands, stamp_ns = self._hands, self.stamp_ns
        return tuple(
            hands.execute(command, self._kinematics, self._q, self._v, stamp_ns) for command in commands
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
        effects = self._effects
        effort = self._limited(effects.torque(self.tick, asked) if effects else asked)
        if self._hands.next_v is not None:
            self._jump()
        if effects:
            effects.begins(self.tick, self._stepper, self.base_wrenches.at(self.tick))
        before, whole = self._q, self._arms.padded(effort)
        if self._enforced is None:
            q, v = (self._swinging or self._stepper).step(before, self._v, whole)
        else:
            q, v, whole, lost = self._enforced.step(before, self._v, whole)
            effort = self._arms.efforts(whole)
            self._losses += lost
        if self._swinging:
            self._losses += self._swinging.taken
        if effects:
            self._losses += effects.settle(self._hands.floating)
        for part in (whole * (q[BASE_NQ:] - before[BASE_NQ:])).tolist():
            self._work += part
        self._use_state(q, v)
        self.joint_effort = effort
        self.tick += 1
        if not (self._hands.deputy.holder or (effects and effects.has_moved_deputy)):
            self._hands.deputy.drift(self._tick_s)

    def push(self, wrench: BaseWrench) -> None:
        """Let a wrench act on the base over the tick of its stamp, and no other tick.

        Raises MessageError if that tick is over or has one already, or on an unknown frame.
        """
        self.base_wrenches.add(wrench, self.tick)
        if self._effects is None:
            self._use_ideal_effects()
            if not self.jumps:  # else as that velocity is taken on
                self._load()

    def _use_ideal_effects(self) -> None:
        """Go on with effects of ideal conditions, which know of the wrenches that are asked for."""
        self._use(PlantEffects(IDEAL, self.joint_effort.size, self._tick_ns, seed=0))  # nothing is drawn

    @property
    def pushed(self) -> BaseWrench | None:
        """The wrench that was asked for and acted over the latest tick."""
        return self._effects.asked if self._effects else None

    def adopt(
        self,
        steps: int,
        q: Array,
        v: Array,
        joint_effort: Array,
        work: float,
        losses: float,
        saturated: Counts,
    ) -> None:
        """Take over what ``steps`` ticks have led to elsewhere, with work and losses since the start.

        The arrays are read-only; ``saturated`` (n,) has the ticks of each joint at its effort limit.
        """
        self.tick += steps
        self._losses = losses
        self._use_state(q, v)
        self.joint_effort, self._work = joint_effort, work
        self._saturated_ticks += saturated
        if not self._hands.deputy.holder:
            for _ in range(steps):  # a sum of ticks, as one after the other makes it
                self._hands.deputy.drift(self._tick_s)

    def _jump(self) -> None:
        """Go on from the velocity after an impulse, with the payload that the robot then has."""
        v, lost = self._hands.take_jump()
        self._use_state(self._q, v)
        self._losses += lost
        self._load()

    def _load(self) -> None:
        """Use the equations of motion of the robot with what it carries."""
        loaded = self.loaded_robot
        found = self._bare if loaded is self._robot else self._dynamics_of(loaded)
        dynamics, self._swinging, self._enforced = found
        self._stepper, self._kinematics = dynamics.stepper, dynamics.kinematics

    def _dynamics_of(
        self, robot: RobotModel
    ) -> tuple[PlantDynamics, DampedStepper | None, EnforcedLimits | None]:
        """Return the dynamics of a robot, its stepper with dampers, and its enforced limits."""
        dynamics, h = self._make(robot), self._tick_s
        swinging = DampedStepper(dynamics.stepper, robot.springs, h) if robot.springs else None
        if not self._enforces:
            return dynamics, swinging, None
        return dynamics, swinging, EnforcedLimits(robot, swinging or dynamics.stepper, self._rated_speed, h)

    def _use_state(self, q: Array, v: Array) -> None:
        """Be at a state of all that moves, of which base and arms are seen from outside."""
        self._q, self._v = q, v
        self.q, self.v = self._arms.position(q), self._arms.velocity(v)

    @property
    def panels(self) -> PanelState | None:
        """The angles and rates of the panels on hinges, None where there are none."""
        springs, n = self._robot.springs, self.joint_effort.size
        if springs is None:
            return None
        angle, rate = self._q[BASE_NQ + n :], self._v[BASE_NV + n :]
        torque = springs.torque(self._q, self._v)
        return PanelState(angle, rate, torque, float(springs.energy(angle)))

    @property
    def companion(self) -> Companion | None:
        """The deputy where it floats and has mass."""
        deputy = self._hands.floating
        return deputy.as_companion(NO_FORCE) if deputy else None

    def _limited(self, asked: Array) -> Array:
        """Return the efforts that act, and count those at their limit or beyond."""
        effort = asked
        at_limit = np.abs(asked) >= self._arms.robot.effort_limit
        if np.count_nonzero(at_limit):
            self._saturated_ticks += at_limit
            effort = frozen(self._arms.robot.limited(asked))
        return effort

    def _deputy_follow(self) -> None:
        """Move a held deputy with its tool."""
        if self._hands.deputy.holder:
            self._kinematics.carry(self._hands.deputy, self._q, self._v)
