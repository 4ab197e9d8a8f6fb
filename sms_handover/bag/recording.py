"""Record the raw messages of a running graph: bag, loss ledger and clock in one object."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from sms_handover.bag.attachments import PARAMETERS_FILE, ROBOT_FILE, SCHEDULE_FILE, parameters_json
from sms_handover.bag.ledger import LEDGER_RECORD, PERIODS_RECORD, Ledger
from sms_handover.bag.ledger_keeper import LedgerKeeper
from sms_handover.bag.provenance import PROVENANCE_RECORD
from sms_handover.bag.qos import Qos
from sms_handover.bag.split import Split
from sms_handover.bag.writer import BagWriter
from sms_handover.errors import BagError
from sms_handover.graph.topics import is_refused
from sms_handover.messages.message_types import MessageTypes
from sms_handover.messages.stamps import stamp_ns

PUBLISHED_COUNTS = "sms_handover_interfaces/msg/PublishedCounts"

_NO_STAMP = -1

LONGEST_RUN_NS = 10**17  # [ns] three years; a later stamp is the wall clock's


class Recording:
    """An open recording of a graph; close it, or use it as a context manager.

    Whoever feeds it needs to know nothing of a message but its topic: the stamp is read from the
    bytes and becomes the log time, the counts that nodes report at their end go to the ledger. A
    message without a stamp, or with one of the wall clock, gets the newest simulation time.
    """

    def __init__(
        self, folder: Path, *, types: MessageTypes | None = None, split: Split | None = None
    ) -> None:
        """Create the bag; raises BagError if ``folder`` exists or cannot be made."""
        self.writer = BagWriter(folder, types=types, split=split)
        self._types = self.writer.types
        self._keeper = LedgerKeeper()
        self._stamped: dict[str, bool] = {}
        self._reports: set[str] = set()
        self._periods: dict[str, str] = {}  # [ns] as texts, by topic
        self._now_ns = 0

    def __enter__(self) -> "Recording":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the recording; on an error in the block too, and then that error is the one that counts."""
        if error is None:
            self.close()
        else:
            with suppress(BagError):
                self.close()

    @property
    def ledger(self) -> Ledger:
        """Return the loss ledger as it stands."""
        return self._keeper.ledger()

    @property
    def simulation_ns(self) -> int:
        """Return the newest simulation time received."""
        return self._now_ns

    def add_topic(self, name: str, type_name: str, qos: Sequence[Qos] = (), period_ns: int = 0) -> None:
        """Open a topic; ``period_ns`` is the fixed step of its stamps, 0 if it has none."""
        self.writer.add_topic(name, type_name, qos)
        self._keeper.add_topic(name, period_ns)
        self._stamped[name] = self._types.stamped(type_name)
        self._periods[name] = str(period_ns)
        if type_name == PUBLISHED_COUNTS and not is_refused(name):
            self._reports.add(name)

    def describe(
        self,
        *,
        urdf: str | None = None,
        schedule: str | None = None,
        parameters: Mapping[str, Mapping[str, object]] | None = None,
        provenance: Mapping[str, str] | None = None,
    ) -> None:
        """Store what makes the bag stand on its own; each is to be given once, whenever it is known.

        ``urdf`` and ``schedule`` are the texts, ``parameters`` are by node and name.
        """
        if urdf is not None:
            self.writer.attach(ROBOT_FILE, "application/xml", urdf.encode())
        if schedule is not None:
            self.writer.attach(SCHEDULE_FILE, "application/yaml", schedule.encode())
        if parameters is not None:
            self.writer.attach(PARAMETERS_FILE, "application/json", parameters_json(parameters).encode())
        if provenance is not None:
            self.writer.record(PROVENANCE_RECORD, provenance)

    def begin(self) -> None:
        """Tell in the bag what is to come on the topics opened so far, for a recovery to hold it against."""
        self.writer.record(PERIODS_RECORD, self._periods)

    def receive(self, topic: str, data: bytes, wall_ns: int) -> None:
        """Record the CDR bytes of one message that arrived at ``wall_ns``."""
        if self._stamped.get(topic):
            time_ns = _stamp_or_not(data)
            if 0 <= time_ns < LONGEST_RUN_NS:
                if time_ns > self._now_ns:
                    self._now_ns = time_ns
                self.writer.write(topic, data, time_ns, wall_ns)
                self._keeper.receive(topic, time_ns)
                return
        self.writer.write(topic, data, self._now_ns, wall_ns)
        self._keeper.receive_unstamped(topic)
        if topic in self._reports:
            self._book_counts(data)

    def receive_at(self, topic: str, data: bytes, time_ns: int, wall_ns: int) -> None:
        """Record one message whose simulation time the caller knows, e.g. the transforms it made itself."""
        self.writer.write(topic, data, time_ns, wall_ns)
        self._keeper.receive(topic, time_ns)

    def close(self) -> None:
        """Write the ledger and complete the bag; a second call does nothing."""
        if self.writer.closed:
            return
        try:
            self.writer.record(LEDGER_RECORD, self.ledger.to_record())
        finally:
            self.writer.close()

    def _book_counts(self, data: bytes) -> None:
        """Book what a node says it has published."""
        try:
            report = self._types.deserialize(data, PUBLISHED_COUNTS)
        except BagError:
            return  # it is in the bag, but counts nothing
        for topic, count in zip(report.topics, report.counts, strict=False):
            self._keeper.report_published(report.node, topic, int(count))


def _stamp_or_not(data: bytes) -> int:
    """Return the stamp of a message in ns, :data:`_NO_STAMP` if it is broken; it is recorded all the same."""
    try:
        return stamp_ns(data)
    except BagError:
        return _NO_STAMP
