"""Bags to be damaged, and what the MCAP library itself says was in them."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap.records import Channel, Chunk
from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer

from sms_handover.bag.mcap.scan import FileScan, ScannedMessage

from .bag_messages import TYPES, joint_state, text

STRING = "std_msgs/msg/String"


class Message(NamedTuple):
    """What must not change in a message."""

    topic: str
    data: bytes
    log_time_ns: int
    publish_time_ns: int
    sequence: int


class ChunkAt(NamedTuple):
    """A chunk: where it lies in the file, and its messages."""

    begin: int
    end: int
    messages: list[Message]


def write_file(
    path: Path,
    compression: CompressionType = CompressionType.ZSTD,
    *,
    chunked: bool = True,
    crcs: bool = True,
    count: int = 60,
    start_ns: int = 0,
) -> bytes:
    """Write a file with three topics, an attachment and a record by the MCAP library; return its bytes."""
    random = np.random.default_rng(0)
    topics = (("/text", STRING), ("/joints", "sensor_msgs/msg/JointState"), ("/none", STRING))
    with path.open("wb") as stream:
        writer = Writer(
            stream, chunk_size=2000, compression=compression, use_chunking=chunked, enable_crcs=crcs
        )
        writer.start(profile="ros2", library="other")
        writer.add_attachment(1, 2, "notes.txt", "text/plain", b"attached" * 20)
        writer.add_metadata("notes", {"by": "other"})
        channels = {
            name: writer.register_channel(
                name, "cdr", writer.register_schema(kind, "ros2msg", TYPES.schema(kind).text.encode())
            )
            for name, kind in topics
        }
        for number in range(count):
            time_ns = start_ns + number * 10
            data = TYPES.serialize(text(f"number {number}"))
            writer.add_message(channels["/text"], time_ns, data, 7 * number, sequence=number)
            data = TYPES.serialize(joint_state(number, position=random.standard_normal(14)))
            writer.add_message(
                channels["/joints"], start_ns + number * 10 + 5, data, 9 * number, sequence=number
            )
        writer.finish()
    return path.read_bytes()


def chunks_of(path: Path) -> list[ChunkAt]:
    """Return the chunks of a whole file as the MCAP library reads them."""
    content = path.read_bytes()
    topics: dict[int, str] = {}
    found = []
    with path.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, Chunk):
                begin = content.index(record.data) - 4 - len(record.compression) - 8 - 28 - 9
                inner = breakup_chunk(record)
                topics.update((item.id, item.topic) for item in inner if isinstance(item, Channel))
                messages = [
                    Message(topics[m.channel_id], m.data, m.log_time, m.publish_time, m.sequence)
                    for m in inner
                    if isinstance(m, McapMessage)
                ]
                end = content.index(record.data) + len(record.data)
                found.append(ChunkAt(begin, end, messages))
    return found


def scanned(path: Path) -> list[Message]:
    """Return the messages that a scan finds."""
    return [
        Message(found.source.topic, *found[1:])
        for found in FileScan(path)
        if isinstance(found, ScannedMessage)
    ]


def is_subsequence(part: list[Message], whole: list[Message]) -> bool:
    """Whether ``part`` is ``whole`` with some left out: nothing invented, altered or swapped."""
    rest: Iterator[Message] = iter(whole)
    return all(message in rest for message in part)
