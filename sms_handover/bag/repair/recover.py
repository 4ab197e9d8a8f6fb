"""Recover a whole bag from what can be read of a truncated or damaged one."""

import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path

from mcap.records import Attachment, Metadata, Statistics

from sms_handover.bag.files import Progress, damage_reported, files_of
from sms_handover.bag.ledger import LEDGER_RECORD, PERIODS_RECORD, Ledger, has_ledger, periods_of
from sms_handover.bag.mcap.damage import Damage, Hole
from sms_handover.bag.mcap.scan import FileScan, Located, ScannedMessage, Source
from sms_handover.bag.metadata import ROSBAG2_RECORD
from sms_handover.bag.repair.ledger_rebuild import LedgerRebuild
from sms_handover.bag.repair.recovery import RECOVERY_RECORD, Recovery, TopicRecovery
from sms_handover.bag.writer import BagWriter
from sms_handover.errors import BagError

_CHUNK_SIZE = 768 * 1024  # [byte] as in rosbag2
_NEVER_NS = 2**63  # [ns] longer than any recording
_REBUILT = (LEDGER_RECORD, ROSBAG2_RECORD)


def recover(source: Path, folder: Path, progress: Progress | None = None) -> Recovery:
    """Write what the bag at ``source`` (its folder or a file) holds into a new bag in ``folder``.

    No message is altered; every message of every intact chunk is kept, in the order of the file,
    with attachments and metadata records. One chunk is held at a time. Raises BagError if nothing
    can be read, or if ``folder`` exists or cannot be written; then ``folder`` is deleted.
    """
    bag = files_of(source)
    writer = BagWriter(folder, chunk_size=_CHUNK_SIZE, flush_period_ns=_NEVER_NS)
    try:
        salvage = _Salvage(writer)
        salvage.expect(bag.counts)
        for scan in bag.scans(progress):
            with damage_reported(scan.file):
                salvage.take(scan)
        if not salvage.any_record:
            what = "no record of an MCAP file is in it" if bag.size else "it is empty"
            raise BagError(f"nothing can be recovered from {source}: {what}")
        result = salvage.result(source, bag.missing)
        if result.ledger is not None:
            writer.record(LEDGER_RECORD, result.ledger.to_record())
        writer.record(RECOVERY_RECORD, result.to_record())
        writer.close()
    except BaseException:
        writer.abandon()
        raise
    return result


class _Salvage:
    """Writes what is found into the new bag and keeps account of it."""

    def __init__(self, writer: BagWriter) -> None:
        self._writer = writer
        self._keys: dict[Source, str] = {}
        self._same: dict[tuple[str, str, str, bytes], str] = {}
        self._kept: set[tuple[str, int]] = set()  # attachments and records, repeated in split bags
        self._rebuild: LedgerRebuild | None = None
        self._recorded: dict[str, int] = {}
        self._in_statistics: dict[str, int] = {}  # messages by topic, of all files
        self._span: tuple[int, int] | None = None  # [ns] of the recording, if known
        self._damages: list[Damage] = []
        self.any_record = False
        self._size = 0
        self._closed = True
        self._from_cut_chunk = self._private = 0
        self._hole = Hole()

    def take(self, scan: FileScan) -> None:
        for found in scan:
            if isinstance(found, ScannedMessage):
                source = found.source
                key = self._keys.get(source) or self._open(source)
                self._writer.write(key, found.data, *found[2:])
                self._hole.message(found.log_time_ns)
                if self._rebuild is not None:
                    self._rebuild.add(found)
            elif isinstance(found, Source):
                self._open(found)
            elif isinstance(found, Damage):
                self._damages.append(found)
                if not found.of_index:
                    self._hole.damage(found)
            else:
                self._take_record(found, scan)
            self.any_record = self.any_record or not isinstance(found, Damage)
        self._size += scan.size
        self._closed = self._closed and scan.closed
        self._from_cut_chunk += scan.from_cut_chunk
        self._private += scan.private

    def expect(self, counts: Mapping[str, int]) -> None:
        """Take numbers of recorded messages by topic; the largest of several counts."""
        for name, count in counts.items():
            self._recorded[name] = max(self._recorded.get(name, 0), count)

    def result(self, source: Path, missing: Sequence[str]) -> Recovery:
        """Return the result, for a bag that lacks the ``missing`` files."""
        recovered: dict[str, int] = {}
        for key, count in self._writer.message_counts.items():
            name = self._writer.topic_of(key)
            recovered[name] = recovered.get(name, 0) + count
        self.expect(self._in_statistics)
        names = dict.fromkeys((*recovered, *self._recorded))
        largest_ns, ends_known = self._hole.largest(self._span)
        return Recovery(
            source=source,
            folder=self._writer.folder,
            size=self._size,
            closed=self._closed,
            damages=tuple(self._damages),
            topics=tuple(
                TopicRecovery(name, recovered.get(name, 0), self._recorded.get(name)) for name in names
            ),
            from_cut_chunk=self._from_cut_chunk,
            missing=tuple(missing),
            private=self._private,
            start_ns=self._hole.first_ns,
            end_ns=self._hole.latest_ns,
            largest_loss_ns=largest_ns,
            ends_known=ends_known,
            ledger=None if self._rebuild is None else self._rebuild.ledger(),
        )

    def _open(self, source: Source) -> str:
        """Open a topic in the new bag, once for equal channels and all files."""
        schema = source.schema
        same = (source.topic, source.encoding, schema.name, schema.data)
        key = self._same.get(same)
        if key is None:
            key = self._same[same] = f"{source.topic} {len(self._same)}"
            self._writer.add_source(key, source)
            if self._rebuild is not None:
                self._rebuild.open(source)
        self._keys[source] = key
        return key

    def _take_record(self, found: Located, scan: FileScan) -> None:
        """Keep attachments and records, and take what describes the whole bag."""
        record = found.record
        if isinstance(record, Attachment):
            if self._is_new(record.name, record.data):
                times = record.log_time, record.create_time
                self._writer.attach(record.name, record.media_type, record.data, *times)
        elif isinstance(record, Metadata):
            if has_ledger([record.name]) and self._rebuild is None:
                self._rebuild = LedgerRebuild()
            if record.name == PERIODS_RECORD and self._rebuild is not None:
                self._rebuild.expect(periods_of(record.metadata))
            elif record.name == LEDGER_RECORD:
                ledger = Ledger.from_record(record.metadata)
                self.expect({topic.name: topic.received for topic in ledger.topics})
            if record.name not in _REBUILT and self._is_new(record.name, repr(record.metadata).encode()):
                self._writer.record(record.name, record.metadata)
        elif isinstance(record, Statistics):
            self._take_statistics(record, scan)

    def _take_statistics(self, statistics: Statistics, scan: FileScan) -> None:
        for channel, count in statistics.channel_message_counts.items():
            name = scan.topic_of(channel)
            self._in_statistics[name] = self._in_statistics.get(name, 0) + count
        if statistics.message_count:
            begin_ns, end_ns = self._span or (statistics.message_start_time, 0)
            begin_ns = min(begin_ns, statistics.message_start_time)
            self._span = begin_ns, max(end_ns, statistics.message_end_time)

    def _is_new(self, name: str, content: bytes) -> bool:
        same = (name, zlib.crc32(content))
        if same in self._kept:
            return False
        self._kept.add(same)
        return True
