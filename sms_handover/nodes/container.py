"""Container: the loop of the graph in one process."""

import sys
from collections.abc import Callable, Sequence
from itertools import takewhile

from sms_handover.graph.topics import CONTAINER, CONTROLLER, IK, PLANT, TRAJECTORY
from sms_handover.nodes.controller import ControllerNode
from sms_handover.nodes.ik import IkNode
from sms_handover.nodes.plant import PlantNode
from sms_handover.nodes.trajectory import TrajectoryNode
from sms_handover.ros.process.main import EXIT_OK, RunnableNode, run_nodes
from sms_handover.ros.reference.help import show_container_help

_NODES: dict[str, Callable[[], RunnableNode]] = {
    PLANT: PlantNode,
    CONTROLLER: ControllerNode,
    TRAJECTORY: TrajectoryNode,
    IK: IkNode,
}
_DOES = """\
Runs the nodes that are named, or all four, in one process and one thread, each with its topics, services and
parameters as if it were alone. A parameter without NODE is set for all of them. What one node publishes the
middleware hands to the next without a change of process or thread, which is most of what a tick costs
otherwise. Nodes outside this process, such as the recorder, take part as ever. In lock step all four belong
together; in real time plant and controller do, because a reference may take longer than a tick."""


def main(args: Sequence[str] | None = None) -> int:
    """Run the nodes; the loop is the first one's: the plant's if it is among them."""
    program, *arguments = sys.argv if args is None else args
    if {"-h", "--help"} & set(arguments):
        show_container_help(CONTAINER, _NODES, _DOES)
        return EXIT_OK
    named = list(takewhile(lambda argument: argument in _NODES, arguments))
    makes = [make for node, make in _NODES.items() if node in named or not named]
    return run_nodes(makes, [program, *arguments[len(named) :]], name=CONTAINER)


if __name__ == "__main__":
    raise SystemExit(main())
