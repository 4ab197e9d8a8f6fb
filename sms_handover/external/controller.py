"""External controller: runs a controller of another package as the node 'controller'."""

import inspect
import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from rcl_interfaces.msg import ParameterDescriptor

from sms_handover.control.protocol import CheckedController, Controller, Guidance
from sms_handover.frames import WORLD
from sms_handover.graph.topics import CONTROLLER, target_pose
from sms_handover.model.robot_model import RobotModel
from sms_handover.nodes.controller import Answering, AnsweringNode
from sms_handover.ros.codecs.loop_messages import PoseCodec, Stamped
from sms_handover.ros.node.graph_node import P
from sms_handover.ros.node.message_filter import Decode
from sms_handover.ros.process.main import EXIT_OK, run_node
from sms_handover.ros.reference.help import own_parameters_help
from sms_handover.trajectory.schedule import Schedule
from sms_handover.types import Array, JointReference, Pose, TaskPhase

Make = Callable[[RobotModel, P], Controller]  # a controller for a robot, from its parameters


def run_controller(law: str, make: Make[P], group: type[P], args: Sequence[str] | None = None) -> int:
    """Run a controller as the node of the graph that answers states; return the exit code.

    ``law`` is its name in reports. ``make`` gets the robot and the parameters: a frozen dataclass ``group``
    whose fields are made by :func:`sms_handover.configuration.parameters.parameter` with a default. They
    become ROS parameters of the node, checked like those of this package. The node does everything else:
    matching, start and end of a run, which state to answer when, counts, diagnostics, signals.
    """
    arguments = list(sys.argv if args is None else args)
    if {"-h", "--help"} & set(arguments[1:]):
        print(f"{law}: {inspect.getdoc(make) or ''}\n\n{own_parameters_help(group)}")
        return EXIT_OK
    return run_node(lambda: OwnControllerNode(law, make, group), arguments, name=CONTROLLER)


class OwnControllerNode(AnsweringNode[P]):
    """Passes the states and the guidance of the graph to a controller, and publishes its efforts."""

    def __init__(self, law: str, make: Make[P], group: type[P]) -> None:
        self._law, self._make = law, make
        super().__init__(group, shipped=False)
        about = ParameterDescriptor(description="control law, as reports call it", read_only=True)
        self.declare_parameter("law", law, about)

    @property
    def law(self) -> str:
        """Return the name of the law."""
        return self._law

    def guidance(self) -> dict[str, Decode[Stamped[Any]]]:
        """Return also the targets of the tools."""
        return {**super().guidance(), **dict.fromkeys(self._arms, self._pose_codec.checked)}

    def make_controller(self, schedule: Schedule) -> Answering:
        """Return the controller, guided as in one process."""
        robot = self.robot
        self._pose_codec = PoseCodec(WORLD)
        self._arms = {target_pose(arm): arm for arm in robot.arms}
        controller = CheckedController(self._make(robot, self.parameters), robot.joint_names)
        self._guided = GuidedController(controller, robot)
        return self._guided

    def use(self, topic: str, stamp: int, content: Any) -> None:
        """Give phase, reference or target to the controller."""
        if topic in self._arms:
            self._guided.aim(stamp, self._arms[topic], content)
        else:
            super().use(topic, stamp, content)


class GuidedController:
    """A controller whose guidance arrives in parts: it is guided when all parts of one instant are there.

    Before that, as at the start in real time, the efforts are zero.
    """

    def __init__(self, controller: Controller, robot: RobotModel) -> None:
        self._controller, self._robot = controller, robot
        self.reset()

    def reset(self) -> None:
        """Return to the start of a run."""
        self._controller.reset()
        self._phase: TaskPhase | None = None
        self._reference: JointReference | None = None
        self._targets: dict[str, tuple[int, Pose]] = {}
        self._guided_ns = -1

    def enter(self, phase: TaskPhase) -> None:
        """Set the phase in force."""
        self._phase = phase
        self._guide()

    def track(self, reference: JointReference) -> None:
        """Set the joint reference."""
        self._reference = reference
        self._guide()

    def aim(self, stamp_ns: int, arm: str, tool_in_world: Pose) -> None:
        """Set the target of a tool."""
        self._targets[arm] = stamp_ns, tool_in_world
        self._guide()

    def effort(self, stamp_ns: int, q: Array, v: Array) -> Array:
        """Return the efforts (n,) that answer a state."""
        if self._guided_ns < 0:
            return np.zeros(self._robot.n_joints)
        return self._controller.effort(stamp_ns, q, v)

    def _guide(self) -> None:
        """Guide the controller if all parts are of the same instant."""
        phase, reference = self._phase, self._reference
        if phase is None or reference is None or set(self._targets) != set(self._robot.arms):
            return
        stamps = {phase.stamp_ns, reference.stamp_ns, *(stamp for stamp, _ in self._targets.values())}
        if len(stamps) == 1:
            self._guided_ns = reference.stamp_ns
            poses = {arm: self._targets[arm][1] for arm in self._robot.arms}
            self._controller.guide(Guidance(phase, reference, poses))
