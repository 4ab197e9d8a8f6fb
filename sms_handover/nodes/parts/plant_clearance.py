"""Plant clearance: measured each reference period from the true state and published, where it is online."""

from collections.abc import Callable

from sms_handover.graph.topics import CLEARANCE
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.ros.codecs.convert import clearance_message
from sms_handover.ros.node.endpoints import CountedPublisher
from sms_handover.simulation.parameters import LOCKSTEP, CommonParameters
from sms_handover.simulation.wiring import make_monitor
from sms_handover.trajectory.schedule import Schedule
from sms_handover.types import Pose


class PlantClearance:
    """The clearance of the plant's bodies as a topic; unless it is measured online every call does nothing.

    In lock step it is measured after the grasp commands of a period, and the trajectory waits for it. In real
    time it is measured with the state, so that the instants are even, in the phase that came last.
    """

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
        self._lockstep = common.mode == LOCKSTEP
        self._phase = 0

    def reset(self) -> None:
        """Begin a new run."""
        self._phase = 0
        if self._monitor:
            self._monitor.reset()

    def phase_begins(self, plant: FreeFloatingPlant, phase: int) -> None:
        """Note the phase of a period, and the pose of the deputy as published: a grasp rounds it anew."""
        self._phase, self._deputy_in_world = phase, plant.deputy.deputy_in_world

    def commands_executed(self, plant: FreeFloatingPlant) -> None:
        """Publish the clearance of the period in lock step."""
        if self._lockstep:
            self._publish(plant, self._deputy_in_world)

    def state_published(self, plant: FreeFloatingPlant) -> None:
        """Publish the clearance of the period in real time."""
        if not self._lockstep:
            self._publish(plant, plant.deputy.deputy_in_world)

    def _publish(self, plant: FreeFloatingPlant, deputy_in_world: Pose) -> None:
        if self._monitor is None or self._publisher is None:
            return
        holder = plant.deputy.holder
        clearance = self._monitor.measure(plant.stamp_ns, plant.q, deputy_in_world, self._phase, holder)
        self._publisher.publish(clearance_message(clearance))
