"""The help and the reference of a node tell what the node really has, and their examples work."""

import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from inspect import getdoc
from pathlib import Path
from typing import Any, cast

import pytest
import rclpy
from rclpy.parameter import Parameter

from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.parameters import build, read_parameter_files
from sms_handover.graph.topics import (
    CLOCK,
    CONTAINER,
    LOOP_NODES,
    NODES,
    PLAYER,
    RUN_STATE,
    TF,
    Rate,
    graph_topics,
)
from sms_handover.nodes.controller import ControllerNode
from sms_handover.nodes.ik import IkNode
from sms_handover.nodes.parts.playback_services import offer_services
from sms_handover.nodes.plant import PlantNode
from sms_handover.nodes.recorder import RecorderNode
from sms_handover.nodes.trajectory import TrajectoryNode
from sms_handover.ros.node.graph_node import GraphNode
from sms_handover.ros.reference.help import EXAMPLES, node_help
from sms_handover.ros.reference.interfaces import (
    ANY_ARM,
    OWN_GROUPS,
    groups_of,
    parameter_rows,
    qos_text,
    services_of,
    topics_of,
)

from ..workspace import ROOT, executables
from .bench import Bench

pytestmark = pytest.mark.ros

GRAPH: dict[str, Callable[[], GraphNode[Any]]] = {
    "plant": PlantNode,
    "trajectory": TrajectoryNode,
    "ik": IkNode,
    "controller": ControllerNode,
    "recorder": RecorderNode,
}
ROS_OWN = {"/rosout", "/parameter_events"}
ROS_SERVICES = ("parameter", "type_description", "change_state", "/get_available", "/get_state", "_graph")


def absolute(names: set[str]) -> set[str]:
    """Return relative names as they are in the root namespace."""
    return {name if name.startswith("/") else f"/{name}" for name in names}


def expanded(names: set[str]) -> set[str]:
    """Return the names with the arms of the shipped robot for any arm."""
    return {name.replace(ANY_ARM, arm) for name in names for arm in ("arm_a", "arm_b")}


