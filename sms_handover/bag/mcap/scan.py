"""Scan of a file of a bag from its first byte to its last, past all damage.

A reader that needs a whole bag stops at the first damage, a recovery resumes behind it.
"""

import zlib
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, BinaryIO, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from sms_handover.bag.mcap.chunks import DamagedChunkError, inner_records, records_of, records_of_cut
from sms_handover.bag.mcap.compression import inflate_message
from sms_handover.bag.mcap.damage import Damage
from sms_handover.bag.mcap.records import (
    MESSAGE_HEAD,
    RECORD_HEAD,
    ChunkHead,
    attachment_is_sound,
    chunk_head,
    parse,
)
from sms_handover.bag.mcap.resync import MAGIC, Frame, FrameWalk, Gap
from sms_handover.bag.mcap.summary_section import SummarySection, read_summary_section


@dataclass(frozen=True, eq=False)
class Source:
    """A channel of a file, with the schema of its messages."""

    topic: str
    encoding: str
    schema: Schema
    metadata: Mapping[str, str]


class ScannedMessage(NamedTuple):
    """One message of a file."""

    source: Source
    data: bytes
    log_time_ns: int
    publish_time_ns: int
    sequence: int


class Located(NamedTuple):
    """A record at the top level that is no message.

    A chunk is given by its head, before its messages, a message index by its bytes, a private record
    by None.
    """

    begin: int
    end: int
    opcode: int
    record: Any


Found = Source | ScannedMessage | Located | Damage

_DEFINED = frozenset(Opcode)
NO_SCHEMA = Schema(id=0, data=b"", encoding="", name="")


