"""The launch arguments set what they say, and the launch file starts the graph, with a stand-in for launch.

No wheel carries ``launch`` and ``launch_ros``; docs/ros2.md tells what was tried with the real ones.
"""

import os
import runpy
import sys
from itertools import pairwise
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.parameters import build, read_parameter_files
from sms_handover.errors import ConfigurationError, GraphError
from sms_handover.graph.topics import CONTAINER, CONTROLLER, IK, LOOP_NODES, PLANT, RECORDER, TRAJECTORY
from sms_handover.ros.launching.composition import ProcessArguments
from sms_handover.ros.launching.launch_arguments import ARGUMENTS, launch_processes
from sms_handover.ros.process.launcher_process import LAUNCHER_PID

from ..workspace import ROOT, executables

pytestmark = pytest.mark.ros

SAMPLES = {
    "controller": "pid",
    "time_law": "quintic",
    "dynamics": "compiled",
    "scenario": "my run.yaml",
    "conditions": "nominal",
    "schedule": "my task.yaml",
    "robot": "robot.yaml",
    "duration": "5",
    "mode": "realtime",
    "bag": "runs/mine",
    "external": "controller",
    "autostart": "false",
}


def assigned(arguments: ProcessArguments) -> list[str]:
    """Return the assignments behind ``-p``."""
    return [value for flag, value in pairwise(arguments.ros) if flag == "-p"]


def test_without_arguments_nodes_only_learn_their_peers() -> None:
    nodes = launch_processes(dict.fromkeys(ARGUMENTS, ""), record=True, compose=False)
    assert list(nodes) == [*LOOP_NODES, RECORDER]
    for arguments in nodes.values():
        (peers,) = assigned(arguments)
        assert peers == "peers:=['plant', 'trajectory', 'ik', 'controller', 'recorder']"


def test_without_a_recorder_nobody_waits_for_one() -> None:
    nodes = launch_processes({"bag": "mine"}, record=False, compose=False)
    assert list(nodes) == list(LOOP_NODES)
    assert all(RECORDER not in " ".join(arguments.ros) for arguments in nodes.values())


def test_a_host_starts_its_nodes_and_these_wait_for_all() -> None:
    whole = launch_processes({}, record=True, compose=False)
    here = launch_processes({"nodes": "ik, recorder"}, record=True, compose=False)
    assert here == {name: whole[name] for name in ("ik", "recorder")}


@pytest.mark.parametrize("name", list(ARGUMENTS))
def test_an_argument_reaches_its_nodes_and_no_other(name: str) -> None:
    argument = ARGUMENTS[name]
    nodes = launch_processes({name: SAMPLES[name]}, record=True, compose=False)
    reached = {
        node
        for node, arguments in nodes.items()
        if any(f"-p {of}{argument.parameter}:=" in " ".join(arguments.ros) for of in ("", f"{node}:"))
    }
    assert reached == ({argument.node} if argument.node else set(nodes))


def test_an_external_node_is_waited_for_but_not_started() -> None:
    nodes = launch_processes({"external": "controller"}, record=True, compose=False)
    assert list(nodes) == ["plant", "trajectory", "ik", "recorder"]
    for arguments in nodes.values():
        external, peers = assigned(arguments)
        assert external == "external:=['controller']" and "'controller'" in peers
    together = launch_processes({"external": "controller"}, record=True, compose=True)
    assert list(together) == [CONTAINER, RECORDER]
    assert together[CONTAINER].nodes == ("plant", "trajectory", "ik")


def test_a_container_gets_what_its_nodes_would_get() -> None:
    given = {"controller": "pid", "time_law": "quintic", "duration": "5", "bag": "mine"}
    apart = launch_processes(given, record=True, compose=False)
    together = launch_processes(given, record=True, compose=True)
    assert list(together) == [CONTAINER, RECORDER]
    assert together[CONTAINER].line[:5] == (*LOOP_NODES, "--ros-args")
    assert together[RECORDER] == apart[RECORDER]
    inside = {value for node in LOOP_NODES for value in assigned(apart[node])}
    assert set(assigned(together[CONTAINER])) == inside
    assert {"controller:law:='pid'", "trajectory:time_law:='quintic'", "duration:=5.0"} < inside


