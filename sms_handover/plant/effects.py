"""Effects of conditions that are not ideal on the plant: one object that it asks in every tick."""

from dataclasses import dataclass, replace

from sms_handover.conditions.conditions import IDEAL, Conditions
from sms_handover.conditions.fingerprint import fingerprint
from sms_handover.conditions.joint_values import CommandErrors
from sms_handover.conditions.random_streams import RandomStreams
from sms_handover.errors import ConfigurationError
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.asked_stepper import AskedStepper
from sms_handover.plant.command_path import CommandPath, CommandsOnTheWay
from sms_handover.plant.conditioned_stepper import ConditionedStepper, Resistance, ResistedStepper
from sms_handover.plant.dynamics import MakeDynamics, PlantDynamics
from sms_handover.plant.external_wrenches import NO_ACCOUNT, NO_FORCE, ExternalAccount, sum_over
from sms_handover.plant.integrators import Tableau
from sms_handover.plant.joint_friction import JointFriction
from sms_handover.plant.motor_torque import MotorTorque
from sms_handover.plant.rigid_deputy import RigidDeputy
from sms_handover.types import Array, BaseWrench
from sms_handover.units import ns_to_seconds, seconds_to_ns


@dataclass(frozen=True, eq=False)
class EffectsState:
    """What the effects carry from tick to tick; their noise follows from seed and tick.

    ``conditions`` is the fingerprint of those that they are of; ``was_asked`` tells whether a wrench that
    others asked for has acted.
    """

    conditions: str
    commands: CommandsOnTheWay | None
    external: ExternalAccount
    was_asked: bool = False