class FileScan:
    """One file of a bag; iterate over it once.

    ``place`` is the number of bytes read. At the end ``closed`` is whether the file has its final
    magic, ``from_cut_chunk`` counts messages out of a chunk cut off by the end of the file, and
    ``private`` the records that only their writer understands.
    """

    def __init__(
        self,
        file: Path,
        sources: Mapping[int, Source] | None = None,
        report: Callable[[int], None] | None = None,
    ) -> None:
        """Know ``sources``, channels by number, from the summary; call ``report`` with each ``place``."""
        self.file = file
        self.size = file.stat().st_size
        self._report = report
        self.place = 0
        self.closed = False
        self.from_cut_chunk = 0
        self.private = 0
        self._schemas: dict[int, Schema] = {0: NO_SCHEMA}
        self._sources = dict(sources or {})
        self._in_summary = False
        self._data_end = 0  # [byte]
        self._lost: Damage | None = None  # a chunk that its message indexes may follow
        self._checksum = zlib.crc32(MAGIC)
        self._whole = True  # no gap so far
        self._undescribed: dict[int, int] = {}  # messages by number of channel
        self._summary = SummarySection()

    def __iter__(self) -> Iterator[Found]:
        """Yield channels, messages, other records and damage, in the order of the file."""
        size = self.size
        with self.file.open("rb") as stream:
            self._summary = read_summary_section(stream, size)
            for found in FrameWalk(stream, size):
                self.place = found.end
                if self._report is not None:
                    self._report(self.place)
                self._add_to_checksum(found)
                if self._lost is not None:
                    if self._counts_lost(found):
                        continue
                    yield self._lost
                    self._lost = None
                yield from self._gap(found) if isinstance(found, Gap) else self._frame(found)
            if self._lost is not None:
                yield self._lost
            stream.seek(max(0, size - len(MAGIC)))
            self.closed = size > len(MAGIC) and stream.read() == MAGIC
        if self.closed and not self._summary.sound:
            reason = "the checksum of the summary does not match"
            yield Damage(self.file, self._data_end, size, reason, of_index=True)
        for channel, count in self._undescribed.items():
            name = f"channel {channel}"
            reason = f"{count} messages belong to {name}, which is not defined"
            yield Damage(self.file, 0, 0, reason, messages=MappingProxyType({name: count}))

    def chunk_at(self, stream: BinaryIO, begin: int, size: int) -> Iterator[Found]:
        """Yield the messages of one chunk of the open file, or that it is damaged."""
        stream.seek(begin + RECORD_HEAD.size)
        body = stream.read(size - RECORD_HEAD.size)
        yield from self._chunk(Frame(begin, begin + size, Opcode.CHUNK, body, len(body)))
        if self._lost is not None:
            yield self._lost

    def topic_of(self, number: int) -> str:
        """Return the topic of a channel, by its number in the file."""
        source = self._sources.get(number) or self._source_in_summary(number)
        return f"channel {number}" if source is None else source.topic

    def _frame(self, frame: Frame) -> Iterator[Found]:
        if frame.opcode == Opcode.CHUNK:
            yield from self._chunk(frame)
        elif frame.opcode == Opcode.MESSAGE:
            message = self._message(frame.body, 0, len(frame.body))
            if message is not None:
                yield message
        elif frame.opcode == Opcode.ATTACHMENT and not attachment_is_sound(frame.body):
            yield self._damage(frame, "the checksum of the attachment does not match")
        else:
            self.private += frame.opcode not in _DEFINED
            record: Any = (
                frame.body if frame.opcode == Opcode.MESSAGE_INDEX else parse(frame.opcode, frame.body)
            )
            if (
                frame.opcode == Opcode.DATA_END
                and self._whole
                and record.data_section_crc not in (0, self._checksum)
            ):
                yield self._damage(frame, "the checksum of the data section does not match")
            if frame.opcode == Opcode.DATA_END:
                self._in_summary, self._data_end = True, frame.end
            yield Located(frame.begin, frame.end, frame.opcode, record)
            yield from self._defined(record)

    def _chunk(self, frame: Frame) -> Iterator[Found]:
        head = chunk_head(frame.body)
        if head is None:
            raise AssertionError("a frame is no chunk without its head")
        yield Located(frame.begin, frame.end, frame.opcode, head)
        try:
            records = records_of(head, frame.body)
        except DamagedChunkError as error:
            self._lost = self._damage(frame, str(error), head)
            return
        end = yield from self._inner(records)
        if end != len(records):
            yield self._damage(frame, f"there are no records from byte {end} of the chunk on", head)

    def _inner(self, records: bytes) -> Generator[Found, None, int]:
        """Yield messages and channels of a chunk; return where its last whole record ends."""
        end = 0
        for opcode, begin, end in inner_records(records):
            if opcode == Opcode.MESSAGE:
                message = self._message(records, begin, end)
                if message is not None:
                    yield message
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                yield from self._defined(parse(opcode, records[begin:end]))
        return end

    def _gap(self, gap: Gap) -> Iterator[Found]:
        """Yield the messages in the beginning of a cut chunk, then the damage."""
        head = chunk_head(gap.body) if gap.opcode == Opcode.CHUNK else None
        if head is not None:
            for found in self._inner(records_of_cut(head, gap.body)):
                self.from_cut_chunk += isinstance(found, ScannedMessage)
                yield found
        yield self._damage(gap, gap.reason, head)

    def _message(self, records: bytes, begin: int, end: int) -> ScannedMessage | None:
        """Return a message, None if its channel is not defined."""
        channel, sequence, log_time, publish_time = MESSAGE_HEAD.unpack_from(records, begin)
        source = self._sources.get(channel) or self._source_in_summary(channel)
        if source is None:
            self._undescribed[channel] = self._undescribed.get(channel, 0) + 1
            return None
        data = inflate_message(source.encoding, records[begin + MESSAGE_HEAD.size : end])
        return ScannedMessage(source, data, log_time, publish_time, sequence)

    def _defined(self, record: object) -> Iterator[Source | Damage]:
        """Take a schema or channel, and yield the latter; the first one of a number counts."""
        if isinstance(record, Schema):
            self._schemas.setdefault(record.id, record)
        elif isinstance(record, Channel):
            known, source = self._sources.get(record.id), self._source(record)
            if known is None and source is not None:
                self._sources[record.id] = source
                yield source
            elif known is not None and known.topic != record.topic:
                reason = f"channel {record.id} is {known.topic}, and again {record.topic}"
                yield Damage(self.file, self.place, self.place, reason, of_index=self._in_summary)

    def _source_in_summary(self, number: int) -> Source | None:
        """Return a channel that only the summary defines."""
        channel = self._summary.channels.get(number)
        source = None if channel is None else self._source(channel)
        if source is not None:
            self._sources[number] = source
        return source

    def _source(self, channel: Channel) -> Source | None:
        schema = self._schemas.get(channel.schema_id) or self._summary.schemas.get(channel.schema_id)
        if schema is None:
            return None
        return Source(
            channel.topic, channel.message_encoding, schema, MappingProxyType(dict(channel.metadata))
        )

    def _damage(self, frame: Frame | Gap, reason: str, head: ChunkHead | None = None) -> Damage:
        start_ns, end_ns = (None, None) if head is None else (head.start_ns, head.end_ns)
        return Damage(self.file, frame.begin, frame.end, reason, start_ns, end_ns, of_index=self._in_summary)

    def _add_to_checksum(self, found: Frame | Gap) -> None:
        """Continue the checksum of the data section, which a gap makes meaningless."""
        if isinstance(found, Gap):
            self._whole = False
        elif self._whole and found.opcode != Opcode.DATA_END:
            head = RECORD_HEAD.pack(found.opcode, len(found.body))
            self._checksum = zlib.crc32(found.body, zlib.crc32(head, self._checksum))

    def _counts_lost(self, found: Frame | Gap) -> bool:
        """Add the messages of a message index to those of the lost chunk; return whether it was one."""
        if isinstance(found, Gap) or found.opcode != Opcode.MESSAGE_INDEX or self._lost is None:
            return False
        index = parse(found.opcode, found.body)
        name = self.topic_of(index.channel_id)
        counts = {**self._lost.messages, name: self._lost.messages.get(name, 0) + len(index.records)}
        self._lost = replace(self._lost, messages=MappingProxyType(counts))
        return True
