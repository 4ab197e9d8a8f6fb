"""The conventions of ROS that the nodes keep: REP 103, 105, 107, 2003, and use_sim_time."""

import re

import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticStatus

from sms_handover.bag.qos import Durability, Reliability
from sms_handover.configuration.package_files import config_file
from sms_handover.errors import ConfigurationError
from sms_handover.frames import BASE, WORLD
from sms_handover.graph.topics import NODES, graph_topics
from sms_handover.nodes.plant import PlantNode
from sms_handover.ros.node.diagnostics import NodeReport, diagnostics_message, node_of
from sms_handover.ros.qos import profile_of, stored

from .bench import Bench
from .graph import ARMS

pytestmark = pytest.mark.ros


def status(name: str, **values: object) -> DiagnosticStatus:
    """Return the status of a node that waits for nothing unless it is said otherwise."""
    told = {"report": NodeReport(), "wakes": 0, "waiting": (), "rejected": {}, **values}
    (status,) = diagnostics_message(name, **told).status  # type: ignore[arg-type]
    return status


def test_a_status_is_called_by_node_and_task_and_has_a_level() -> None:
    """REP 107: whoever reads it takes the level, names are for people and for analyzers."""
    assert (status("/plant").name, status("/sim/plant").name) == ("plant: loop", "sim/plant: loop")
    assert node_of(status("/sim/plant").name) == "sim/plant"
    levels = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR, DiagnosticStatus.STALE)
    assert levels == (b"\0", b"\1", b"\2", b"\3")
    assert status("/ik").level == DiagnosticStatus.OK
    assert status("/ik", waiting=["the plant"]).level == DiagnosticStatus.WARN
    assert status("/ik", rejected={"joint_states: old": 2}).level == DiagnosticStatus.WARN
    assert status("/ik", report=NodeReport(level=2, text="late")).level == DiagnosticStatus.ERROR
    assert status("/ik").hardware_id == "none"


@pytest.mark.parametrize("namespace", ["", "/sim"])
def test_one_analyzer_takes_the_status_of_each_node(namespace: str) -> None:
    text = config_file("diagnostics/analyzers.yaml").read_text(encoding="utf-8")
    parameters = yaml.safe_load(text)["analyzers"]["ros__parameters"]
    analyzers = [item for item in parameters.values() if isinstance(item, dict)]
    assert {item["type"] for item in analyzers} == {"diagnostic_aggregator/GenericAnalyzer"}
    for node in NODES:
        name = status(f"{namespace}/{node}").name
        assert sum(part in name for item in analyzers for part in item["contains"]) == 1, node


def test_frames_are_called_as_rep_105_and_tf2_have_them() -> None:
    """base_link is the robot, no name begins with a slash; world is what REP 105 calls earth or map."""
    assert BASE == "base_link" and re.fullmatch(r"[a-z_]+", WORLD)


def test_every_stream_is_reliable_and_every_description_latched() -> None:
    """REP 2003: publishers are reliable, so any subscriber is served; what is like a map is latched."""
    for topic in graph_topics(ARMS, clearance=True):
        profile = stored(profile_of(topic))
        assert profile.reliability is Reliability.RELIABLE
        assert (profile.durability is Durability.TRANSIENT_LOCAL) is topic.latched
    latched = {topic.name for topic in graph_topics(ARMS) if topic.latched}
    assert {"robot_description", "tf_static"} <= latched


def test_a_node_that_makes_time_does_not_take_it_from_clock(bench: Bench) -> None:
    """use_sim_time is for those who read /clock: the plant that publishes it would wait for itself."""
    bench.start({"plant": {"use_sim_time": True}})
    with pytest.raises(ConfigurationError, match="'use_sim_time' is true, must be false"):
        bench.add(PlantNode)
