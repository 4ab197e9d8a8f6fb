"""Any ROS 2 MCAP bag can be looked into: ours, those of other writers, split ones, those without an index."""

from pathlib import Path

import pytest
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from sms_handover.bag.files import read_messages
from sms_handover.bag.info import read_info
from sms_handover.bag.recording import Recording
from sms_handover.bag.repair.check import check
from sms_handover.bag.repair.findings import Severity
from sms_handover.bag.repair.recover import recover
from sms_handover.bag.time_order import messages_by_time
from sms_handover.errors import BagError

from .bag_messages import JOINT_STATE, TYPES, joint_state, text

STRING = "std_msgs/msg/String"


def write_by_mcap(path: Path, count: int, start: int = 0, *, index: bool = True) -> None:
    """Write a file with the plain MCAP library."""
    with path.open("wb") as stream:
        writer = Writer(
            stream,
            compression=CompressionType.LZ4,
            index_types=IndexType.ALL if index else IndexType.NONE,
            repeat_channels=index,
            repeat_schemas=index,
            use_statistics=index,
            use_chunking=index,
            use_summary_offsets=index,
        )
        writer.start(profile="ros2", library="other")
        schema = writer.register_schema(STRING, "ros2msg", b"string data\n")
        channel = writer.register_channel("/text", "cdr", schema)
        writer.add_metadata("notes", {"by": "other"})
        writer.add_attachment(0, 0, "a.txt", "text/plain", b"attached")
        for number in range(start, start + count):
            writer.add_message(channel, number, TYPES.serialize(text(str(number))), number)
        writer.finish()


@pytest.mark.parametrize("index", [True, False])
def test_a_file_of_the_mcap_library_with_and_without_index(tmp_path: Path, index: bool) -> None:
    file = tmp_path / "text.mcap"
    write_by_mcap(file, 5, start=3, index=index)
    info = read_info(file)
    assert (info.start_ns, info.end_ns, info.duration_ns, info.message_count) == (3, 7, 4, 5)
    assert (info.library, info.size) == ("other", file.stat().st_size)
    assert (info.topics["/text"].type, info.topics["/text"].schema_text) == (STRING, "string data\n")
    assert (info.records["notes"], info.attachments["a.txt"]) == ({"by": "other"}, b"attached")
    assert (info.ledger, info.provenance, info.parameters) == (None, {}, {})
    assert (info.schedule_text, info.urdf_text) == (None, None)
    assert [m.log_time_ns for m in read_messages(tmp_path)] == [3, 4, 5, 6, 7]


def test_a_split_bag_is_one_bag_in_the_order_of_its_numbers(tmp_path: Path) -> None:
    for number in range(12):
        write_by_mcap(tmp_path / f"run_{number}.mcap", 2, start=2 * number)
    info = read_info(tmp_path)
    assert (len(info.files), info.message_count, info.start_ns, info.end_ns) == (12, 24, 0, 23)
    assert [m.log_time_ns for m in read_messages(tmp_path)] == list(range(24))


@pytest.mark.parametrize("mode", list(CompressionMode))
def test_a_bag_of_rosbags_in_every_compression(tmp_path: Path, mode: CompressionMode) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    writer = RosbagsWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    messages = [TYPES.serialize(joint_state(number)) for number in range(20)]
    with writer:
        connection = writer.add_connection("/robot/joints", JOINT_STATE, typestore=store)
        for number, data in enumerate(messages):
            writer.write(connection, 10 + number, data)
    info = read_info(tmp_path / "bag")
    assert (info.message_count, info.start_ns, info.end_ns) == (20, 10, 29)
    assert info.topics["/robot/joints"].type == JOINT_STATE
    assert [message.data for message in read_messages(tmp_path / "bag")] == messages
    assert [message.data for message in messages_by_time(tmp_path / "bag")] == messages
    assert not [f for f in check(tmp_path / "bag").findings if f.severity is not Severity.NOTE]
    assert recover(tmp_path / "bag", tmp_path / "new").message_count == 20
    assert [m.data for m in read_messages(info.files[0])] == messages


def test_messages_of_chosen_topics_only(tmp_path: Path) -> None:
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        for name in ("/a", "/b"):
            recording.add_topic(name, STRING)
            recording.receive(name, TYPES.serialize(text(name)), 1)
    assert [m.topic for m in read_messages(tmp_path / "bag")] == ["/a", "/b"]
    assert [m.topic for m in read_messages(tmp_path / "bag", ["/b", "/c"])] == ["/b"]
    assert [m.type for m in read_messages(tmp_path / "bag", ["/b"])] == [STRING]


@pytest.mark.parametrize("content", [b"[1]", b'{"plant": 1}', b"nonsense"])
def test_parameters_that_are_none_are_refused(tmp_path: Path, content: bytes) -> None:
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        recording.writer.attach("parameters.json", "application/json", content)
    with pytest.raises(BagError, match=r"parameters\.json in the bag"):
        _ = read_info(tmp_path / "bag").parameters


def test_parameters_that_json_cannot_hold_are_refused(tmp_path: Path) -> None:
    with (
        Recording(tmp_path / "bag", types=TYPES) as recording,
        pytest.raises(BagError, match="cannot be stored"),
    ):
        recording.describe(parameters={"plant": {"what": object()}})
