"""Go through the messages of a bag in the order of their log time, from any time on.

A recorder takes messages topic by topic, so the order in the file is not that of time. Only the chunks
that overlap in time are held in memory.
"""

import heapq
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from itertools import count
from math import inf
from pathlib import Path
from typing import IO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.reader import SeekingReader
from mcap.records import Chunk, ChunkIndex, Message
from mcap.stream_reader import breakup_chunk
from mcap.summary import Summary

from sms_handover.bag.files import RawMessage, bag_files, damage_reported, read_messages

_RECORD_HEAD = 9  # [byte] opcode and length of a record
_WINDOW = 10_000  # [messages] held back to put them in order where a file has no index


@dataclass(frozen=True)
class TimeSpan:
    """Log times from ``start_ns`` to ``end_ns``, both included."""

    start_ns: float = 0
    end_ns: float = inf


class _Placed(NamedTuple):
    """A message with its place in the file, which decides between equal times."""

    log_time_ns: int
    chunk: int
    place: int
    message: RawMessage


def messages_by_time(
    path: Path, topics: Collection[str] | None = None, span: TimeSpan | None = None
) -> Iterator[RawMessage]:
    """Yield the messages of a bag, of ``topics`` or of all, by log time; equal times in recorded order.

    A file without a chunk index (rosbag2's ``fastwrite``) is read from its begin, and messages that are
    more than 10000 places late in it stay late. Raises BagError on a damaged file.
    """
    span = span or TimeSpan()
    files = [_file_by_time(file, topics, span) for file in bag_files(path)]
    return heapq.merge(*files, key=lambda message: message.log_time_ns)


def _file_by_time(file: Path, topics: Collection[str] | None, span: TimeSpan) -> Iterator[RawMessage]:
    """Yield the messages of one file."""
    with damage_reported(file), file.open("rb") as stream:
        summary = SeekingReader(stream, record_size_limit=file.stat().st_size).get_summary()
        if summary is not None and summary.chunk_indexes:
            yield from _indexed(stream, summary, topics, span)
            return
    in_span = (m for m in read_messages(file, topics) if span.start_ns <= m.log_time_ns <= span.end_ns)
    yield from _through_window(in_span)


def _indexed(
    stream: IO[bytes], summary: Summary, topics: Collection[str] | None, span: TimeSpan
) -> Iterator[RawMessage]:
    """Yield the messages of a file with a chunk index; a chunk is read when its first time has come."""
    wanted = {
        channel.id: (channel.topic, schema.name if schema else "")
        for channel in summary.channels.values()
        if topics is None or channel.topic in topics
        for schema in [summary.schemas.get(channel.schema_id)]
    }
    chunks = sorted(
        (chunk for chunk in summary.chunk_indexes if _may_hold(chunk, wanted, span)),
        key=lambda chunk: chunk.message_start_time,
    )
    nexts: list[float] = [*(chunk.message_start_time for chunk in chunks[1:]), inf]
    waiting: list[_Placed] = []
    for chunk, next_ns in zip(chunks, nexts, strict=False):
        waiting += _chunk_messages(stream, chunk, wanted, span)
        waiting.sort()
        ready = next((n for n, item in enumerate(waiting) if item.log_time_ns >= next_ns), len(waiting))
        for item in waiting[:ready]:
            yield item.message
        del waiting[:ready]


def _may_hold(chunk: ChunkIndex, wanted: Collection[int], span: TimeSpan) -> bool:
    """Whether a chunk can hold a message of the wanted channels and times."""
    indexed = chunk.message_index_offsets
    return (
        chunk.message_end_time >= span.start_ns
        and chunk.message_start_time <= span.end_ns
        and (not indexed or not indexed.keys().isdisjoint(wanted))
    )


def _chunk_messages(
    stream: IO[bytes], chunk: ChunkIndex, wanted: dict[int, tuple[str, str]], span: TimeSpan
) -> Iterator[_Placed]:
    """Yield the messages of one chunk in recorded order, its checksum checked."""
    offset = chunk.chunk_start_offset
    stream.seek(offset + _RECORD_HEAD)
    records = breakup_chunk(Chunk.read(ReadDataStream(stream)), validate_crc=True)
    for index, record in enumerate(records):
        if isinstance(record, Message) and record.channel_id in wanted:
            time_ns = record.log_time
            if span.start_ns <= time_ns <= span.end_ns:
                message = RawMessage(*wanted[record.channel_id], record.data, time_ns, record.publish_time)
                yield _Placed(time_ns, offset, index, message)


def _through_window(messages: Iterable[RawMessage]) -> Iterator[RawMessage]:
    """Yield messages by time as far as a window of bounded size can put them in order."""
    places = count()
    heap: list[_Placed] = []
    for message in messages:
        item = _Placed(message.log_time_ns, 0, next(places), message)
        if len(heap) < _WINDOW:
            heapq.heappush(heap, item)
        else:
            yield heapq.heappushpop(heap, item).message
    while heap:
        yield heapq.heappop(heap).message
