"""Interfaces of the nodes, read from the tables that the nodes themselves are made from.

``--help`` of a node and the pages docs/parameters.md and docs/topics.md are written from this.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sms_handover.bag.parameters import RecorderParameters, TopicRecorderParameters
from sms_handover.bag.qos import History
from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.parameters import EVERY_NODE, read_parameter_files, specs_of
from sms_handover.control.parameters import ControllerParameters
from sms_handover.graph.services import SERVICES, Service
from sms_handover.graph.topics import (
    CONTROLLER,
    IK,
    NODES,
    PLANT,
    PLAYER,
    RECORDER,
    SENSOR_TYPES,
    TOPIC_RECORDER,
    TRAJECTORY,
    VIEWER,
    Topic,
    graph_topics,
)
from sms_handover.ik.parameters import IkParameters
from sms_handover.plant.parameters import PlantParameters
from sms_handover.playback.parameters import PlayerParameters
from sms_handover.ros.qos import profile_of, stored
from sms_handover.scene.parameters import ViewerParameters
from sms_handover.simulation.parameters import CommonParameters
from sms_handover.trajectory.parameters import TrajectoryParameters

ANY_ARM = "ARM"  # stands for the name of an arm

_EVERY_OTHER = set(NODES) - {PLANT, RECORDER}

_TYPES = {
    bool: "bool",
    int: "integer",
    float: "double",
    str: "string",
    tuple[float, ...]: "double_array",
    tuple[str, ...]: "string_array",
}  # as `ros2 param describe` names them


@dataclass(frozen=True)
class ParameterGroup:
    """Parameters of one dataclass with the shipped file, and the section of it, that has their defaults."""

    cls: type[Any]
    file: str
    section: str


@dataclass(frozen=True)
class ParameterRow:
    """One parameter for readers: everything as text, '' where there is none."""

    name: str
    type: str
    default: str
    unit: str
    allowed: str
    description: str


COMMON_GROUP = ParameterGroup(CommonParameters, "common.yaml", EVERY_NODE)
OWN_GROUPS = {
    name: ParameterGroup(cls, f"{name}.yaml", name)
    for name, cls in {
        PLANT: PlantParameters,
        TRAJECTORY: TrajectoryParameters,
        IK: IkParameters,
        CONTROLLER: ControllerParameters,
        RECORDER: RecorderParameters,
        PLAYER: PlayerParameters,
        TOPIC_RECORDER: TopicRecorderParameters,
        VIEWER: ViewerParameters,
    }.items()
}


def groups_of(node: str) -> tuple[ParameterGroup, ...]:
    """Return the parameter groups of a node, its own first."""
    return (OWN_GROUPS[node], COMMON_GROUP) if node in NODES else (OWN_GROUPS[node],)


def parameter_rows(group: ParameterGroup) -> tuple[ParameterRow, ...]:
    """Return the parameters of a group, with the defaults of its file."""
    return rows_of(group.cls, read_parameter_files([config_file(group.file)], group.section))


def rows_of(cls: type[Any], defaults: Mapping[str, object]) -> tuple[ParameterRow, ...]:
    """Return the parameters of a dataclass, with their defaults by name."""
    return tuple(
        ParameterRow(
            name=name,
            type=_TYPES[spec.kind],
            default=_value(defaults[name]),
            unit=spec.unit.replace("-", ""),
            allowed=spec.allowed,
            description=spec.description,
        )
        for name, spec in specs_of(cls).items()
    )


def publishers_of(topic: Topic) -> tuple[str, ...]:
    """Return the nodes that publish a topic, with the recorder, which the table leaves out."""
    by_all = set(topic.publishers) >= _EVERY_OTHER
    return (*topic.publishers, RECORDER) if by_all else topic.publishers


def subscribers_of(topic: Topic) -> tuple[str, ...]:
    """Return the nodes that subscribe to a topic, with the recorder, which the table leaves out."""
    return topic.subscribers if topic.is_from_outside else (*topic.subscribers, RECORDER)


def topics_of(node: str) -> tuple[tuple[Topic, ...], tuple[Topic, ...]]:
    """Return the topics of the graph that a node publishes, and those that it subscribes to."""
    table = graph_topics([ANY_ARM], clearance=True, sensors=SENSOR_TYPES)
    published = tuple(topic for topic in table if node in publishers_of(topic))
    return published, tuple(topic for topic in table if node in subscribers_of(topic))


def services_of(node: str) -> tuple[tuple[Service, ...], tuple[Service, ...]]:
    """Return the services that a node offers, and those that it calls."""
    offered = tuple(service for service in SERVICES if service.server == node)
    return offered, tuple(service for service in SERVICES if node in service.clients)


def qos_text(topic: Topic) -> str:
    """Return the quality of service of a topic in words."""
    profile = stored(profile_of(topic))
    history = "keep all" if profile.history is History.KEEP_ALL else f"keep last {profile.depth}"
    return ", ".join((profile.reliability.value, profile.durability.value, history)).replace("_", " ")


def _value(value: object) -> str:
    """Return a default as it is written on a command line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(map(str, value)) + "]"
    return "''" if value == "" else str(value)
