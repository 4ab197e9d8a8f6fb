"""Hands of the arms: they take the deputy, pass it on and let it go, with its momentum."""

from dataclasses import replace

from sms_handover.errors import ConfigurationError
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.deputy import DeputyMotion, GraspTolerance
from sms_handover.plant.grasping import execute_grasp
from sms_handover.plant.kinematics import PlantKinematics
from sms_handover.plant.payload import Payload, deputy_at_start
from sms_handover.plant.plant_state import InitialState
from sms_handover.plant.rigid_deputy import RigidDeputy
from sms_handover.types import Array, GraspAction, GraspCommand, GraspEvent, GraspStatus


class Hands:
    """Who holds the deputy, what the robot carries by that, and the impulse as it changes hands.

    The state of an instant stays as it is under its commands: ``next_v`` (6 + n,) is the velocity after
    their impulses, with which the integration begins, None if there are none.
    """

    def __init__(
        self, robot: RobotModel, initial: InitialState, tolerance: GraspTolerance, tick_s: float
    ) -> None:
        """Place the deputy where a run starts, in no hand."""
        self._robot, self._tolerance = robot, tolerance
        self.deputy = deputy_at_start(initial, tick_s)
        body = self.deputy if isinstance(self.deputy, RigidDeputy) else None
        self._payload = Payload(robot, body) if body else None
        self.next_v: Array | None = None
        self._next_losses = 0.0

    @property
    def robot(self) -> RobotModel:
        """The robot with what it carries."""
        return self._payload.robot if self._payload else self._robot

    @property
    def floating(self) -> RigidDeputy | None:
        """The deputy where it floats and has mass."""
        deputy = self.deputy
        return deputy if isinstance(deputy, RigidDeputy) and not deputy.holder else None

    def execute(
        self, command: GraspCommand, kinematics: PlantKinematics, q: Array, v: Array, stamp_ns: int
    ) -> GraspEvent:
        """Execute one command at q and v; with a deputy that has mass its momentum changes hands too."""
        if self.next_v is not None:
            v = self.next_v
        if self.deputy.holder:
            kinematics.carry(self.deputy, q, v)
        motions = {arm: kinematics.tool_motion(q, v, arm) for arm in self._robot.arms}
        tools = {arm: pose for arm, (pose, _) in motions.items()}
        twists = {arm: twist for arm, (_, twist) in motions.items()}
        payload, deputy = self._payload, self.deputy
        if payload is None or not isinstance(deputy, RigidDeputy):
            return execute_grasp(command, deputy, tools, twists, self._tolerance, stamp_ns)
        before = payload.twist_in_hand(q, v) if deputy.holder else deputy.twist_in_deputy
        event = execute_grasp(command, deputy, tools, twists, self._tolerance, stamp_ns)
        if event.status is not GraspStatus.SUCCEEDED:
            return event
        if command.action is GraspAction.RELEASE:
            payload.let_go(before)
            self.next_v = v
            return event
        taken = payload.taken(q, v, before)
        self.next_v = taken.velocity
        self._next_losses += taken.energy_lost
        impulse = payload.in_world(taken.impulse)
        return replace(event, impulse=impulse, energy_lost=taken.energy_lost)

    def take_jump(self) -> tuple[Array, float]:
        """Return ``next_v`` as the integration begins with it, and the energy in J that the impulses took."""
        assert self.next_v is not None
        jump = self.next_v, self._next_losses
        self.next_v, self._next_losses = None, 0.0
        return jump

    def require_like(self, motion: DeputyMotion) -> None:
        """Raise ConfigurationError where only one of a motion and the deputy here has mass."""
        has_mass = motion.q.size > 0
        if has_mass != (self._payload is not None):
            kinds = ("with", "without") if has_mass else ("without", "with")
            raise ConfigurationError(
                f"the snapshot is of a deputy {kinds[0]} mass, must be of one {kinds[1]}: "
                "set deputy.mass, in kg, as in its run"
            )

    def restore(self, motion: DeputyMotion) -> None:
        """Go back to a former motion of the deputy, and hold it as it was held."""
        self.deputy.restore(motion)
        self.next_v, self._next_losses = None, 0.0
        if self._payload:
            self._payload.follow_holder()
