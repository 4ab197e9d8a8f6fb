"""Plant clearance: measured each reference period from the true state and published, where it is online."""

from collections.abc import Callable

from sms_handover.graph.topics import CLEARANCE
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.ros.codecs.convert import clearance_message
from sms_handover.ros.node.endpoints import CountedPublisher
from sms_handover.simulation.parameters import CommonParameters
from sms_handover.simulation.wiring import make_monitor
from sms_handover.trajectory.schedule import Schedule


class PlantClearance:
    """The clearance of the plant's bodies as a topic; without it every call does nothing."""

    def __init__(
        self,
        robot: RobotModel,
        schedule: Schedule,
        common: CommonParameters,
        publisher: Callable[[str], CountedPublisher],
    ) -> None:
        """Make the publisher if the parameters ask for it; ``publisher`` returns that of a topic."""
        self._monitor = make_monitor(robot, schedule, common) if common.measures_clearance else None
        self._publisher = publisher(CLEARANCE) if self._monitor else None

    def reset(self) -> None:
        """Begin a new run."""
        if self._monitor:
            self._monitor.reset()

    def publish(self, plant: FreeFloatingPlant, phase: int) -> None:
        """Publish the clearance of this instant in the phase of an index of the schedule."""
        if self._monitor is None or self._publisher is None:
            return
        deputy = plant.deputy
        pose, holder = deputy.deputy_in_world, deputy.holder
        clearance = self._monitor.measure(plant.stamp_ns, plant.q, pose, phase, holder)
        self._publisher.publish(clearance_message(clearance))