@pytest.mark.parametrize("name", list(GRAPH))
def test_the_reference_is_what_the_node_has(
    name: str, bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every publisher, subscription, service and parameter of the running node is told, and no other."""
    monkeypatch.chdir(tmp_path)
    every_topic = {"clearance": "online", "conditions": "harsh"}
    bench.start({name: every_topic} if name in NODES else {})
    node = bench.add(GRAPH[name])
    published, subscribed = topics_of(name)
    told = {topic.name: topic.type for topic in published}
    ros_own = {*ROS_OWN, f"/{name}/transition_event"}
    publishes, reads = absolute(expanded(set(told))), absolute(expanded({t.name for t in subscribed}))

    def theirs() -> tuple[dict[str, list[str]], dict[str, list[str]]]:
        ends = (node.get_publisher_names_and_types_by_node, node.get_subscriber_names_and_types_by_node)
        found, heard = ({t: kinds for t, kinds in end(name, "/") if t not in ros_own} for end in ends)
        return found, heard

    def is_told() -> bool:  # what a node has made may take a moment to be told
        found, heard = theirs()
        return publishes <= set(found) and reads <= set(heard)

    bench.until(is_told, "the endpoints of the node")
    found, heard = theirs()
    assert (set(found), set(heard)) == (publishes, reads)
    assert all(type_name in told.values() for (type_name,) in found.values())
    offered, called = services_of(name)
    own = {s: t for s, t in node.get_service_names_and_types_by_node(name, "/")}
    own = {service: types for service, types in own.items() if not any(r in service for r in ROS_SERVICES)}
    assert own == {f"/{service.relative_name}": [service.type] for service in offered}
    clients = dict(node.get_client_names_and_types_by_node(name, "/"))
    clients = {
        service: types for service, types in clients.items() if not any(r in service for r in ROS_SERVICES)
    }
    assert clients == {f"/{service.relative_name}": [service.type] for service in called}


def test_the_services_told_of_the_player_are_those_it_offers(bench: Bench) -> None:
    bench.start()
    node = bench.plain(PLAYER)
    offer_services(node, cast(Any, None), lambda: None)  # nothing is called
    own = dict(node.get_service_names_and_types_by_node(PLAYER, "/"))
    assert {f"/{s.relative_name}": [s.type] for s in services_of(PLAYER)[0]} == {
        name: types for name, types in own.items() if not any(part in name for part in ROS_SERVICES)
    }


@pytest.mark.parametrize("name", list(OWN_GROUPS))
def test_help_names_everything(name: str) -> None:
    cls = getattr(import_module(f"sms_handover.nodes.{name}"), name.title().replace("_", "") + "Node")
    text = node_help(name, cls)
    assert str(getdoc(cls)) in text
    rows = [row for group in groups_of(name) for row in parameter_rows(group)]
    assert len(rows) == len({row.name for row in rows}) > 0
    for row in rows:
        assert f"  {row.name} = {row.default}" in text
    for topic in (*topics_of(name)[0], *topics_of(name)[1]):
        assert f"  {topic.name}  {topic.type}" in text
    for service in (*services_of(name)[0], *services_of(name)[1]):
        assert f"  {service.relative_name}  {service.type}" in text
    assert all(len(line) <= 120 for line in text.splitlines())


@pytest.mark.parametrize("name", list(EXAMPLES))
def test_examples_are_accepted(name: str) -> None:
    """The node would take the values, and each differs from the default."""
    group = OWN_GROUPS[name]
    defaults = read_parameter_files([config_file(group.file)], group.section)
    build(group.cls, {**defaults, **EXAMPLES[name]}, name)
    assert all(defaults[key] != value for key, value in EXAMPLES[name].items())


def test_every_node_has_a_reference_and_an_example() -> None:
    files = {path.stem for path in (ROOT / "sms_handover" / "nodes").glob("[!_]*.py")}
    assert files - {CONTAINER} == set(OWN_GROUPS) == set(EXAMPLES)
    assert files <= set(executables())


def test_a_node_shows_its_help_without_starting_ros(capfd: pytest.CaptureFixture[str]) -> None:
    main = import_module("sms_handover.nodes.plant").main
    assert main(["plant", "--help"]) == 0
    assert main(["plant", "--ros-args", "-p", "integrator:=nothing", "-h"]) == 0
    assert not rclpy.ok()
    assert capfd.readouterr().out == 2 * (node_help("plant", PlantNode) + "\n")


def test_the_container_tells_which_nodes_it_runs(capfd: pytest.CaptureFixture[str]) -> None:
    assert import_module("sms_handover.nodes.container").main(["container", "--help"]) == 0
    text = capfd.readouterr().out
    assert all(f"\n  {node}\n" in text for node in LOOP_NODES)
    assert "-p controller:law:=pid" in text


def test_a_reader_need_not_take_the_whole_help() -> None:
    command = [sys.executable, "-u", "-m", "sms_handover.nodes.ik", "--help"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        assert (process.wait(), process.stderr.read()) == (0, b"")


def test_quality_of_service_is_told_as_it_is() -> None:
    table = {topic.name: topic for topic in graph_topics([ANY_ARM])}
    assert qos_text(table[CLOCK]) == "reliable, volatile, keep all"
    assert table[RUN_STATE].rate is Rate.CHANGE
    assert qos_text(table[RUN_STATE]) == "reliable, transient local, keep last 100"
    assert qos_text(table[TF]) == "reliable, volatile, keep last 1000"
    assert set(NODES) <= set(OWN_GROUPS)


def test_types_are_those_that_ros_gives() -> None:
    """The names of types are those of rclpy for the default values."""
    for group in OWN_GROUPS.values():
        defaults = read_parameter_files([config_file(group.file)], group.section)
        for row in parameter_rows(group):
            value = defaults[row.name]
            if value != []:  # an empty list has any type
                assert Parameter(row.name, value=value).type_.name.lower() == row.type, row
