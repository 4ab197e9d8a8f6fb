"""Tables by topic: any bag as one table per topic, with a row per message."""

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from sms_handover.bag.files import scans_of, strict_scan
from sms_handover.bag.info import BagInfo
from sms_handover.bag.mcap.scan import ScannedMessage, Source
from sms_handover.bag.schemas import types_of
from sms_handover.errors import BagError
from sms_handover.export.flatten import Flattener
from sms_handover.export.output import Tables
from sms_handover.export.selection import Selection
from sms_handover.export.table import Column

Progress = Callable[[int, int], None]  # bytes done, bytes in all

_BATCH = 5000  # rows written at once
_MOST_PENDING = 32 * 2**20  # [byte] of messages held in memory at most, over all tables
_TIMES = (Column("log_time_ns", "uint64", "ns"), Column("publish_time_ns", "uint64", "ns"))


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
    """The table of one topic, with its pending rows."""

    def __init__(self, tables: Tables, source: Source) -> None:
        """Open the table; raises BagError on a type that has no columns."""
        self._tables = tables
        self._types = types_of(source)
        self._flattener = Flattener(self._types)
        columns = [*_TIMES, *self._flattener.columns]
        self._stem, self._file = tables.open(source.topic, columns, source.topic)
        self._pending: list[list[Any]] = []

    def add(self, message: ScannedMessage) -> None:
        """Add one message; raises BagError if it cannot be decoded."""
        values = self._flattener.row(self._types.decode(message.data))
        self._pending.append([message.log_time_ns, message.publish_time_ns, *values])
        if len(self._pending) >= _BATCH:
            self.flush()

    def flush(self) -> None:
        """Write the pending rows."""
        self._file.write(self._pending)
        self._tables.rows[self._stem] += len(self._pending)
        self._pending = []

    def close(self) -> None:
        """Complete the file."""
        try:
            self.flush()
        finally:
            self._file.close()


class _TopicTables:
    """The tables of the selected topics."""

    def __init__(self, tables: Tables, selection: Selection, stack: ExitStack) -> None:
        """Begin without a table; ``stack`` closes them."""
        self._tables, self._selection, self._stack = tables, selection, stack
        self._opened: dict[tuple[str, str, bytes], _TopicTable | None] = {}  # over all files of a split bag
        self._pending_bytes = 0

    def of(self, source: Source) -> _TopicTable | None:
        """Return the table of a topic, None if it is not selected or cannot be decoded."""
        key = source.topic, source.schema.name, source.schema.data
        if key not in self._opened:
            self._opened[key] = self._open(source) if self._selection.topics.wants(source.topic) else None
        return self._opened[key]

    def add(self, message: ScannedMessage) -> None:
        """Add a message to the table of its topic, or count it as left out."""
        table, topic = self.of(message.source), message.source.topic
        if table is None:
            self._tables.left_out[topic] += topic in self._tables.skipped
            return
        try:
            table.add(message)
        except BagError as error:
            self._tables.skipped.setdefault(topic, str(error))
            self._tables.left_out[topic] += 1
            return
        self._pending_bytes += len(message.data)
        if self._pending_bytes > _MOST_PENDING:
            self._pending_bytes = 0
            for each in filter(None, self._opened.values()):
                each.flush()

    def _open(self, source: Source) -> _TopicTable | None:
        """Open the table of a topic, or note why there is none."""
        try:
            table = _TopicTable(self._tables, source)
        except BagError as error:
            self._tables.skipped[source.topic] = str(error)
            return None
        self._stack.callback(table.close)
        return table
