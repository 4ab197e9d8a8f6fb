"""External controller: runs a controller of another package as the node 'controller'."""

import inspect
import sys
from collections.abc import Callable, Sequence

from rcl_interfaces.msg import ParameterDescriptor

from sms_handover.control.protocol import CheckedController, Controller
from sms_handover.graph.topics import CONTROLLER
from sms_handover.model.robot_model import RobotModel
from sms_handover.nodes.controller import AnsweringNode
from sms_handover.ros.node.graph_node import P
from sms_handover.ros.process.main import EXIT_OK, run_node
from sms_handover.ros.reference.help import own_parameters_help

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

    @property
    def follows_tools(self) -> bool:
        """True: any controller may follow the tools."""
        return True

    def make_controller(self) -> Controller:
        """Return the controller, its efforts checked."""
        return CheckedController(self._make(self.robot, self.parameters), self.robot.joint_names)
