"""Known payload: the robot as those know it who hear of grasps by their events."""

from dataclasses import dataclass

from sms_handover.model.carrying import carrying
from sms_handover.model.deputy import DeputyDescription
from sms_handover.model.poses import se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import GraspAction, GraspCommand, GraspEvent, GraspStatus


@dataclass(frozen=True)
class Grip:
    """Which arm holds the deputy, '' if none does, and by which grasp frame."""

    arm: str = ""
    grasp_frame: str = ""


EMPTY_HANDS = Grip()


def grip_after(command: GraspCommand) -> Grip:
    """Return who holds the deputy after a command that succeeds."""
    return EMPTY_HANDS if command.action is GraspAction.RELEASE else Grip(command.arm, command.grasp_frame)


class KnownPayload:
    """A robot with the deputy as a part of the hand that holds it, as far as events tell.

    The deputy is taken to be where its grasp frame and the tool coincide: how far a grasp was off is not
    known. A deputy without mass changes nothing.
    """

    def __init__(self, robot: RobotModel, deputy: DeputyDescription | None) -> None:
        """Begin with empty hands."""
        self._bare, self._deputy = robot, deputy
        self._inertia = deputy.inertia if deputy else None
        self.hold(EMPTY_HANDS)

    @property
    def has_mass(self) -> bool:
        """Whether the deputy is known to have mass."""
        return self._inertia is not None

    @property
    def grip(self) -> Grip:
        """Who holds the deputy."""
        return self._grip

    def hold(self, grip: Grip) -> None:
        """Go on with who holds the deputy."""
        self._grip, self.robot = grip, self._bare
        if grip.arm and self._deputy and self._inertia is not None:
            in_tool = se3_of(self._deputy.grasp_frames[grip.grasp_frame]).inverse()
            self.robot = carrying(self._bare, grip.arm, self._inertia, in_tool)

    def grasped(self, event: GraspEvent) -> bool:
        """Learn what came of a grasp command; return whether the robot is another one now."""
        if event.status is not GraspStatus.SUCCEEDED or not self.has_mass:
            return False
        self.hold(grip_after(event.command))
        return True
