"""Bags are written as rosbag2 does, open in every reader, and are complete whatever ends the recording."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader

from sms_handover.bag.files import read_messages
from sms_handover.bag.info import read_info
from sms_handover.bag.qos import Durability, History, Qos, Reliability
from sms_handover.bag.recording import Recording
from sms_handover.bag.run.reader import read_run
from sms_handover.bag.writer import BagWriter
from sms_handover.errors import BagError
from sms_handover.messages.message_types import MessageTypes

from .bag_messages import (
    JOINT_STATE,
    JOINTS,
    OURS,
    TICK_NS,
    TYPES,
    WALL_NS,
    ik_status,
    joint_state,
    made_up_run,
    text,
    write_run,
)

STATES = "/joint_states"


def state_bytes(tick: int) -> bytes:
    return TYPES.serialize(joint_state(tick * TICK_NS, JOINTS, [float(tick)] * 14))


def write_states(folder: Path, ticks: int) -> list[bytes]:
    """Write a bag of joint states and return their bytes."""
    messages = [state_bytes(tick) for tick in range(ticks)]
    with BagWriter(folder, types=TYPES) as writer:
        writer.add_topic(STATES, JOINT_STATE, [Qos(history=History.KEEP_ALL)])
        for tick, data in enumerate(messages):
            writer.write(STATES, data, tick * TICK_NS, WALL_NS + tick)
    return messages


def test_rosbags_reads_folder_and_file_with_equal_bytes(tmp_path: Path) -> None:
    messages = write_states(tmp_path / "bag", 300)
    for path in (tmp_path / "bag", tmp_path / "bag" / "bag_0.mcap"):
        with Reader(path) as reader:
            assert [bytes(data) for _, _, data in reader.messages()] == messages
            assert reader.message_count == 300
            assert reader.duration == 299 * TICK_NS + 1
            assert [(c.topic, c.msgtype) for c in reader.connections] == [(STATES, JOINT_STATE)]
    with AnyReader([tmp_path / "bag"]) as reader:
        connection, time_ns, data = list(reader.messages())[5]
        message: Any = reader.deserialize(data, connection.msgtype)
        assert (time_ns, message.position[0]) == (5 * TICK_NS, 5.0)


def test_mcap_and_its_ros2_decoder_read_every_type_of_the_graph(tmp_path: Path) -> None:
    run = made_up_run(41)
    folder = write_run(tmp_path / "bag", run)
    with (folder / "bag_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        decoded = [(c.topic, m.log_time, v) for _, c, m, v in reader.iter_decoded_messages()]
    states = [value for topic, _, value in decoded if topic == STATES]
    assert [list(value.position) for value in states] == run.joint_position.tolist()
    phases = [value for topic, _, value in decoded if topic == "/task/phase"]
    assert [value.name for value in phases] == [phase.name for phase in run.phases]
    assert [command.arm for command in phases[2].commands] == ["arm_a", "arm_b"]
    assert {time_ns for topic, time_ns, _ in decoded if topic == STATES} == set(run.tick_ns.tolist())


def test_metadata_has_the_layout_of_version_9(tmp_path: Path) -> None:
    write_states(tmp_path / "bag", 50)
    text_of_file = (tmp_path / "bag" / "metadata.yaml").read_text()
    body = yaml.safe_load(text_of_file)["rosbag2_bagfile_information"]
    assert (body["version"], body["storage_identifier"], body["ros_distro"]) == (9, "mcap", "jazzy")
    assert body["message_count"] == body["files"][0]["message_count"] == 50
    assert body["relative_file_paths"] == [body["files"][0]["path"]] == ["bag_0.mcap"]
    assert body["duration"]["nanoseconds"] == 49 * TICK_NS
    assert body["starting_time"]["nanoseconds_since_epoch"] == 0
    topic = body["topics_with_message_count"][0]["topic_metadata"]
    qos = topic["offered_qos_profiles"][0]
    assert (qos["history"], qos["reliability"], qos["durability"]) == ("keep_all", "reliable", "volatile")
    assert qos["deadline"] == {"sec": 9223372036, "nsec": 854775807}
    assert topic["type_description_hash"] == MessageTypes().schema(JOINT_STATE).type_hash
    assert "&" not in text_of_file  # no YAML anchors
    record = read_info(tmp_path / "bag").records["rosbag2"]["serialized_metadata"]
    assert yaml.safe_load(record) == body


def test_channels_carry_qos_and_type_hash(tmp_path: Path) -> None:
    latched = Qos(Reliability.BEST_EFFORT, Durability.TRANSIENT_LOCAL, History.KEEP_LAST, 7)
    with BagWriter(tmp_path / "bag", types=TYPES) as writer:
        writer.add_topic("/a", "std_msgs/msg/String", [latched, Qos()])
        writer.add_topic("/b", "std_msgs/msg/String")
    info = read_info(tmp_path / "bag").topics["/a"]
    assert info.type_hash.startswith("RIHS01_")
    assert yaml.safe_load(info.qos) == [latched.to_rosbag2(), Qos().to_rosbag2()]
    for path in (tmp_path / "bag", tmp_path / "bag" / "bag_0.mcap"):
        with Reader(path) as reader:
            extension: Any = reader.connections[0].ext
            profile = extension.offered_qos_profiles[0]
            assert (profile.durability, profile.depth) == (QosDurability.TRANSIENT_LOCAL, 7)
            assert profile.reliability == QosReliability.BEST_EFFORT


def test_log_time_is_simulation_time_and_publish_time_wall_time(tmp_path: Path) -> None:
    write_states(tmp_path / "bag", 3)
    times = [(m.log_time_ns, m.publish_time_ns) for m in read_messages(tmp_path / "bag")]
    assert times == [(0, WALL_NS), (TICK_NS, WALL_NS + 1), (2 * TICK_NS, WALL_NS + 2)]


def test_attachments_and_records_come_back(tmp_path: Path) -> None:
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        recording.add_topic(STATES, JOINT_STATE)
        recording.describe(urdf="<robot/>", parameters={"plant": {"tick": 0.001, "limits": [39.0, 9.0]}})
        recording.receive(STATES, state_bytes(0), WALL_NS)
        recording.describe(schedule="phases: []\n", provenance={"seed": "1"})
        recording.writer.attach("notes.txt", "text/plain", b"\x00\xff", WALL_NS)
        recording.writer.record("user", {"key": "value"})
    info = read_info(tmp_path / "bag")
    assert (info.urdf_text, info.schedule_text) == ("<robot/>", "phases: []\n")
    assert info.parameters == {"plant": {"tick": 0.001, "limits": [39.0, 9.0]}}
    assert info.provenance == {"seed": "1"}
    assert info.attachments["notes.txt"] == b"\x00\xff"
    assert info.records["user"] == {"key": "value"}
    assert (info.message_count, info.profile, info.library) == (1, "ros2", "sms_handover")


def test_a_bag_without_messages_opens(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", types=TYPES) as writer:
        writer.add_topic(STATES, JOINT_STATE)
    with Reader(tmp_path / "bag") as reader:
        assert (reader.message_count, [c.topic for c in reader.connections]) == (0, [STATES])
    info = read_info(tmp_path / "bag")
    assert (info.message_count, info.duration_ns, list(info.topics)) == (0, 0, [STATES])


def test_an_error_in_the_block_leaves_a_complete_bag(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="from the block"), Recording(tmp_path / "bag") as recording:
        recording.add_topic(STATES, JOINT_STATE, period_ns=TICK_NS)
        for tick in range(10):
            recording.receive(STATES, state_bytes(tick), WALL_NS)
        raise RuntimeError("from the block")
    with Reader(tmp_path / "bag") as reader:
        assert reader.message_count == 10
    ledger = read_info(tmp_path / "bag").ledger
    assert ledger is not None
    assert ledger.topics[0].received == 10


def test_close_twice_does_nothing_and_then_nothing_is_taken(tmp_path: Path) -> None:
    recording = Recording(tmp_path / "bag", types=TYPES)
    recording.add_topic(STATES, JOINT_STATE)
    recording.receive(STATES, state_bytes(0), WALL_NS)
    recording.close()
    content = recording.writer.path.read_bytes()
    recording.close()
    recording.writer.close()
    assert recording.writer.path.read_bytes() == content
    for act in (
        lambda: recording.receive(STATES, state_bytes(1), WALL_NS),
        lambda: recording.add_topic("/late", JOINT_STATE),
        lambda: recording.writer.attach("late", "text/plain", b""),
        lambda: recording.writer.record("late", {}),
        recording.writer.flush,
    ):
        with pytest.raises(BagError, match="is closed"):
            act()


def test_a_folder_that_exists_or_cannot_be_is_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", types=TYPES), pytest.raises(BagError, match="exists already: a rec"):
        BagWriter(tmp_path / "bag", types=TYPES)  # a second recorder on the same folder
    with pytest.raises(BagError, match="its parent folder does not exist"):
        BagWriter(tmp_path / "absent" / "bag", types=TYPES)
    (tmp_path / "file").touch()
    with pytest.raises(BagError, match="exists already"):
        BagWriter(tmp_path / "file", types=TYPES)
    with pytest.raises(BagError, match=r"cannot create the recording .*: Not a directory"):
        BagWriter(tmp_path / "file" / "bag", types=TYPES)
    with pytest.raises(BagError, match=r"cannot create the recording .*: File name too long"):
        BagWriter(tmp_path / ("b" * 300), types=TYPES)
    with pytest.raises(BagError, match=r"cannot create the recording .*: File name too long"):
        BagWriter(tmp_path / ("b" * 252), types=TYPES)  # the folder can be made, the file in it not
    assert not (tmp_path / ("b" * 252)).exists()


def test_wrong_use_is_named(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", types=TYPES) as writer:
        writer.add_topic(STATES, JOINT_STATE)
        with pytest.raises(BagError, match=r"topic '/joint_states' is recorded into .* already"):
            writer.add_topic(STATES, JOINT_STATE)
        with pytest.raises(BagError, match="no definition of the message type 'absent_msgs/msg/None'"):
            writer.add_topic("/absent", "absent_msgs/msg/None")
        with pytest.raises(BagError, match="topic '/other' was not added"):
            writer.write("/other", state_bytes(0), 0, 0)
        with pytest.raises(BagError, match="negative time"):
            writer.write(STATES, state_bytes(0), -1, 0)
        writer.write(STATES, state_bytes(0), 0, 0)
    assert writer.message_counts == {STATES: 1}
    assert read_info(tmp_path / "bag").message_count == 1


def test_what_is_not_flushed_yet_covers_20_ms_at_most(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", types=TYPES) as writer:
        writer.add_topic(STATES, JOINT_STATE)
        for tick in range(1000):
            writer.write(STATES, state_bytes(tick), tick * TICK_NS, WALL_NS)
        # what a kill would leave now, read with an end put to it
        there = writer.path.read_bytes()
        writer.flush()
        flushed = writer.path.read_bytes()
    assert count_messages(tmp_path / "there.mcap", there) >= 1000 - 20
    assert count_messages(tmp_path / "flushed.mcap", flushed) == 1000


def count_messages(path: Path, content: bytes) -> int:
    """Count the messages in an unfinished file, as a recovery would."""
    path.write_bytes(content)
    count = 0
    with path.open("rb") as stream, pytest.raises(EndOfFile):
        for record in StreamReader(stream).records:
            count += isinstance(record, Message)
    return count


FULL_DISK = """
import resource, sys
from pathlib import Path
from sms_handover.bag.recording import Recording
from sms_handover.errors import BagError
resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))
import random
random.seed(0)
try:
    with Recording(Path(sys.argv[1])) as recording:
        recording.add_topic("/text", "std_msgs/msg/ByteMultiArray")
        for count in range(1000):
            data = b"\\0\\1\\0\\0" + random.randbytes(1000)
            recording.receive("/text", data, count)
