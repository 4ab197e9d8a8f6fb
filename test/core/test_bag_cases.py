"""Bags of other recorders: faults and news in them cost no message, or every reader says what and why."""

import struct
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from shutil import copytree
from typing import Any

import lz4.frame
import pytest
import yaml
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, ChunkIndex, Footer, McapRecord, Message, Schema, Statistics
from mcap.writer import CompressionType, Writer

from sms_handover.bag.files import read_messages
from sms_handover.bag.info import read_info
from sms_handover.bag.mcap.damage import Damage
from sms_handover.bag.mcap.scan import FileScan, ScannedMessage, Source
from sms_handover.bag.mcap.summary_section import read_summary_section
from sms_handover.bag.repair.check import check
from sms_handover.bag.repair.findings import Severity
from sms_handover.bag.repair.recover import recover
from sms_handover.bag.schemas import types_of
from sms_handover.bag.time_order import TimeSpan, messages_by_time
from sms_handover.errors import BagError

from .bag_damage import STRING, write_file
from .bag_messages import TYPES, text

CASES = Path(__file__).resolve().parent.parent / "data" / "cases"


def times(path: Path, *of: TimeSpan) -> list[int]:
    return [message.log_time_ns for message in messages_by_time(path, None, *of)]


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("byte_255.mcap", 1),
        ("chunk_index_without_channels.mcap", 10),
        ("message_compression", 5),
        ("nan_in_arrays.mcap", 1),
        ("records_with_extra_bytes.mcap", 10),
        ("ros2idl.mcap", 3),
        ("schema_without_text.mcap", 3),
        ("service_events.mcap", 12),
        ("split_files_named_freely", 2486),
        ("statistics_begin_late.mcap", 12),
        ("topic_name_ros_forbids.mcap", 6),
        ("two_types_on_one_topic.mcap", 6),
        ("wstring.mcap", 1),
    ],
)
def test_every_message_of_a_case_is_read_and_recovered(tmp_path: Path, name: str, count: int) -> None:
    file = CASES / name
    info = read_info(file)
    assert info.message_count == count
    assert len(times(file)) == len(times(file, TimeSpan(info.start_ns, info.end_ns))) == count
    assert recover(file, tmp_path / "new").message_count == count
    read, again = (sorted(read_messages(path), key=str) for path in (file, tmp_path / "new"))
    assert read == again
    damaged = [f.text for f in check(file).findings if f.severity is Severity.DAMAGED]
    assert damaged == (
        [f"{name}: its statistics have another first or last log time"] if "late" in name else []
    )


def decoded(name: str) -> list[Any]:
    """Return the messages of a case, decoded by their schemas."""
    scan = FileScan(CASES / name)
    return [types_of(m.source).decode(m.data) for m in scan if isinstance(m, ScannedMessage)]


def test_services_idl_and_compressed_messages_are_decoded() -> None:
    assert [len(e.request) + len(e.response) for e in decoded("service_events.mcap")] == [1] * 12
    assert [m.data for m in decoded("message_compression/b_0.mcap")] == [f"hello {n}" for n in range(5)]
    assert [m.angle for m in decoded("ros2idl.mcap")] == [0.5] * 3
    assert [m.stamp.nanosec for m in decoded("ros2idl.mcap")] == [0, 1, 2]


def source(name: str, encoding: str, data: str) -> Source:
    return Source("/t", "cdr", Schema(id=1, name=name, encoding=encoding, data=data.encode()), {})


@pytest.mark.parametrize(
    ("name", "encoding", "schema", "data", "reason"),
    [
        ("t_msgs/msg/W", "ros2msg", "wstring a", b"\0\1\0\0", "wstring is not supported"),
        ("t_msgs/msg/W", "", "", b"\0\1\0\0", "no schema text"),
        ("t_msgs/msg/W", "protobuf", "x", b"\0\1\0\0", "protobuf"),
        ("t_msgs/msg/W", "ros2msg", "int32 a", b"\0\7\0\0" + bytes(4), "representation 0x0007"),
        ("t_msgs/msg/W", "ros2msg", "string a", b"\0\1\0\0\3\0\0\0\xff\xfe\0", "decode"),
        ("t_msgs/msg/W", "ros2msg", "int32 a", b"", "does not decode"),
        ("std_msgs/String", "ros2msg", "string data", b"\0\1\0\0\2\0\0\0a\0", ""),
    ],
)
def test_what_is_not_understood_has_a_reason(
    name: str, encoding: str, schema: str, data: bytes, reason: str
) -> None:
    """Two-part type names are understood."""
    if not reason:
        assert types_of(source(name, encoding, schema)).decode(data).data == "a"
        return
    with pytest.raises(BagError, match=reason):
        types_of(source(name, encoding, schema)).decode(data)


