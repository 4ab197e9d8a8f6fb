"""Plant description: what robot and deputy these are, published once per run and latched."""

from collections.abc import Callable

from std_msgs.msg import String

from sms_handover.frames import DEPUTY, grasp_frame
from sms_handover.graph.topics import APPLIED_VALUES, DEPUTY_MARKER, ROBOT_DESCRIPTION, TF_STATIC
from sms_handover.messages.message_types import MessageTypes
from sms_handover.messages.transforms import transforms_cdr
from sms_handover.model.deputy import DeputyDescription
from sms_handover.model.link_tree import LinkTree
from sms_handover.model.moving_panels import with_moving_panels
from sms_handover.model.robot_model import RobotModel
from sms_handover.nodes.parts.marker import deputy_marker
from sms_handover.plant.applied_values import applied_text
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.ros.node.endpoints import CountedPublisher


class PlantDescription:
    """URDF of the robot, what acts in the plant, the shape of the deputy, frames fixed in their parents."""

    def __init__(
        self,
        plant: FreeFloatingPlant,
        robot: RobotModel,
        deputy: DeputyDescription,
        publisher: Callable[[str], CountedPublisher],
    ) -> None:
        """Make the publishers; ``publisher`` returns the one of a topic."""
        grasps = [(DEPUTY, grasp_frame(name), pose) for name, pose in deputy.grasp_frames.items()]
        fixed = [*LinkTree(with_moving_panels(robot)).fixed, *grasps]
        self._outputs = (
            (publisher(ROBOT_DESCRIPTION), String(data=robot.urdf)),
            (publisher(APPLIED_VALUES), String(data=applied_text(plant))),
            (publisher(DEPUTY_MARKER), deputy_marker(deputy.size)),
            (publisher(TF_STATIC), transforms_cdr(MessageTypes(), fixed, stamp_ns=0)),
        )

    def publish(self) -> None:
        """Publish all of it."""
        for publisher, message in self._outputs:
            publisher.publish(message)
