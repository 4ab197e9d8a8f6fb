"""Composition of a graph: its processes, and what each is started with."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from sms_handover.errors import ConfigurationError
from sms_handover.graph.topics import CONTAINER, CONTROLLER, LOOP_NODES, NODES, PLANT
from sms_handover.ros.parameters import as_arguments
from sms_handover.simulation.parameters import LOCKSTEP

Values = Mapping[str, object]


@dataclass(frozen=True)
class ProcessArguments:
    """What an executable of this package is started with: nodes to run, if it is the container, and ROS's."""

    nodes: tuple[str, ...]
    ros: tuple[str, ...]

    @property
    def line(self) -> tuple[str, ...]:
        """All of them as on a command line."""
        return (*self.nodes, "--ros-args", *self.ros)


def nodes_together(mode: str) -> tuple[str, ...]:
    """Return the nodes that are best run in one process in a mode.

    In lock step no two nodes of the loop ever work at the same time. In real time the trajectory and
    the inverse kinematics have twenty ticks for what may take longer than one, so they stay apart.
    """
    return LOOP_NODES if mode == LOCKSTEP else (PLANT, CONTROLLER)


def process_arguments(
    common: Values,
    own: Mapping[str, Values],
    files: Sequence[str],
    *,
    record: bool,
    together: Collection[str],
    here: Collection[str] = NODES,
) -> dict[str, ProcessArguments]:
    """Return the processes of a graph on this host by executable, with their arguments.

    A process is a node, or the container that runs the nodes of ``together``. ``common`` are the
    parameters of every node, ``own`` those of single ones; both lie over the parameter files. An external
    node has its arguments too, and may take or leave them. Those not ``here`` run on other hosts.
    """
    graph = NODES if record else LOOP_NODES
    nodes = [node for node in graph if node in here]
    begin = [part for file in files for part in ("--params-file", file)]
    begin += as_arguments({**common, "peers": graph})
    external = common.get("external", ())
    assert isinstance(external, Sequence)
    inside = tuple(node for node in nodes if node in together and node not in external)
    groups = {CONTAINER: inside} if inside else {}
    groups.update({node: (node,) for node in nodes if node not in inside})
    processes = {}
    for name, group in groups.items():
        values = [part for node in group for part in as_arguments(own.get(node, {}), node)]
        named = group if name == CONTAINER else ()
        processes[name] = ProcessArguments(named, (*begin, *values))
    return processes


def placed(asked: str, *, record: bool) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the nodes to start on this host and those of the graph that run elsewhere.

    ``asked`` names those of this host, with commas between; "" is all of them. Raises ConfigurationError.
    """
    graph = NODES if record else LOOP_NODES
    names = listed(asked) or graph
    for name in names:
        if name not in graph:
            unrecorded = " without a recorder" if name in NODES else ""
            allowed = f"must be of {', '.join(graph)}, with commas between"
            raise ConfigurationError(f"node {name!r} cannot be started{unrecorded}, {allowed}")
    return tuple(n for n in graph if n in names), tuple(n for n in graph if n not in names)


def listed(text: str) -> tuple[str, ...]:
    """Return the items of a list with commas between."""
    return tuple(item.strip() for item in text.split(",") if item.strip())