def test_not_understood_is_a_note_and_no_damage() -> None:
    result = check(CASES / "wstring.mcap")
    assert result.complete and not result.damaged
    note = (
        "/t cannot be decoded: the schema of t_msgs/msg/W is not understood: wstring is not supported;"
        " its messages are kept as bytes"
    )
    assert note in [finding.text for finding in result.findings]


def test_two_types_of_one_topic_are_told_apart() -> None:
    info = read_info(CASES / "two_types_on_one_topic.mcap")
    assert [(c.name, c.type, c.message_count) for c in info.channels] == [
        ("/status", STRING, 3),
        ("/status", "std_msgs/msg/Int32", 3),
    ]
    assert info.topics["/status"].type == STRING


def test_a_file_that_is_missing_is_named_by_every_reader(tmp_path: Path) -> None:
    bag = CASES / "split_file_missing"
    named = r"wbag_2\.mcap"
    for read in (lambda: list(read_messages(bag)), lambda: times(bag)):
        with pytest.raises(BagError, match=f"{named}.*recover"):
            read()
    assert read_info(bag).missing == (
        "wbag_2.mcap is not there, metadata.yaml lists it",
        "1240 of 6074 messages are missing, as metadata.yaml counts them",
    )
    result = check(bag)
    assert not result.complete and not result.damaged
    recovery = recover(bag, tmp_path / "new")
    assert (recovery.message_count, recovery.missing) == (4834, ("wbag_2.mcap",))
    assert not replace(recovery, topics=()).clean  # even if nothing counts the messages


def test_the_order_of_the_files_is_that_of_the_metadata() -> None:
    bag = CASES / "split_files_named_freely"
    assert [file.name for file in read_info(bag).files] == ["b.mcap", "a.mcap"]
    first = next(read_messages(bag)).log_time_ns
    assert first == next(read_messages(bag / "b.mcap")).log_time_ns


def test_files_that_the_metadata_does_not_list_are_named(tmp_path: Path) -> None:
    """One whose name continues the bag's is read all the same: the recorder was killed after a split."""
    bag = tmp_path / "bag"
    copytree(CASES / "split_file_missing", bag)
    metadata = bag / "metadata.yaml"
    body = yaml.safe_load(metadata.read_text())
    body["rosbag2_bagfile_information"]["relative_file_paths"] = ["bag/wbag_0.mcap", "wbag_1.mcap"]
    metadata.write_text(yaml.safe_dump(body))
    write_file(bag / "other.mcap")
    info = read_info(bag)
    assert [file.name for file in info.files] == [f"wbag_{number}.mcap" for number in (0, 1, 3, 4)]
    assert any("other.mcap" in note for note in info.notes)
    metadata.write_text(metadata.read_text().replace("compression_format: ''", "compression_format: lz4"))
    metadata.write_text(metadata.read_text().replace("compression_mode: ''", "compression_mode: FILE"))
    with pytest.raises(BagError, match="only zstd is read"):
        read_info(bag)


Records = list[McapRecord]


def without(kind: type[McapRecord]) -> Callable[[Records], Records]:
    return lambda records: [record for record in records if not isinstance(record, kind)]


def changed(kind: type[McapRecord], **values: object) -> Callable[[Records], Records]:
    """Return what changes values in all records of a kind."""
    return lambda records: [replace(r, **values) if isinstance(r, kind) else r for r in records]


def one_chunk_less(records: Records) -> Records:
    """Leave a chunk out of the index, with statistics that agree."""
    first = next(record for record in records if isinstance(record, ChunkIndex))
    count = sum(isinstance(record, ChunkIndex) for record in records) - 1
    rest = [record for record in records if record is not first]
    return changed(Statistics, chunk_count=count)(rest)


def renamed(records: Records) -> Records:
    """Call the topic of the first channel otherwise."""
    return [replace(r, topic="/other") if isinstance(r, Channel) and r.id == 1 else r for r in records]


def without_schemas(records: Records) -> Records:
    """Leave the schemas out, with statistics that agree."""
    return changed(Statistics, schema_count=0)(without(Schema)(records))


def with_summary(content: bytes, change: Callable[[Records], Records], insert: bytes = b"") -> bytes:
    """Return a file with another summary, and ``insert`` before the end of the data."""
    end = len(content) - 8 - 29
    begin, _, _ = struct.unpack_from("<QQI", content, end + 9)
    section = read_summary_section(BytesIO(content), len(content))
    assert section.statistics is not None
    records = [*section.schemas.values(), *section.channels.values(), section.statistics]
    builder = RecordBuilder()
    for record in change([*records, *section.chunks, *section.files]):
        record.write(builder)
    summary = builder.end()
    data_end = begin - 13
    Footer(summary_start=begin + len(insert), summary_offset_start=0, summary_crc=0).write(builder)
    data = content[:data_end] + insert + content[data_end : begin - 4] + bytes(4)
    return bytes(data + summary + builder.end() + content[-8:])


