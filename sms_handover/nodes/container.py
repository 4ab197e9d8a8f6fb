"""The loop of the graph in one process."""

import sys
from collections.abc import Callable, Sequence

from sms_handover.nodes.controller import ControllerNode
from sms_handover.nodes.ik import IkNode
from sms_handover.nodes.plant import PlantNode
from sms_handover.nodes.trajectory import TrajectoryNode
from sms_handover.ros.help import show_container_help
from sms_handover.ros.main import EXIT_OK, RunnableNode, run_nodes
from sms_handover.topics import CONTAINER, CONTROLLER, IK, PLANT, TRAJECTORY

_NODES: dict[str, Callable[[], RunnableNode]] = {
    PLANT: PlantNode,
    CONTROLLER: ControllerNode,
    TRAJECTORY: TrajectoryNode,
    IK: IkNode,
}
_DOES = """\
Runs the nodes of the loop in one process and one thread, each with its topics, services and parameters
as if it were alone. A parameter without NODE is set for all of them. What one node publishes the middleware
hands to the next without a change of process or thread, which is most of what a tick costs otherwise;
nodes outside this process, such as the recorder, take part as ever."""


def main(args: Sequence[str] | None = None) -> int:
    """Run the nodes; the loop is the plant's, because it paces the others."""
    arguments = list(sys.argv if args is None else args)
    if {"-h", "--help"} & set(arguments[1:]):
        show_container_help(CONTAINER, _NODES, _DOES)
        return EXIT_OK
    return run_nodes(tuple(_NODES.values()), arguments, name=CONTAINER)


if __name__ == "__main__":
    raise SystemExit(main())
