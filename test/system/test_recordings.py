"""What the bag of a run over DDS holds, and the commands that read it."""

from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from sms_handover.bag.info import read_info
from sms_handover.simulation.scenario import load_scenario
from sms_handover.topics import NODES

from .commands import sms_handover
from .conftest import TICKS

pytestmark = [pytest.mark.system, pytest.mark.slow]


def recorded(folder: Path, schedule: Path, law: str, name: str) -> Path:
    """Return the bag of a run over DDS."""
    done = sms_handover(folder, "run", "--controller", law, "--schedule", str(schedule), "-o", name)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / name / "bag"


def test_the_bag_has_every_message_and_stands_on_its_own(schedule: Path, tmp_path: Path) -> None:
    """Three readers count the same, and parameters, schedule, robot and versions are inside."""
    bag = recorded(tmp_path, schedule, "nmpc", "run")
    scenario = load_scenario({"common": {"schedule": str(schedule)}})
    common = scenario.parameters.common
    ticks = common.last_tick(scenario.schedule.end_ns)
    expected = {"/joint_states": ticks + 1, "/base_odometry": ticks + 1, "/joint_command": ticks + 1}
    for topic in ("/joint_reference", "/task/phase", "/deputy/pose", "/arm_a/tool_pose", "/tf"):
        expected[topic] = ticks // common.ticks_per_reference + 1
    info = read_info(bag)
    counts = {topic: info.topics[topic].message_count for topic in expected}
    with AnyReader([bag]) as reader:
        by_rosbags = {topic: 0 for topic in expected}
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
            if connection.topic in by_rosbags:
                by_rosbags[connection.topic] += 1
    by_mcap = {topic: 0 for topic in expected}
    with (bag / "bag_0.mcap").open("rb") as stream:
        for _, channel, _, _ in make_reader(
            stream, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            if channel.topic in by_mcap:
                by_mcap[channel.topic] += 1
    assert counts == by_rosbags == by_mcap == expected
    assert info.ledger is not None and info.ledger.complete
    assert info.parameters is not None and set(info.parameters) == set(NODES)
    assert info.schedule_text == schedule.read_text(encoding="utf-8")
    assert info.urdf_text == scenario.robot.urdf
    assert info.provenance["version.pin"] != "unknown"


def test_a_bag_reproduces_itself_and_compares(schedule: Path, tmp_path: Path) -> None:
    """``reproduce`` needs the bag only, and tells a changed bit; ``compare`` prints the grasps."""
    recorded(tmp_path, schedule, "nmpc", "run")
    schedule_copy = schedule.read_text(encoding="utf-8")
    again = sms_handover(tmp_path, "reproduce", "run")
    assert (again.returncode, again.stderr) == (0, "")
    assert "the same bit for bit" in again.stdout
    compared = sms_handover(tmp_path, "compare", "run", "--json", "figures.json")
    assert compared.returncode == 0, compared.stderr
    assert "arm_b takes end_b from arm_a" in compared.stdout
    assert (tmp_path / "figures.json").stat().st_size > 0
    assert schedule.read_text(encoding="utf-8") == schedule_copy


def test_real_time_ends_and_tells_how_it_kept_time(schedule: Path, tmp_path: Path) -> None:
    """Paced by the wall clock the whole run is recorded too, with the timing of its loop."""
    done = sms_handover(tmp_path, "run", "--real-time", "--schedule", str(schedule), "-o", "run")
    assert done.returncode in (0, 4), done.stdout + done.stderr  # 4: a late command made a grasp miss
    info = read_info(tmp_path / "run" / "bag")
    assert info.topics["/loop_timing"].message_count > 0
    assert info.topics["/joint_states"].message_count == TICKS