except BagError as error:
    print(error)
"""


def test_a_full_disk_ends_in_one_line_and_a_file_that_is_not_called_complete(tmp_path: Path) -> None:
    command = [sys.executable, "-c", FULL_DISK, str(tmp_path / "bag")]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert result.stdout.count("\n") == 1
    assert "cannot write the recording" in result.stdout
    assert "File too large" in result.stdout
    assert result.stderr == ""
    assert not (tmp_path / "bag" / "metadata.yaml").exists()
    with pytest.raises(BagError, match="was not closed"):
        read_run(tmp_path / "bag")


def test_our_types_are_written_with_a_schema_that_others_read(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", types=TYPES) as writer:
        writer.add_topic("/ik/status", f"{OURS}/IkStatus")
        writer.add_topic("/text", "std_msgs/msg/String")
        writer.write("/ik/status", TYPES.serialize(ik_status(7, 1)), 7, 8)
        writer.write("/text", TYPES.serialize(text("äöü")), 7, 8)
    with AnyReader([tmp_path / "bag"]) as reader:
        values: list[Any] = [reader.deserialize(data, c.msgtype) for c, _, data in reader.messages()]
    assert (values[0].status, values[0].manipulability.tolist()) == (1, [0.1, 0.2])
    assert values[1].data == "äöü"


def test_a_folder_that_is_moved_takes_its_whole_bag_along(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", types=TYPES) as writer:
        writer.add_topic(STATES, JOINT_STATE)
        writer.write(STATES, state_bytes(0), 0, 0)
        (tmp_path / "bag").rename(tmp_path / "moved")
        writer.write(STATES, state_bytes(1), TICK_NS, 0)
    with Reader(tmp_path / "moved") as reader:
        assert reader.message_count == 2


def test_a_folder_that_is_deleted_ends_the_recording_within_a_flush(tmp_path: Path) -> None:
    """The system would go on taking bytes for a file that nobody can ever open again."""
    writer = BagWriter(tmp_path / "bag", types=TYPES)
    writer.add_topic(STATES, JOINT_STATE)
    writer.write(STATES, state_bytes(0), 0, 0)
    shutil.rmtree(tmp_path / "bag")
    with pytest.raises(BagError, match=r"cannot write the recording .*: it was deleted while it was"):
        for tick in range(1, 22):
            writer.write(STATES, state_bytes(tick), tick * TICK_NS, 0)
    with pytest.raises(BagError, match="it was deleted"):
        writer.close()


def test_only_the_folder_gone_is_told_at_the_end(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "bag", types=TYPES)
    os.link(writer.path, tmp_path / "rescued.mcap")
    shutil.rmtree(tmp_path / "bag")
    with pytest.raises(BagError, match=r"cannot write the recording .*: No such file or directory"):
        writer.close()
    assert read_info(tmp_path / "rescued.mcap").message_count == 0