def test_in_real_time_what_may_take_longer_than_a_tick_stays_apart() -> None:
    processes = launch_processes({"mode": "realtime"}, record=True, compose=True)
    assert list(processes) == [CONTAINER, TRAJECTORY, IK, RECORDER]
    assert processes[CONTAINER].nodes == (PLANT, CONTROLLER)


@pytest.mark.parametrize("name", list(ARGUMENTS))
def test_every_sample_is_a_value_of_its_parameter(name: str) -> None:
    """So an argument names a parameter that exists, and a number arrives as one."""
    group, parameter = ARGUMENTS[name].group, ARGUMENTS[name].parameter
    defaults = read_parameter_files([config_file(group.file)], group.section)
    assert parameter in defaults
    typed: dict[str, object] = {"duration": 5.0, "external": ["controller"], "autostart": False}
    value = typed.get(name, SAMPLES[name])
    build(group.cls, {**defaults, parameter: value}, name)
    choices = ARGUMENTS[name].choices
    assert choices is None or SAMPLES[name] in choices


def test_arguments_lie_over_the_parameter_file() -> None:
    nodes = launch_processes({"params_file": "mine.yaml", "controller": "pid"}, record=False, compose=False)
    assert nodes["controller"].ros[:2] == ("--params-file", "mine.yaml")
    assert nodes["controller"].ros[-2:] == ("-p", "controller:law:='pid'")
    assert nodes["plant"].ros[:2] == ("--params-file", "mine.yaml")


def test_a_number_that_is_none_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="launch argument 'duration' is 'long', expected a number s"):
        launch_processes({"duration": "long"}, record=True, compose=False)


class Action(SimpleNamespace):
    """Stands for every class of the launch system; keeps what it was made with."""

    def __init__(self, *args: object, **kwargs: object) -> None:
        super().__init__(args=args, **kwargs)


@pytest.fixture
def launch_file(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the launch file defines."""
    names = {
        "launch": ("LaunchContext", "LaunchDescription"),
        "launch.actions": ("DeclareLaunchArgument", "OpaqueFunction", "Shutdown"),
        "launch.events": (),
        "launch.events.process": ("ProcessExited",),
        "launch_ros": (),
        "launch_ros.actions": ("Node",),
    }
    for name, classes in names.items():
        module = ModuleType(name)
        for item in classes:
            setattr(module, item, Action)
        monkeypatch.setitem(sys.modules, name, module)
    return runpy.run_path(str(Path(ROOT, "launch", "handover.launch.py")))


def test_the_launch_file_declares_every_argument_and_starts_every_node(launch_file: dict[str, Any]) -> None:
    (entities,) = launch_file["generate_launch_description"]().args
    declared = {item.args[0]: item.default_value for item in entities if item.args}
    assert set(declared) >= set(ARGUMENTS)
    (start,) = [item.function for item in entities if not item.args]
    nodes = start(SimpleNamespace(launch_configurations={**declared, "controller": "pid"}))
    assert [node.executable for node in nodes] == [*LOOP_NODES, RECORDER]
    assert {node.executable for node in nodes} <= set(executables())
    assert all(node.additional_env[LAUNCHER_PID] == str(os.getpid()) for node in nodes)
    assert all("controller:law:='pid'" in node.ros_arguments for node in nodes if node.name == "controller")
    without = start(SimpleNamespace(launch_configurations={**declared, "record": "false"}))
    assert [node.name for node in without] == list(LOOP_NODES)
    composed = start(SimpleNamespace(launch_configurations={**declared, "compose": "true"}))
    assert [(node.executable, node.name) for node in composed] == [(CONTAINER, None), (RECORDER, RECORDER)]


def test_the_launch_ends_with_the_recorder_and_fails_with_any_node(launch_file: dict[str, Any]) -> None:
    end = launch_file["end"]
    running, ending = SimpleNamespace(is_shutdown=False), SimpleNamespace(is_shutdown=True)
    done = SimpleNamespace(process_name="recorder-5", returncode=0)
    failed = SimpleNamespace(process_name="plant-1", returncode=2)
    assert end(done, running).reason == "recorder-5 is done"
    assert end(failed, ending) is None
    with pytest.raises(GraphError, match="plant-1 ended with exit code 2"):
        end(failed, running)
