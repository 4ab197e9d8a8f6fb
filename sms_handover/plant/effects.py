"""Effects of conditions that are not ideal on the plant: one object that it asks in every tick."""

from dataclasses import dataclass

from sms_handover.conditions.conditions import Conditions
from sms_handover.conditions.joint_values import CommandErrors
from sms_handover.conditions.random_streams import RandomStreams
from sms_handover.errors import ConfigurationError
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.command_path import CommandPath, CommandsOnTheWay
from sms_handover.plant.conditioned_stepper import ConditionedStepper, Resistance, ResistedStepper
from sms_handover.plant.dynamics import MakeDynamics, PlantDynamics
from sms_handover.plant.external_wrenches import NO_ACCOUNT, Companion, ExternalAccount
from sms_handover.plant.integrators import Tableau
from sms_handover.plant.joint_friction import JointFriction
from sms_handover.plant.motor_torque import MotorTorque
from sms_handover.types import Array
from sms_handover.units import ns_to_seconds, seconds_to_ns


@dataclass(frozen=True, eq=False)
class EffectsState:
    """What the effects carry from tick to tick; their noise follows from seed and tick."""

    commands: CommandsOnTheWay | None
    external: ExternalAccount


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
        self.resistance = Resistance(friction, tuple(conditions.wrenches.values()))
        self._stepper: ResistedStepper | None = None
        self.path: CommandPath | None = None
        self.motor: MotorTorque | None = None
        self.external = NO_ACCOUNT
        self.seed(seed)

    @property
    def has_wrenches(self) -> bool:
        """Whether wrenches from outside act."""
        return bool(self.resistance.wrenches)

    def reset(self) -> None:
        """Go back to the start of a run."""
        if self.path:
            self.path.reset()
        self.external = NO_ACCOUNT

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
        return EffectsState(self.path.state if self.path else None, self.external)

    def restore(self, state: EffectsState) -> None:
        """Go back to a former :attr:`state`; raises ConfigurationError if it is of other conditions."""
        if (state.commands is None) != (self.path is None):
            raise ConfigurationError("the snapshot is of other conditions: its commands take another way")
        if self.path and state.commands:
            self.path.state = state.commands
        self.external = state.external

    def dynamics(self, inner: MakeDynamics, tableau: Tableau) -> MakeDynamics:
        """Return what makes dynamics with these effects out of others."""
        resistance = self.resistance
        if not (resistance.friction or resistance.wrenches):
            return inner

        def make(robot: RobotModel) -> PlantDynamics:
            bare = inner(robot)
            stepper = bare.resisted(resistance) if bare.resisted else None
            ours = stepper or ConditionedStepper(robot, resistance, bare.stepper, tableau, self._h)
            return PlantDynamics(ours, bare.kinematics)

        return make

    def torque(self, tick: int, command: Array) -> Array:
        """Return the torques (n,) N m of the motors in a tick in which a command is given."""
        arrived = self.path.arriving(tick, command) if self.path else command
        return self.motor.given(tick, arrived) if self.motor else arrived

    def begins(self, tick: int, stepper: object) -> None:
        """Tell the stepper of the tick when it begins."""
        self._stepper = stepper if isinstance(stepper, ResistedStepper) else None
        if self._stepper:
            self._stepper.begin(tick * self._tick_ns)

    def settle(self, companion: Companion | None) -> float:
        """Book what wrenches have given in the tick, and return what friction has taken, in J.

        A deputy with mass that floats is the ``companion``, as it was when the tick began.
        """
        if self._stepper is None:
            return 0.0
        self.external = self._stepper.given(self.external, companion)
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
