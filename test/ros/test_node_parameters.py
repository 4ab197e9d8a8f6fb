"""A parameter of one node reaches it in any namespace, and no other node."""

from pathlib import Path

import pytest
import yaml

from sms_handover.nodes.recorder import of_other_graphs
from sms_handover.ros.process.node_parameters import in_any_namespace

from .graph import TOPICS

pytestmark = pytest.mark.ros

STATE, TEXT = "sms_handover_interfaces/msg/RunState", "std_msgs/msg/String"


def test_without_a_namespace_nothing_changes() -> None:
    arguments = ["plant", "--ros-args", "-p", "recorder:folder:='a b'", "-p", "tick:=0.001"]
    with in_any_namespace(arguments) as words:
        assert words == arguments


@pytest.mark.parametrize("rule", ["__ns:=/sim", "recorder:__ns:=/sim"])
def test_in_a_namespace_a_file_says_it(rule: str) -> None:
    """In its place: what comes later lies over it."""
    before, after = ["--ros-args", "-r", rule, "-p", "tick:=0.001"], ["-p", "duration:=1.0"]
    with in_any_namespace([*before, "-p", "recorder:folder:='it''s: here'", *after]) as words:
        flag, file = words[len(before) : -len(after)]
        assert (words[: len(before)], flag, words[-len(after) :]) == (before, "--params-file", after)
        text = Path(file).read_text(encoding="utf-8")
        assert yaml.safe_load(text) == {"/**/recorder": {"ros__parameters": {"folder": "it's: here"}}}
    assert not Path(file).exists()


def test_another_graph_is_known_by_its_run_state() -> None:
    found = [("/a/run/state", [STATE]), ("/b/run/state", [TEXT]), ("/b/x", [TEXT]), ("/a/x", [TEXT])]
    assert of_other_graphs(found, "/run/state", TOPICS) == {"/a/run/state", "/a/x"}
    assert of_other_graphs(found, "/a/run/state", TOPICS) == frozenset()
    found += [("/run/state", [STATE]), ("/camera", [TEXT]), ("/joint_states", [TEXT]), ("/clock", [TEXT])]
    without = of_other_graphs(found, "/a/run/state", TOPICS)
    assert {"/run/state", "/joint_states"} <= without and not {"/a/x", "/camera", "/clock"} & without
