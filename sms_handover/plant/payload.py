"""Payload of the robot: the mass of the deputy, which changes hands with it."""

from sms_handover.model.capture import Capture, capture, carried_jacobian
from sms_handover.model.carrying import carrying
from sms_handover.model.poses import se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.deputy import MasslessDeputy
from sms_handover.plant.plant_state import InitialState
from sms_handover.plant.rigid_deputy import RigidDeputy
from sms_handover.types import Array


class Payload:
    """What moves the mass of a deputy into a hand and out of it, with all of its momentum.

    ``robot`` is the one whose equations hold now: bare, or with the deputy as a part of its last link.
    """

    def __init__(self, robot: RobotModel, deputy: RigidDeputy) -> None:
        """Begin as the deputy says that it is held."""
        self._bare, self._deputy = robot, deputy
        self.follow_holder()

    def follow_holder(self) -> None:
        """Carry what the present holder holds."""
        deputy, self.robot = self._deputy, self._bare
        if deputy.holder:
            self.robot = carrying(self._bare, deputy.holder, deputy.inertia, deputy.in_tool)

    def twist_in_hand(self, q: Array, v: Array) -> Array:
        """Return the twist (6,) of the held deputy in its own axes: J v."""
        return self._jacobian(q) @ v

    def taken(self, q: Array, v: Array, twist_in_deputy: Array) -> Capture:
        """Return what happens as the hand that has just got the deputy closes on it."""
        self.follow_holder()
        return capture(self._bare, q, v, self._jacobian(q), self._deputy.inertia, twist_in_deputy)

    def let_go(self, twist_in_deputy: Array) -> None:
        """Leave the deputy, which floats on with a twist (6,) in its own axes."""
        self.robot = self._bare
        self._deputy.let_go(twist_in_deputy)

    def in_world(self, wrench_in_deputy: Array) -> tuple[float, ...]:
        """Return a pair of vectors (6,) in axes of the deputy in those of ``world``."""
        turn = se3_of(self._deputy.state.deputy_in_world).rotation
        return (*(turn @ wrench_in_deputy[:3]).tolist(), *(turn @ wrench_in_deputy[3:]).tolist())

    def _jacobian(self, q: Array) -> Array:
        """Return the Jacobian (6, 6 + n) of the deputy in the hand that holds it."""
        return carried_jacobian(self._bare, q, self._deputy.holder, self._deputy.in_tool)


def deputy_at_start(initial: InitialState, h: float) -> MasslessDeputy:
    """Return the deputy where a run starts, rigid if it has mass; ``h`` s is the tick."""
    place, twist = (initial.deputy_in_world, initial.deputy_grasp_frames), initial.deputy_twist_in_world
    if initial.deputy_inertia is None:
        return MasslessDeputy(*place, twist)
    return RigidDeputy(*place, initial.deputy_inertia, h, twist)
