"""Any bag as tables: one per topic, a row per message."""

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from sms_handover.bag.files import scans_of, strict_scan
from sms_handover.bag.info import BagInfo
from sms_handover.bag.mcap.scan import ScannedMessage, Source
from sms_handover.bag.schemas import SchemaTypes, types_of
from sms_handover.errors import BagError
from sms_handover.export.flatten import Flattener
from sms_handover.export.output import Tables
from sms_handover.export.selection import Selection
from sms_handover.export.table import Column

Progress = Callable[[int, int], None]  # bytes gone through, bytes in all

_BATCH = 5000  # rows written at once
_MOST_PENDING = 32 * 2**20  # [byte] of messages held back at most, over all tables
_TIMES = (Column("log_time_ns", "int64", "ns"), Column("publish_time_ns", "int64", "ns"))


def export_topics(info: BagInfo, tables: Tables, selection: Selection, progress: Progress | None) -> None:
    """Write a table per topic; raises BagError at the first damage."""
    first_ns, last_ns = selection.span(info.start_ns)
    before = 0
    with ExitStack() as stack:
        topics = _TopicTables(tables, selection, stack)
        for scan in scans_of(info.path):
            for found in strict_scan(scan, info.path):
                if isinstance(found, Source):
                    topics.of(found)
                elif isinstance(found, ScannedMessage) and first_ns <= found.log_time_ns <= last_ns:
                    topics.add(found)
                if progress is not None:
                    progress(before + scan.place, info.size)
            before += scan.place


class _TopicTable:
    """The table of one topic, with the rows that wait to be written."""

    def __init__(self, tables: Tables, source: Source, types: SchemaTypes) -> None:
        """Open the table; raises BagError on a type that has no columns."""
        self._tables, self._types, self._topic = tables, types, source.topic
        self._flattener = Flattener(types)
        columns = [*_TIMES, *self._flattener.columns]
        self._stem, self._file = tables.open(source.topic, columns, source.topic)
        self._pending: list[list[Any]] = []

    def add(self, message: ScannedMessage) -> None:
        """Add one message; raises BagError if it does not decode."""
        try:
            values = self._flattener.row(self._types.decode(message.data))
        except BagError as error:
            raise BagError(f"{self._topic}: {error}; leave it out with --exclude-topics") from error
        self._pending.append([message.log_time_ns, message.publish_time_ns, *values])
        if len(self._pending) >= _BATCH:
            self.flush()

    def flush(self) -> None:
        """Write the rows that wait."""
        self._file.write(self._pending)
        self._tables.rows[self._stem] += len(self._pending)
        self._pending = []

    def close(self) -> None:
        """Complete the table."""
        try:
            self.flush()
        finally:
            self._file.close()


class _TopicTables:
    """The tables of all topics that are wanted."""

    def __init__(self, tables: Tables, selection: Selection, stack: ExitStack) -> None:
        """Begin without a table; ``stack`` closes them."""
        self._tables, self._selection, self._stack = tables, selection, stack
        self._by_source: dict[Source, _TopicTable | None] = {}
        self._by_content: dict[tuple[str, str, bytes], _TopicTable | None] = {}
        self._pending_bytes = 0

    def of(self, source: Source) -> _TopicTable | None:
        """Return the table of a topic, None if it is not wanted or cannot be decoded."""
        if source not in self._by_source:
            same = source.topic, source.schema.name, source.schema.data  # also in other files of a split bag
            if same not in self._by_content:
                self._by_content[same] = self._opened(source)
            self._by_source[source] = self._by_content[same]
        return self._by_source[source]

    def add(self, message: ScannedMessage) -> None:
        """Add a message to the table of its topic."""
        table = self.of(message.source)
        if table is None:
            return
        table.add(message)
        self._pending_bytes += len(message.data)
        if self._pending_bytes > _MOST_PENDING:
            self._pending_bytes = 0
            for each in self._by_content.values():
                if each is not None:
                    each.flush()

    def _opened(self, source: Source) -> _TopicTable | None:
        """Open the table of a topic, or note why there is none."""
        if not self._selection.topics.wants(source.topic):
            return None
        try:
            table = _TopicTable(self._tables, source, types_of(source))
        except BagError as error:
            self._tables.skipped[source.topic] = str(error)
            return None
        self._stack.callback(table.close)
        return table
