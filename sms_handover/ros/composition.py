"""Which processes a graph consists of, and the ROS arguments of each."""

from collections.abc import Mapping, Sequence

from sms_handover.ros.parameters import as_arguments
from sms_handover.topics import CONTAINER, LOOP_NODES, RECORDER

Values = Mapping[str, object]


def process_arguments(
    common: Values, own: Mapping[str, Values], files: Sequence[str], *, record: bool, compose: bool
) -> dict[str, list[str]]:
    """Return the ROS arguments of every process of a graph.

    A process is a node, or with ``compose`` the container that runs all nodes of the loop. ``common``
    are the parameters of every node, ``own`` those of single ones; both lie over the parameter files.
    """
    nodes = (*LOOP_NODES, RECORDER) if record else LOOP_NODES
    begin = [part for file in files for part in ("--params-file", file)]
    begin += as_arguments({**common, "peers": nodes})
    arguments = {node: as_arguments(own.get(node, {}), node) for node in nodes}
    if compose:
        inside = [part for node in LOOP_NODES for part in arguments.pop(node)]
        arguments = {CONTAINER: inside, **arguments}
    return {process: begin + values for process, values in arguments.items()}
