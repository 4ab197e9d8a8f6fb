"""Plant transforms: where base, links and deputy are, as every viewer of ROS takes it."""

from collections.abc import Callable

import numpy as np

from sms_handover.frames import DEPUTY, WORLD
from sms_handover.graph.topics import TF
from sms_handover.messages.message_types import MessageTypes
from sms_handover.messages.transforms import TransformsCodec
from sms_handover.model.link_tree import LinkTree
from sms_handover.model.moving_panels import with_moving_panels
from sms_handover.model.poses import pose_row
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.ros.node.endpoints import CountedPublisher


class PlantTransforms:
    """The transforms of the true robot and deputy; those of the targets come from the trajectory."""

    def __init__(self, robot: RobotModel, publisher: Callable[[str], CountedPublisher]) -> None:
        """Make the publisher; ``publisher`` returns the one of a topic."""
        self._tree = LinkTree(with_moving_panels(robot))
        self._codec = TransformsCodec(MessageTypes(), [*self._tree.moving, (WORLD, DEPUTY)])
        self._publisher = publisher(TF)

    def publish(self, plant: FreeFloatingPlant) -> None:
        """Publish where everything is in the state of this tick."""
        deputy = pose_row(plant.deputy.deputy_in_world)
        q = np.concatenate([plant.q, plant.panels.angle]) if plant.panels else plant.q
        poses = np.vstack([self._tree.moving_in_parent(q), deputy])
        self._publisher.publish(self._codec.pack(plant.stamp_ns, poses))