def outside() -> bytes:
    """Return a message outside of chunks."""
    builder = RecordBuilder()
    data = TYPES.serialize(text("outside"))
    Message(channel_id=1, log_time=7, data=data, publish_time=7, sequence=0).write(builder)
    return bytes(builder.end())


@pytest.mark.parametrize(
    ("change", "insert", "doubt"),
    [
        (lambda records: records, b"", ""),
        (without(Channel), b"", "channels"),
        (without(Schema), b"", "schemas"),
        (without_schemas, b"", "lacks the schema of /text"),
        (without(Statistics), b"", "no statistics"),
        (without(ChunkIndex), b"", "chunks"),
        (one_chunk_less, b"", "a chunk at byte"),
        (changed(Statistics, message_start_time=30), b"", "log time"),
        (changed(Statistics, channel_message_counts={1: 60, 2: 59}), b"", "count other messages"),
        (changed(Statistics, channel_message_counts={2: 120}), b"", "count other messages"),
        (changed(Statistics, message_count=1), b"", "contradict"),
        (changed(ChunkIndex, message_start_time=30), b"", "is not as its index says"),
        (changed(ChunkIndex, message_index_offsets={}), b"", "other message indexes"),
        (lambda records: records, outside(), "a message at byte"),
    ],
)
def test_a_summary_is_used_only_if_it_agrees_with_the_file(
    tmp_path: Path, change: Callable[[Records], Records], insert: bytes, doubt: str
) -> None:
    file = tmp_path / "a.mcap"
    content = write_file(file)
    file.write_bytes(with_summary(content, change, insert))
    info = read_info(file)
    assert (info.message_count, info.start_ns, info.end_ns) == (120 + bool(insert), 0, 595)
    found = times(file)
    assert len(found) == info.message_count and found == sorted(found)
    assert len(times(file, TimeSpan(0, 20))) == 5 + bool(insert)
    assert doubt in " ".join(info.notes) and bool(doubt) == bool(info.notes)


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_chunks_of_several_frames_are_read(tmp_path: Path, compression: CompressionType) -> None:
    """A chunk of which each half is a frame, with a skippable frame before each."""
    zstd = compression is CompressionType.ZSTD
    pack = zstandard.compress if zstd else lz4.frame.compress
    skippable = struct.pack("<II", 0x184D2A50, 4) + b"skip"
    file = tmp_path / "a.mcap"

    def frames(data: bytes) -> bytes:
        half = len(data) // 2
        return skippable + pack(data[:half]) + skippable + pack(data[half:])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(zstandard if zstd else lz4.frame, "compress", frames)
        write_file(file, compression)
    assert len(times(file)) == 120 and check(file).complete
    assert recover(file, tmp_path / "new").clean


def test_log_times_up_to_the_largest_keep_their_order(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    large = [2**64 - 1, 0, 2**63, 2**53 + 1]
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        channel = writer.register_channel(
            "/t", "cdr", writer.register_schema(STRING, "ros2msg", b"string data")
        )
        for time_ns in large:
            writer.add_message(channel, time_ns, TYPES.serialize(text("t")), time_ns)
        writer.finish()
    assert recover(file, tmp_path / "new").message_count == 4
    for path in (file, tmp_path / "new"):
        assert (read_info(path).start_ns, read_info(path).end_ns) == (0, 2**64 - 1)
        assert times(path) == sorted(large) and not check(path).damaged
        assert times(path, TimeSpan(2**53 + 1, 2**63)) == [2**53 + 1, 2**63]


def test_a_channel_that_the_summary_calls_otherwise_is_damage(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    file.write_bytes(with_summary(write_file(file), renamed))
    with pytest.raises(BagError, match="channel 1 is /other, and again /text"):
        times(file)
    assert check(file).damaged
    assert {m.topic for m in read_messages(recover(file, tmp_path / "new").folder)} == {"/text", "/joints"}


def test_private_records_are_skipped_and_counted(tmp_path: Path) -> None:
    """But a chunk of which the highest bit of the opcode was flipped is damage."""
    file = tmp_path / "a.mcap"
    content = write_file(file)
    file.write_bytes(with_summary(content, lambda records: records, struct.pack("<BQ", 0x90, 5) + b"mine!"))
    assert len(times(file)) == 120 and check(file).complete
    recovery = recover(file, tmp_path / "new")
    assert recovery.clean and recovery.private == 1
    chunk = content.index(b"\x06", content.index(b"attached" * 20) + 160)
    file.write_bytes(content[:chunk] + b"\x86" + content[chunk + 1 :])
    assert chunk in [item.begin for item in FileScan(file) if isinstance(item, Damage)]