class PlantEffects:
    """Joint effects and wrenches over ticks: command, path, motor, friction, in this order.

    A command takes its way to the motor, the motor gives a torque with its errors, and friction acts at the
    joint. Each effect that is not there costs nothing and draws nothing.
    """

    def __init__(self, conditions: Conditions, joints: int, tick_ns: int, seed: int) -> None:
        """Make the effects; raises ConfigurationError on a delay that is no multiple of the tick."""
        self._conditions, self._joints, self._tick_ns = conditions, joints, tick_ns
        self._h = ns_to_seconds(tick_ns)
        self._delay = _in_ticks(conditions.command or CommandErrors(), tick_ns)
        friction = JointFriction(conditions.friction, self._h) if conditions.friction else None
        self.on_deputy = tuple(conditions.deputy_wrenches.values())
        self.resistance = Resistance(friction, tuple(conditions.wrenches.values()), self.on_deputy)
        self.has_moved_deputy = False  # in the latest tick, by a wrench
        self._fingerprint = fingerprint(conditions)
        self._stepper: ResistedStepper | None = None
        self.path: CommandPath | None = None
        self.motor: MotorTorque | None = None
        self.external = NO_ACCOUNT
        self.asked: BaseWrench | None = None  # the wrench that was asked for in the latest tick
        self.seed(seed)

    @property
    def names(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The names of the wrenches on the base, and of those on the deputy."""
        return tuple(self._conditions.wrenches), tuple(self._conditions.deputy_wrenches)

    @property
    def delay_s(self) -> float:
        """How long a command is on its way, in s: the ticks that the path has."""
        return len(self.path.state.waiting) * self._h if self.path else 0.0

    @property
    def given(self) -> ExternalAccount | None:
        """What wrenches from outside have given, None where conditions have none and none was asked for."""
        has_any = self.resistance.wrenches or self.on_deputy or self._was_asked
        return self.external if has_any else None

    def reset(self) -> None:
        """Go back to the start of a run."""
        if self.path:
            self.path.reset()
        self.external, self.asked, self._was_asked = NO_ACCOUNT, None, False

    def seed(self, seed: int) -> None:
        """Let every random stream follow from a seed, from the start of a run on."""
        streams, conditions = RandomStreams(seed), self._conditions
        if conditions.command:
            self.path = CommandPath(self._joints, self._delay, conditions.command.dropped, streams)
        if conditions.torque:
            self.motor = MotorTorque(conditions.torque, self._h, streams)
        self.reset()

    @property
    def state(self) -> EffectsState:
        """What the later motion depends on besides seed and tick."""
        commands = self.path.state if self.path else None
        return EffectsState(self._fingerprint, commands, self.external, self._was_asked)

    def restore(self, state: EffectsState | None) -> None:
        """Go back to a former :attr:`state`, None where there were no effects.

        Raises ConfigurationError if it is of other conditions.
        """
        state = state or EffectsState(fingerprint(IDEAL), None, NO_ACCOUNT)
        if state.conditions != self._fingerprint:
            raise ConfigurationError(
                "the snapshot is of a run under other conditions, must be of these: give --conditions and "
                "-p conditions... as in its run"
            )
        if self.path and state.commands:
            self.path.state = state.commands
        self.external, self.asked, self._was_asked = state.external, None, state.was_asked

    def dynamics(self, inner: MakeDynamics, tableau: Tableau) -> MakeDynamics:
        """Return what makes dynamics with these effects out of others.

        C takes the ticks of friction and wrenches on the base where it can, but for those in which others
        ask for a wrench.
        """
        known_to_c = bool(self.resistance.friction or self.resistance.wrenches) and not self.on_deputy

        def make(robot: RobotModel) -> PlantDynamics:
            bare = inner(robot)
            resistance, values = self.resistance, self._conditions.friction
            if robot.springs and values:
                friction = JointFriction(values.with_free(len(robot.springs)), self._h)
                resistance = replace(resistance, friction=friction)
            ours = ConditionedStepper(robot, resistance, bare.stepper, tableau, self._h)
            in_c = bare.resisted(resistance) if bare.resisted and known_to_c else None
            return PlantDynamics(AskedStepper(in_c, ours) if in_c else ours, bare.kinematics)

        return make

    def torque(self, tick: int, command: Array) -> Array:
        """Return the torques (n,) N m of the motors in a tick in which a command is given."""
        arrived = self.path.arriving(tick, command) if self.path else command
        return self.motor.given(tick, arrived) if self.motor else arrived

    def begins(self, tick: int, stepper: object, asked: BaseWrench | None) -> None:
        """Tell the stepper of the tick when it begins, and what wrench on the base is asked for in it."""
        self._stepper = stepper if isinstance(stepper, ResistedStepper) else None
        self.asked, self._start_s = asked, ns_to_seconds(tick * self._tick_ns)
        self._was_asked = self._was_asked or asked is not None
        if self._stepper:
            self._stepper.begin(tick * self._tick_ns, asked)

    def settle(self, deputy: RigidDeputy | None) -> float:
        """Book what wrenches have given in the tick, and return what friction has taken, in J.

        A ``deputy`` with mass that floats is moved over the tick if wrenches act on it.
        """
        if self._stepper is None:
            return 0.0
        pushed = None
        if deputy and self.on_deputy:
            pushed = sum_over(self.on_deputy, self._start_s, self._h, deputy.body)
        beside = deputy.as_companion(NO_FORCE if pushed is None else pushed.force) if deputy else None
        self.external = self._stepper.given(self.external, beside)
        self.has_moved_deputy = bool(pushed)
        if deputy and pushed and isinstance(self._stepper, ConditionedStepper):
            self.external = deputy.drift_under(pushed, self.external, self._stepper.as_companion)
        return self._stepper.lost


def _in_ticks(command: CommandErrors, tick_ns: int) -> int:
    """Return the delay of a command in ticks; raises ConfigurationError if that is no whole number."""
    ticks, rest = divmod(seconds_to_ns(command.delay), tick_ns)
    if rest:
        raise ConfigurationError(
            f"conditions.command.delay is {command.delay:g} s, must be a multiple of the tick of "
            f"{ns_to_seconds(tick_ns):g} s"
        )
    return ticks
