"""The RViz configuration names topics that are there, of types and qualities that its displays take."""

from typing import Any

import pytest
import yaml

from sms_handover.configuration.package_files import config_file
from sms_handover.frames import WORLD
from sms_handover.graph.topics import Topic, graph_topics
from sms_handover.model.robot_model import RobotModel

TAKES = {  # what each display of rviz_default_plugins subscribes to
    "RobotModel": "std_msgs/msg/String",
    "Marker": "visualization_msgs/msg/Marker",
    "MarkerArray": "visualization_msgs/msg/MarkerArray",
    "Pose": "geometry_msgs/msg/PoseStamped",
    "Odometry": "nav_msgs/msg/Odometry",
}
WITHOUT_TOPIC = {"Grid", "TF"}


@pytest.fixture(scope="module")
def manager() -> Any:
    text = config_file("rviz/sms_handover.rviz").read_text(encoding="utf-8")
    assert "<<" not in text and "*" not in text  # RViz's reader knows neither merged keys nor aliases
    return yaml.safe_load(text)["Visualization Manager"]


@pytest.fixture(scope="module")
def topics(robot: RobotModel) -> dict[str, Topic]:
    return {f"/{topic.name.lstrip('/')}": topic for topic in graph_topics(robot.arms)}


def test_the_fixed_frame_is_inertial(manager: Any) -> None:
    assert manager["Global Options"]["Fixed Frame"] == WORLD
    assert manager["Views"]["Current"]["Target Frame"] == WORLD


def test_every_display_gets_what_it_takes(manager: Any, topics: dict[str, Topic]) -> None:
    for display in manager["Displays"]:
        package, kind = display["Class"].split("/")
        assert package == "rviz_default_plugins"
        asked = display.get("Description Topic", display.get("Topic"))
        if kind in WITHOUT_TOPIC:
            assert asked is None
            continue
        topic = topics[asked["Value"]]
        assert topic.type == TAKES[kind], asked["Value"]


def test_no_display_asks_for_more_than_is_offered_or_holds_the_loop_back(
    manager: Any, topics: dict[str, Topic]
) -> None:
    """Latched topics are asked for as such; of the others a slow display may lose messages."""
    for display in manager["Displays"]:
        asked = display.get("Description Topic", display.get("Topic"))
        if asked is not None:
            latched = topics[asked["Value"]].latched
            assert asked["Durability Policy"] == ("Transient Local" if latched else "Volatile")
            assert asked["Reliability Policy"] == ("Reliable" if latched else "Best Effort")


def test_both_arms_and_the_deputy_are_shown(manager: Any, robot: RobotModel) -> None:
    shown = {display.get("Topic", {}).get("Value") for display in manager["Displays"]}
    poses = {f"/{arm}/{what}_pose" for arm in robot.arms for what in ("target", "tool")}
    assert shown >= {*poses, "/deputy/marker"}
    names = [display["Name"] for display in manager["Displays"]]
    assert len(names) == len(set(names))
