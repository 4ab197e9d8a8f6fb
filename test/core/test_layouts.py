"""The layouts for Foxglove and PlotJuggler name what is in a bag; a renamed topic or field shows up here."""

from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from sms_handover.bag.recording import Recording
from sms_handover.frames import DEPUTY, WORLD
from sms_handover.graph.topics import ROBOT_DESCRIPTION, graph_topics
from sms_handover.model.robot_model import RobotModel
from sms_handover.scene.links import DescribedRobot

from .bag_messages import TYPES, WALL_NS, joint_state, made_up_run, odometry, open_topics, record_run
from .layout_paths import (
    PLOTJUGGLER,
    Messages,
    foxglove_layout,
    foxglove_paths,
    foxglove_value,
    last_messages,
    plotjuggler_curves,
    plotjuggler_value,
)


@pytest.fixture(scope="module")
def messages(tmp_path_factory: pytest.TempPathFactory) -> Messages:
    run = made_up_run()
    folder = tmp_path_factory.mktemp("bag") / "bag"
    with Recording(folder, types=TYPES) as recording:
        open_topics(recording)
        record_run(recording, run)
        state = joint_state(0, run.joint_names, *(run.joint_position[0],) * 3)
        recording.receive("/sampled_joint_states", TYPES.serialize(state), WALL_NS)
        base = odometry(0, run.base_pose[0], run.base_twist[0])
        recording.receive("/sampled_base_odometry", TYPES.serialize(base), WALL_NS)
    return last_messages(folder)


@pytest.mark.parametrize(("path", "label"), list(foxglove_paths()))
def test_a_path_of_foxglove_leads_to_a_value(messages: Messages, path: str, label: str) -> None:
    assert isinstance(foxglove_value(path, messages), int | float | str)
    topic = path.split(".", maxsplit=1)[0]
    if "joint_states." in path:  # these are found by place, so the label has to be the name at that place
        place = int(path.rpartition("[")[2].rstrip("]"))
        assert foxglove_value(f"{topic}.name[{place}]", messages) == label


@pytest.mark.parametrize("name", plotjuggler_curves())
def test_a_curve_of_plotjuggler_leads_to_a_number(messages: Messages, name: str) -> None:
    assert isinstance(plotjuggler_value(name, messages), float)


@pytest.mark.parametrize(
    "path",
    ["/joint_state.position[0]", "/joint_states.positions[0]", "/joint_states.position[14]", "/energy.power"],
)
def test_a_path_that_leads_nowhere_is_noticed(messages: Messages, path: str) -> None:
    with pytest.raises(LookupError):
        foxglove_value(path, messages)


@pytest.mark.parametrize(
    "name",
    [
        "/joint_state/arm_a_joint_1/position",
        "/joint_states/arm_c_joint_1/position",
        "/energy/power",
        "/energy/yaw",
    ],
)
def test_a_curve_that_leads_nowhere_is_noticed(messages: Messages, name: str) -> None:
    with pytest.raises(LookupError):
        plotjuggler_value(name, messages)


def test_what_the_3d_panel_shows_is_there(messages: Messages, robot: RobotModel) -> None:
    panel = foxglove_layout()["configById"]["3D!scene"]
    published = {f"/{topic.name.lstrip('/')}" for topic in graph_topics(robot.arms)}
    assert set(panel["topics"]) <= published
    (layer,) = panel["layers"].values()
    assert layer["sourceType"] == "topic" and layer["topic"] == f"/{ROBOT_DESCRIPTION}"
    assert messages[layer["topic"]][0] == "std_msgs/msg/String"
    frames = {name.removeprefix("frame:") for name in panel["transforms"]}
    assert frames == {*DescribedRobot(robot.urdf).links, WORLD, DEPUTY}


def test_every_panel_has_one_place() -> None:
    layout = foxglove_layout()
    tabs = [tab["layout"] for tab in layout["configById"]["Tab!plots"]["tabs"]]
    placed = [name for part in (layout["layout"], *tabs) for name in leaves(part)]
    assert sorted(placed) == sorted(layout["configById"])


def test_the_tabs_of_plotjuggler_are_built_as_it_reads_them() -> None:
    """Its loader takes the number of plots and their sizes from the splitter, not from what is in it."""
    splitters = list(ET.parse(PLOTJUGGLER).iter("DockSplitter"))
    assert splitters
    for splitter in splitters:
        sizes = [float(size) for size in splitter.attrib["sizes"].split(";")]
        assert splitter.attrib["orientation"] in {"-", "|"}
        assert len(list(splitter)) == int(splitter.attrib["count"]) == len(sizes)
        assert sum(sizes) == pytest.approx(1.0, abs=1e-5)


def leaves(part: Any) -> Iterator[str]:
    if isinstance(part, str):
        yield part
    else:
        yield from leaves(part["first"])
        yield from leaves(part["second"])
