"""Time order: the messages of a bag by log time, from any time on.

A recorder takes messages topic by topic, so the order in the file is not that of time. Only the chunks
that overlap in time are held in memory.
"""

import heapq
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from itertools import count
from math import inf
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.records import ChunkIndex

from sms_handover.bag.files import (
    BagFiles,
    RawMessage,
    check_ends,
    damage_error,
    damage_reported,
    whole_files,
)
from sms_handover.bag.mcap.damage import Damage
from sms_handover.bag.mcap.scan import FileScan, ScannedMessage, Source
from sms_handover.bag.mcap.summary import FileSummary, summarize

_WINDOW = 10_000  # [messages] held back to put them in order where a file has no usable index


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

    A file without a usable chunk index (rosbag2's ``fastwrite``) is read from its begin, and messages that
    are more than 10000 places late in it stay late. Raises BagError on a damaged file.
    """
    return _merged(whole_files(path), topics, span or TimeSpan())


def _merged(bag: BagFiles, topics: Collection[str] | None, span: TimeSpan) -> Iterator[RawMessage]:
    with bag.opened() as files:
        for file in files:
            check_ends(file, bag.path)
        by_time = (_file_by_time(bag.path, file, topics, span) for file in files)
        yield from heapq.merge(*by_time, key=lambda message: message.log_time_ns)


def _file_by_time(
    bag: Path, file: Path, topics: Collection[str] | None, span: TimeSpan
) -> Iterator[RawMessage]:
    """Yield the messages of one file."""
    with damage_reported(file):
        summary = summarize(file)
        if summary.damages:
            raise damage_error(summary.damages[0], bag)
        wanted = {source for source in summary.sources.values() if topics is None or source.topic in topics}
        if summary.chunks:
            with file.open("rb") as stream:
                chunks = [chunk for chunk in summary.chunks if _may_hold(chunk, summary, wanted, span)]
                scan = FileScan(file, summary.sources)
                yield from _indexed(scan, bag, stream, chunks, wanted, span)
            return
        found = (item for item in FileScan(file) if isinstance(item, ScannedMessage))
        yield from _through_window(
            _raw(item)
            for item in found
            if (topics is None or item.source.topic in topics)
            and span.start_ns <= item.log_time_ns <= span.end_ns
        )


def _indexed(
    scan: FileScan,
    bag: Path,
    stream: BinaryIO,
    chunks: list[ChunkIndex],
    wanted: Collection[Source],
    span: TimeSpan,
) -> Iterator[RawMessage]:
    """Yield the messages of chunks; a chunk is read when its first time has come."""
    chunks.sort(key=lambda chunk: chunk.message_start_time)
    nexts: list[float] = [*(chunk.message_start_time for chunk in chunks[1:]), inf]
    waiting: list[_Placed] = []
    for chunk, next_ns in zip(chunks, nexts, strict=False):
        begin = chunk.chunk_start_offset
        for place, found in enumerate(scan.chunk_at(stream, begin, chunk.chunk_length)):
            if isinstance(found, Damage):
                raise damage_error(found, bag)
            if (
                isinstance(found, ScannedMessage)
                and found.source in wanted
                and span.start_ns <= found.log_time_ns <= span.end_ns
            ):
                waiting.append(_Placed(found.log_time_ns, begin, place, _raw(found)))
        waiting.sort()
        ready = next((n for n, item in enumerate(waiting) if item.log_time_ns >= next_ns), len(waiting))
        for item in waiting[:ready]:
            yield item.message
        del waiting[:ready]


def _may_hold(chunk: ChunkIndex, summary: FileSummary, wanted: Collection[Source], span: TimeSpan) -> bool:
    """Whether a chunk can hold a message of the wanted channels and times."""
    return (
        chunk.message_end_time >= span.start_ns
        and chunk.message_start_time <= span.end_ns
        and any(summary.sources[number] in wanted for number in chunk.message_index_offsets)
    )


def _raw(found: ScannedMessage) -> RawMessage:
    return RawMessage(found.source.topic, found.source.schema.name, *found[1:4])


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
