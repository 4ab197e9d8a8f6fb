"""Summary of an MCAP file: from its end if that agrees with the file, else by a scan."""

import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Attachment, AttachmentIndex, ChunkIndex, Header, Metadata

from sms_handover.bag.mcap.damage import Damage
from sms_handover.bag.mcap.records import (
    PRIVATE,
    RECORD_HEAD,
    attachment_is_sound,
    chunk_head,
    parse,
    used_length,
)
from sms_handover.bag.mcap.resync import MAGIC
from sms_handover.bag.mcap.scan import NO_SCHEMA, FileScan, Located, ScannedMessage, Source
from sms_handover.bag.mcap.summary_section import SummarySection, read_summary_section

_CHUNK_HEAD = 64  # [byte] enough for the fields of a chunk
_INDEX_HEAD = struct.Struct("<HI")  # channel, length of the entries [byte]
_ENTRY = np.dtype([("log_time", "<u8"), ("offset", "<u8")])
_FREE = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.DATA_END)  # not in any index


@dataclass
class FileSummary:
    """The content of a file but its messages, which are counted by channel.

    Times are log times in ns, None without messages. ``chunks`` are those of the index, None if that
    is not used for the reason in ``doubt``; then ``damages`` are those in the file.
    """

    header: Header
    counts: dict[Source, int] = field(default_factory=dict)
    start_ns: int | None = None
    end_ns: int | None = None
    attachments: list[Attachment] = field(default_factory=list)
    records: list[Metadata] = field(default_factory=list)
    chunks: tuple[ChunkIndex, ...] | None = None
    sources: Mapping[int, Source] = field(default_factory=dict)
    doubt: str = ""
    damages: list[Damage] = field(default_factory=list)


class _DoubtError(Exception):
    """The summary does not agree with the file; the text says where."""


def summarize(file: Path) -> FileSummary:
    """Return the summary of a file; one that is wrong or missing is replaced by a scan."""
    size = file.stat().st_size
    with file.open("rb") as stream:
        section = read_summary_section(stream, size)
        try:
            return _Agreement(stream, section).summary()
        except (_DoubtError, struct.error, ValueError) as error:
            return _scan(file, str(error) or "it is cut short")


