"""Check of index and summary of an MCAP file against its content."""

from collections import Counter
from typing import Any

from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, ChunkIndex, Footer, MessageIndex, MetadataIndex, Statistics

from sms_handover.bag.mcap.records import ChunkHead, parse
from sms_handover.bag.mcap.scan import FileScan, Located, ScannedMessage
from sms_handover.bag.repair.findings import Findings
from sms_handover.bag.repair.message_counts import MessageCounts


class IndexCheck:
    """The content of one file, and what its index states."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._first_ns: int | None = None
        self._last_ns = 0
        self._places: dict[int, tuple[int, int, str]] = {}  # length, opcode and name by begin
        self._chunks: dict[int, tuple[int, ChunkHead]] = {}  # length and head by begin
        self._in_chunk: Counter[tuple[str, int]] = Counter()  # topic and log time, of the latest chunk
        self._in_index: Counter[tuple[str, int]] = Counter()
        self._wrong_indexes = 0
        self._summary: list[Any] = []
        self._data_end: int | None = None
        self._indexed = False

    def message(self, message: ScannedMessage) -> None:
        """Take a message."""
        topic, time_ns = message.source.topic, message.log_time_ns
        self._counts[topic] += 1
        self._in_chunk[topic, time_ns] += 1
        self._first_ns = time_ns if self._first_ns is None else min(self._first_ns, time_ns)
        self._last_ns = max(self._last_ns, time_ns)

    def record(self, found: Located, scan: FileScan) -> None:
        """Take a record that is no message."""
        if found.opcode == Opcode.MESSAGE_INDEX:
            index: MessageIndex = parse(found.opcode, found.record)
            topic = scan.topic_of(index.channel_id)
            self._in_index.update((topic, time_ns) for time_ns, _ in index.records)
            self._indexed = True
            return
        self._end_chunk()
        if found.opcode == Opcode.CHUNK:
            self._chunks[found.begin] = (found.end - found.begin, found.record)
        elif found.opcode in (Opcode.ATTACHMENT, Opcode.METADATA):
            self._places[found.begin] = (found.end - found.begin, found.opcode, found.record.name)
        elif found.opcode == Opcode.DATA_END:
            self._data_end = found.end
        elif found.record is not None:
            self._summary.append(found.record)

    def close(self, scan: FileScan, findings: Findings, stated: MessageCounts) -> None:
        """Report where they differ; a file without its end states nothing."""
        name = scan.file.name
        self._end_chunk()
        if not scan.closed:
            return
        if self._wrong_indexes:
            findings.damaged(f"{name}: the message index is wrong for {self._wrong_indexes} chunks")
        of_kind = Counter(type(record).__name__ for record in self._summary)
        for record in self._summary:
            if isinstance(record, Statistics):
                self._check_statistics(record, scan, findings, stated)
            elif isinstance(record, Footer):
                if record.summary_start not in (0, self._data_end):
                    findings.damaged(f"{name}: the footer does not point to the summary")
            elif isinstance(record, ChunkIndex) and not self._is_chunk(record):
                findings.damaged(
                    f"{name}: the index names a chunk at byte {record.chunk_start_offset}: wrong"
                )
            elif isinstance(record, AttachmentIndex | MetadataIndex) and not self._is_there(record):
                findings.damaged(f"{name}: the index names {record.name!r} at byte {record.offset}: wrong")
        indexed = of_kind[ChunkIndex.__name__]
        if self._chunks and not indexed:
            findings.note(f"{name} has no index: readers must scan all of it")
        elif indexed != len(self._chunks):
            findings.damaged(f"{name}: {len(self._chunks)} chunks, but {indexed} in the index")
        if not of_kind[Statistics.__name__]:
            findings.note(f"{name} has no statistics")

    def _check_statistics(
        self, statistics: Statistics, scan: FileScan, findings: Findings, stated: MessageCounts
    ) -> None:
        """Compare the message counts, and the first and last log time."""
        counts: Counter[str] = Counter()
        for channel, count in statistics.channel_message_counts.items():
            counts[scan.topic_of(channel)] += count
        stated.add("statistics", counts)
        span = (statistics.message_start_time, statistics.message_end_time)
        if self._first_ns is not None and counts == self._counts and span != (self._first_ns, self._last_ns):
            findings.damaged(f"{scan.file.name}: its statistics have another first or last log time")

    def _is_chunk(self, index: ChunkIndex) -> bool:
        length, head = self._chunks.get(index.chunk_start_offset, (0, None))
        return head is not None and (length, head.start_ns, head.end_ns, head.compression) == (
            index.chunk_length,
            index.message_start_time,
            index.message_end_time,
            index.compression,
        )

    def _is_there(self, index: AttachmentIndex | MetadataIndex) -> bool:
        opcode = Opcode.ATTACHMENT if isinstance(index, AttachmentIndex) else Opcode.METADATA
        return self._places.get(index.offset) == (index.length, opcode, index.name)

    def _end_chunk(self) -> None:
        """Compare the latest chunk with its message indexes, if it has any."""
        if self._indexed and self._in_chunk != self._in_index:
            self._wrong_indexes += 1
        self._in_chunk.clear()
        self._in_index.clear()
        self._indexed = False
