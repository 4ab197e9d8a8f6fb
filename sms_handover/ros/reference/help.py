"""Help of a node: what it does, its topics, services and parameters, and an example."""

import inspect
import os
import sys
from collections.abc import Iterable
from textwrap import wrap
from typing import Any

from sms_handover.configuration.parameters import defaults_of
from sms_handover.graph.services import Service
from sms_handover.graph.topics import (
    CONTROLLER,
    IK,
    NODES,
    PLANT,
    PLAYER,
    RECORDER,
    TOPIC_RECORDER,
    TRAJECTORY,
    VIEWER,
    Topic,
)
from sms_handover.ros.reference.interfaces import (
    COMMON_GROUP,
    ParameterGroup,
    ParameterRow,
    groups_of,
    parameter_rows,
    rows_of,
    services_of,
    topics_of,
)
from sms_handover.ros.reference.topic_descriptions import contents_of

_WIDTH = 100  # [characters] of a line

_EXIT_CODES = """\
Ctrl-C, SIGTERM and SIGHUP shut it down. Exit codes: 0 success; 1 failed; 2 wrong input, reported in one
line before it starts; of recorder and player also 3 messages are missing, 130 interrupted too early."""

EXAMPLES: dict[str, dict[str, object]] = {
    PLANT: {"integrator": "midpoint", "grasp_position_tolerance": 0.005},
    TRAJECTORY: {"time_law": "quintic"},
    IK: {"max_iterations": 50},
    CONTROLLER: {"law": "pid", "proportional": 2.5},
    RECORDER: {"folder": "runs/mine", "record_all": False},
    PLAYER: {"bag": "runs/nmpc/bag", "rate": 2.0},
    TOPIC_RECORDER: {"topics": ["/joint_states", "/tf"]},
    VIEWER: {"port": 8080, "frame_rate": 50.0},
}


def show_help(node: str, cls: object) -> None:
    """Print the help of a node."""
    _show(node_help(node, cls))


def show_container_help(container: str, nodes: Iterable[str], does: str) -> None:
    """Print the help of what runs some nodes of the graph in one process."""
    examples = {PLANT: EXAMPLES[PLANT], CONTROLLER: EXAMPLES[CONTROLLER]}
    values = [(f"{node}:{name}", value) for node, own in examples.items() for name, value in own.items()]
    given = " ".join(f"-p {name}:={_shell(value)}" for name, value in values)
    parts = [
        _usage(f"{container} [NODE ...]", "-p [NODE:]NAME:=VALUE"),
        does,
        _section(
            "Nodes, each with a --help of its own when it is run alone:", (f"  {node}" for node in nodes)
        ),
        f"Example:\n  ros2 run sms_handover {container} --ros-args {given}\n"
        f"  ros2 launch sms_handover handover.launch.py compose:=true   # with a recorder",
        _EXIT_CODES,
    ]
    _show("\n\n".join(parts))


def _show(text: str) -> None:
    """Print a text; a reader such as ``head`` need not take all of it."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def node_help(node: str, cls: object) -> str:
    """Return the help of a node of this package; ``cls`` is what makes it."""
    published, subscribed = topics_of(node)
    offered, called = services_of(node)
    parts = [
        _usage(node),
        inspect.getdoc(cls) or "",
        _section("Publishes:", map(_topic, published)),
        _section("Subscribes to:", map(_topic, subscribed)),
        _section("Services:", map(_service, offered)),
        _section("Calls:", map(_service, called)),
        *map(_parameters, groups_of(node)),
        _example(node),
        _EXIT_CODES,
    ]
    return "\n\n".join(filter(None, parts))


def _usage(node: str, parameter: str = "-p NAME:=VALUE") -> str:
    options = f"--ros-args [{parameter} ...] [--params-file FILE]"
    return (
        f"usage: ros2 run sms_handover {node} {options}\n       python -m sms_handover.nodes.{node} {options}"
    )


def _parameters(group: ParameterGroup) -> str:
    """Return the parameters of a group; they are read at the start and cannot be changed later."""
    whose = "Parameters of every node of the graph" if group is COMMON_GROUP else "Parameters"
    return _section(f"{whose}, defaults in config/{group.file}:", map(_parameter, parameter_rows(group)))


def own_parameters_help(cls: type[Any]) -> str:
    """Return the parameters of a user's node; the fields of its group have the defaults."""
    return _section(
        "Parameters, as --ros-args -p NAME:=VALUE:", map(_parameter, rows_of(cls, defaults_of(cls)))
    )


def _topic(topic: Topic) -> str:
    return _entry(f"{topic.name}  {topic.type}, {topic.rate.value}", contents_of(topic))


def _service(service: Service) -> str:
    return _entry(f"{service.relative_name}  {service.type}", service.does)


def _parameter(row: ParameterRow) -> str:
    unit = f" {row.unit}" if row.unit else ""
    return _entry(f"{row.name} = {row.default}{unit}  {row.type}", row.description, row.allowed)


def _example(node: str) -> str:
    """Return a command line that works, and in the graph the one that runs everything."""
    values = " ".join(f"-p {name}:={_shell(value)}" for name, value in EXAMPLES[node].items())
    lines = [f"  ros2 run sms_handover {node} --ros-args {values}"]
    if node in NODES:
        lines.append("  ros2 launch sms_handover handover.launch.py   # the whole graph")
    return "\n".join(["Example:", *lines])


def _shell(value: object) -> str:
    """Return a value as a shell passes it on."""
    if isinstance(value, list):
        return "'[" + ", ".join(value) + "]'"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _section(title: str, entries: Iterable[str]) -> str:
    """Return entries under a title, '' if there is none."""
    lines = list(entries)
    return "\n".join([title, *lines]) if lines else ""


def _entry(head: str, *texts: str) -> str:
    """Return one entry: a line, and under it further texts."""
    body = [line for text in texts for line in wrap(text, _WIDTH - 6)]
    return "\n".join([f"  {head}", *(f"      {line}" for line in body)])
