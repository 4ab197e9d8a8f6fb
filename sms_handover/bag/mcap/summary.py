"""Summary of an MCAP file: from its end if that agrees with the file, else by a scan."""

import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt
from mcap.opcode import Opcode
from mcap.records import Attachment, AttachmentIndex, ChunkIndex, Header, Metadata, Schema

from sms_handover.bag.mcap.damage import Damage
from sms_handover.bag.mcap.records import RECORD_HEAD, attachment_is_sound, chunk_head, parse, used_length
from sms_handover.bag.mcap.resync import MAGIC
from sms_handover.bag.mcap.scan import FileScan, Located, ScannedMessage, Source
from sms_handover.bag.mcap.summary_section import SummarySection, read_summary_section

NO_SCHEMA = Schema(id=0, data=b"", encoding="", name="")

_CHUNK_HEAD = 64  # [byte] enough for the fields of a chunk
_ENTRY = np.dtype([("log_time", "<u8"), ("offset", "<u8")])
_INDEX_ENTRIES_AT = 6  # [byte]
_FREE = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.DATA_END)  # not in any index
_PRIVATE = 0x80  # first opcode of private records


@dataclass
class FileSummary:
    """The content of a file but its messages: these are counted by channel.

    Times are log times in ns, None without messages. ``chunks`` are by their number of messages, None
    if the index cannot be used, for the reason in ``doubt``.
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
        except (_DoubtError, struct.error) as error:
            return _scan(file, str(error) or "it is cut short")


class _Agreement:
    """Compares the parts of a summary with each other and with the file, without reading a message."""

    def __init__(self, stream: BinaryIO, section: SummarySection) -> None:
        self._stream, self._section = stream, section
        self._header: Header | None = None
        self._counts: Counter[int] = Counter()
        self._start_ns: int | None = None
        self._end_ns: int | None = None
        self._attachments: list[Attachment] = []
        self._records: list[Metadata] = []

    def summary(self) -> FileSummary:
        """Return the summary; raises _DoubtError if something does not agree."""
        self._check_numbers()
        self._check_places()
        self._check_statistics()
        if self._header is None:
            raise _DoubtError("the file has no header")
        section = self._section
        sources = {
            number: Source(
                channel.topic,
                channel.message_encoding,
                section.schemas.get(channel.schema_id, NO_SCHEMA),
                channel.metadata,
            )
            for number, channel in section.channels.items()
        }
        return FileSummary(
            self._header,
            {source: self._counts[number] for number, source in sources.items()},
            self._start_ns,
            self._end_ns,
            self._attachments,
            self._records,
            tuple(section.chunks),
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

    def _check_places(self) -> None:
        """Walk over the file from record to record, jumping over chunks, attachments and metadata."""
        section = self._section
        chunks = {index.chunk_start_offset: index for index in section.chunks}
        files = {index.offset: index for index in section.files}
        place, found = len(MAGIC), 0
        while place < section.begin:
            opcode, length = RECORD_HEAD.unpack(self._bytes(place, RECORD_HEAD.size))
            end = place + RECORD_HEAD.size + length
            if opcode == Opcode.CHUNK:
                if place not in chunks:
                    raise _DoubtError(f"the chunk at byte {place} is not in its index")
                end = self._check_chunk(chunks[place], end)
                found += 1
            elif opcode in (Opcode.ATTACHMENT, Opcode.METADATA):
                if place not in files or files[place].length != end - place:
                    raise _DoubtError(f"the attachment or metadata at byte {place} is not in its index")
                self._take_file(opcode, self._bytes(place + RECORD_HEAD.size, length))
                found += 1
            elif opcode == Opcode.HEADER:
                self._header = parse(opcode, self._body(opcode, place, length))
            elif opcode not in _FREE and opcode < _PRIVATE:
                what = "a message" if opcode == Opcode.MESSAGE else "a record"
                raise _DoubtError(f"{what} at byte {place} is not in its index")
            place = end
        if place != section.begin or found != len(chunks) + len(files):
            raise _DoubtError("its index names places where nothing is")

    def _check_chunk(self, index: ChunkIndex, end: int) -> int:
        """Check a chunk and its message indexes; return where these end."""
        place = index.chunk_start_offset
        head = chunk_head(self._bytes(place + RECORD_HEAD.size, _CHUNK_HEAD))
        stated = index.message_start_time, index.message_end_time, index.uncompressed_size
        if (
            head is None
            or (head.start_ns, head.end_ns, head.uncompressed_size) != stated
            or (head.compression, end) != (index.compression, place + index.chunk_length)
        ):
            raise _DoubtError(f"the chunk at byte {place} is not as its index says")
        offsets, first_ns, last_ns = {}, None, 0
        for begin, body in self._indexes(end, index.message_index_length):
            channel, entries = _entries(body)
            if channel not in self._section.channels:
                raise _DoubtError(f"its summary lacks channel {channel}")
            self._counts[channel] += len(entries)
            offsets[channel] = begin
            if len(entries):
                times = entries["log_time"]
                first_ns = int(times.min()) if first_ns is None else min(first_ns, int(times.min()))
                last_ns = max(last_ns, int(times.max()))
        if offsets != index.message_index_offsets or (
            first_ns is not None and (first_ns, last_ns) != (index.message_start_time, index.message_end_time)
        ):
            raise _DoubtError(f"the chunk at byte {place} has other message indexes than its index says")
        if first_ns is not None:
            self._start_ns = first_ns if self._start_ns is None else min(self._start_ns, first_ns)
            self._end_ns = max(self._end_ns or 0, last_ns)
        return end + index.message_index_length

    def _indexes(self, begin: int, length: int) -> Iterator[tuple[int, bytes]]:
        """Yield place and body of the message indexes behind a chunk."""
        data, place = self._bytes(begin, length), 0
        while place < length:
            opcode, size = RECORD_HEAD.unpack_from(data, place)
            at, place = place, place + RECORD_HEAD.size + size
            body = data[at + RECORD_HEAD.size : place]
            if len(body) < size or (opcode != Opcode.MESSAGE_INDEX and opcode < _PRIVATE):
                raise _DoubtError(f"the message indexes at byte {begin} are something else")
            if opcode == Opcode.MESSAGE_INDEX:
                yield begin + at, body

    def _take_file(self, opcode: int, body: bytes) -> None:
        """Take an attachment or metadata record."""
        if used_length(opcode, body) is None or (
            opcode == Opcode.ATTACHMENT and not attachment_is_sound(body)
        ):
            raise _DoubtError("an attachment or metadata record is damaged")
        record = parse(opcode, body)
        (self._attachments if opcode == Opcode.ATTACHMENT else self._records).append(record)

    def _check_statistics(self) -> None:
        """Check counts and times of the statistics against those of the message indexes."""
        statistics = self._section.statistics
        if statistics is None:
            return
        stated = {number: count for number, count in statistics.channel_message_counts.items() if count}
        if stated != {number: count for number, count in self._counts.items() if count}:
            raise _DoubtError("its statistics count other messages than its message indexes")
        if statistics.message_count != sum(stated.values()):
            raise _DoubtError("its statistics contradict themselves")
        span = statistics.message_start_time, statistics.message_end_time
        if self._start_ns is not None and span != (self._start_ns, self._end_ns):
            raise _DoubtError("its statistics have another first or last log time")

    def _body(self, opcode: int, place: int, length: int) -> bytes:
        """Return the body of a record; raises _DoubtError if it is malformed."""
        body = self._bytes(place + RECORD_HEAD.size, length)
        if used_length(opcode, body) is None:
            raise _DoubtError(f"the record at byte {place} is malformed")
        return body

    def _bytes(self, place: int, length: int) -> bytes:
        self._stream.seek(place)
        return self._stream.read(min(length, self._section.begin - place))


def _entries(body: bytes) -> tuple[int, npt.NDArray[np.void]]:
    """Return the channel and the entries of a message index."""
    channel, length = struct.unpack_from("<HI", body)
    if length % _ENTRY.itemsize or _INDEX_ENTRIES_AT + length > len(body):
        raise _DoubtError("a message index is malformed")
    return channel, np.frombuffer(body, _ENTRY, length // _ENTRY.itemsize, _INDEX_ENTRIES_AT)


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