class _Agreement:
    """Compares the parts of a summary with each other and with the file, without reading a message."""

    def __init__(self, stream: BinaryIO, section: SummarySection) -> None:
        self._stream, self._section = stream, section
        self._counts: Counter[int] = Counter()  # messages by channel
        self._spans: list[tuple[int, int]] = []  # first and last log time by chunk
        self._files: list[Any] = []

    def summary(self) -> FileSummary:
        """Return the summary; raises _DoubtError if something does not agree."""
        self._check_numbers()
        header = self._walk()
        start_ns, end_ns = self._check_statistics()
        schemas = {0: NO_SCHEMA, **self._section.schemas}
        sources = {
            number: Source(item.topic, item.message_encoding, schemas[item.schema_id], item.metadata)
            for number, item in self._section.channels.items()
        }
        return FileSummary(
            header,
            {source: self._counts[number] for number, source in sources.items()},
            start_ns,
            end_ns,
            [item for item in self._files if isinstance(item, Attachment)],
            [item for item in self._files if isinstance(item, Metadata)],
            tuple(self._section.chunks),
            sources,
        )

    def _check_numbers(self) -> None:
        """Check that the numbers of records in the summary are those in its statistics."""
        section, statistics = self._section, self._section.statistics
        if not section.sound:
            raise _DoubtError("the checksum of its summary does not match")
        if section.begin == 0 or statistics is None:
            raise _DoubtError("its summary has no statistics" if section.begin else "it has no summary")
        attachments = sum(isinstance(index, AttachmentIndex) for index in section.files)
        for what, stated, there in (
            ("channels", statistics.channel_count, len(section.channels)),
            ("schemas", statistics.schema_count, len(section.schemas)),
            ("chunks", statistics.chunk_count, len(section.chunks)),
            ("attachments", statistics.attachment_count, attachments),
            ("metadata records", statistics.metadata_count, len(section.files) - attachments),
        ):
            if stated != there:
                raise _DoubtError(f"its statistics count {stated} {what}, its summary has {there}")
        for channel in section.channels.values():
            if channel.schema_id and channel.schema_id not in section.schemas:
                raise _DoubtError(f"its summary lacks the schema of {channel.topic}")

    def _walk(self) -> Header:
        """Go from record to record, which must be in the index, past chunks; return the header."""
        section = self._section
        header: Header | None = None
        chunks = {index.chunk_start_offset: index for index in section.chunks}
        files = {index.offset: index.length for index in section.files}
        place, found = len(MAGIC), 0
        while place < section.begin:
            opcode, length = RECORD_HEAD.unpack(self._bytes(place, RECORD_HEAD.size))
            end = place + RECORD_HEAD.size + length
            if opcode == Opcode.CHUNK and place in chunks:
                found += 1
                end = self._check_chunk(chunks[place], end)
            elif opcode == Opcode.HEADER or files.get(place) == end - place:
                found += opcode != Opcode.HEADER
                record = self._record(opcode, self._bytes(place + RECORD_HEAD.size, length))
                header = record if opcode == Opcode.HEADER else header
                self._files.append(record)
            elif opcode not in _FREE and opcode < PRIVATE:
                raise _DoubtError(f"a {Opcode(opcode).name.lower()} at byte {place} is not in its index")
            place = end
        if place != section.begin or found != len(chunks) + len(files) or header is None:
            raise _DoubtError("its index names places where nothing is")
        return header

    def _check_chunk(self, index: ChunkIndex, end: int) -> int:
        """Check a chunk, which ends at ``end``, and its message indexes; return where these end."""
        place = index.chunk_start_offset
        head = chunk_head(self._bytes(place + RECORD_HEAD.size, _CHUNK_HEAD))
        span = index.message_start_time, index.message_end_time
        if (
            head is None
            or (head.start_ns, head.end_ns, head.compression) != (*span, index.compression)
            or end != place + index.chunk_length
        ):
            raise _DoubtError(f"the chunk at byte {place} is not as its index says")
        offsets, entries = {}, []
        for begin, body in self._message_indexes(end, index.message_index_length):
            channel, length = _INDEX_HEAD.unpack_from(body)
            offsets[channel] = begin
            entries.append(body[_INDEX_HEAD.size : _INDEX_HEAD.size + length])
            if (
                channel not in self._section.channels
                or len(entries[-1]) != length
                or length % _ENTRY.itemsize
            ):
                raise _DoubtError(f"the message index of channel {channel} at byte {begin} is malformed")
            self._counts[channel] += length // _ENTRY.itemsize
        times = np.frombuffer(b"".join(entries), _ENTRY)["log_time"]
        if len(times):
            self._spans.append((int(times.min()), int(times.max())))
        if offsets != index.message_index_offsets or (len(times) and self._spans[-1] != span):
            raise _DoubtError(f"the chunk at byte {place} has other message indexes than its index says")
        return end + index.message_index_length

    def _message_indexes(self, begin: int, length: int) -> Iterator[tuple[int, bytes]]:
        """Yield place and body of the message indexes behind a chunk."""
        data, place = self._bytes(begin, length), 0
        while place < length:
            opcode, size = RECORD_HEAD.unpack_from(data, place)
            at, place = place, place + RECORD_HEAD.size + size
            if opcode == Opcode.MESSAGE_INDEX:
                yield begin + at, data[at + RECORD_HEAD.size : place]
            elif opcode < PRIVATE:
                raise _DoubtError(f"the record at byte {begin + at} is no message index")

    def _check_statistics(self) -> tuple[int | None, int | None]:
        """Check the statistics against the message indexes; return the first and last log time."""
        statistics = self._section.statistics
        if statistics is None or +Counter(statistics.channel_message_counts) != +self._counts:
            raise _DoubtError("its statistics count other messages than its message indexes")
        if statistics.message_count != self._counts.total():
            raise _DoubtError("its statistics contradict themselves")
        if not self._spans:
            return None, None
        span = min(first for first, _ in self._spans), max(last for _, last in self._spans)
        if span != (statistics.message_start_time, statistics.message_end_time):
            raise _DoubtError("its statistics have another first or last log time")
        return span

    def _record(self, opcode: int, body: bytes) -> Any:
        """Return a record; raises _DoubtError if it is damaged."""
        sound = used_length(opcode, body) is not None
        if not sound or (opcode == Opcode.ATTACHMENT and not attachment_is_sound(body)):
            raise _DoubtError(f"a {Opcode(opcode).name.lower()} is damaged")
        return parse(opcode, body)

    def _bytes(self, place: int, length: int) -> bytes:
        self._stream.seek(place)
        return self._stream.read(max(0, min(length, self._section.begin - place)))


def _scan(file: Path, doubt: str) -> FileSummary:
    """Return the summary of all records of a file."""
    summary = FileSummary(Header("", ""), doubt=doubt)
    for found in FileScan(file):
        if isinstance(found, Source):
            summary.counts.setdefault(found, 0)
        elif isinstance(found, ScannedMessage):
            time_ns = found.log_time_ns
            summary.counts[found.source] = summary.counts.get(found.source, 0) + 1
            summary.start_ns = time_ns if summary.start_ns is None else min(summary.start_ns, time_ns)
            summary.end_ns = max(summary.end_ns or 0, time_ns)
        elif isinstance(found, Damage):
            summary.damages.append(found)
        elif isinstance(found, Located):
            if isinstance(found.record, Header):
                summary.header = found.record
            elif isinstance(found.record, Attachment):
                summary.attachments.append(found.record)
            elif isinstance(found.record, Metadata):
                summary.records.append(found.record)
    return summary
