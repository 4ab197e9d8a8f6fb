"""Recording of a running graph: bag, loss ledger and clock in one object."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from sms_handover.bag.attachments import (
    PARAMETERS_FILE,
    ROBOT_FILE,
    SCENARIO_FILE,
    SCHEDULE_FILE,
    parameters_json,
)
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

LONGEST_RUN_NS = 10**17  # [ns] three years; a later stamp is one of the wall clock


class Recording:
    """An open recording of a graph; close it, or use it as a context manager.

    The caller gives topic and bytes of a message: the stamp in them becomes the log time, the counts
    that nodes report at their end go to the ledger. A message without a stamp, or with one of the
    wall clock, gets the latest simulation time.
    """

    def __init__(
        self, folder: Path, *, types: MessageTypes | None = None, split: Split | None = None
    ) -> None:
        """Create the bag; raises BagError if ``folder`` exists or cannot be made."""
        self.writer = BagWriter(folder, types=types, split=split)
        self._types = self.writer.types
        self._keeper = LedgerKeeper()
        self._stamp_places: dict[str, int | None] = {}
        self._reports: set[str] = set()
        self._periods: dict[str, str] = {}  # [ns] as texts, by topic
        self._now_ns = 0

    def __enter__(self) -> "Recording":
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        """Close the recording; an error raised in the block takes precedence over one of closing."""
        if error is None:
            self.close()
        else:
            with suppress(BagError):
                self.close()

    @property
    def ledger(self) -> Ledger:
        """Return the current loss ledger."""
        return self._keeper.ledger()

    @property
    def simulation_ns(self) -> int:
        """Return the latest simulation time received."""
        return self._now_ns

    def add_topic(self, name: str, type_name: str, qos: Sequence[Qos] = (), period_ns: int = 0) -> None:
        """Open a topic; ``period_ns`` is the fixed step of its stamps, 0 if it has none."""
        self.writer.add_topic(name, type_name, qos)
        self._keeper.add_topic(name, period_ns)
        self._stamp_places[name] = self._types.stamp_place(type_name)
        self._periods[name] = str(period_ns)
        if type_name == PUBLISHED_COUNTS and not is_refused(name):
            self._reports.add(name)

    def describe(
        self,
        *,
        urdf: str | None = None,
        schedule: str | None = None,
        scenario: str | None = None,
        parameters: Mapping[str, Mapping[str, object]] | None = None,
        provenance: Mapping[str, str] | None = None,
    ) -> None:
        """Store what makes the bag self-contained, each once: texts, and parameters by node and name."""
        if urdf is not None:
            self.writer.attach(ROBOT_FILE, "application/xml", urdf.encode())
        if schedule is not None:
            self.writer.attach(SCHEDULE_FILE, "application/yaml", schedule.encode())
        if scenario is not None:
            self.writer.attach(SCENARIO_FILE, "application/yaml", scenario.encode())
        if parameters is not None:
            self.writer.attach(PARAMETERS_FILE, "application/json", parameters_json(parameters).encode())
        if provenance is not None:
            self.writer.record(PROVENANCE_RECORD, provenance)

    def begin(self) -> None:
        """Store the periods of the topics opened so far, which a recovery compares stamps with."""
        self.writer.record(PERIODS_RECORD, self._periods)

    def receive(self, topic: str, data: bytes, wall_ns: int) -> None:
        """Record the CDR bytes of one message that arrived at ``wall_ns``."""
        place = self._stamp_places.get(topic)
        if place is not None:
            time_ns = run_stamp_ns(data, place)
            if time_ns is not None:
                if time_ns > self._now_ns:
                    self._now_ns = time_ns
                self.writer.write(topic, data, time_ns, wall_ns)
                self._keeper.receive(topic, time_ns)
                return
        self.writer.write(topic, data, self._now_ns, wall_ns)
        self._keeper.receive_unstamped(topic)
        if topic in self._reports:
            with suppress(BagError):  # a broken report is in the bag, but counts nothing
                self._keeper.report(self._types.deserialize(data, PUBLISHED_COUNTS))

    def close(self) -> None:
        """Write the ledger and complete the bag; a second call does nothing."""
        if self.writer.closed:
            return
        try:
            self.writer.record(LEDGER_RECORD, self.ledger.to_record())
        finally:
            self.writer.close()


def run_stamp_ns(data: bytes, place: int) -> int | None:
    """Return the stamp that begins at a byte of a message in ns, None if it is broken or of no run's time."""
    try:
        time_ns = stamp_ns(data, place)
    except BagError:
        return None
    return time_ns if 0 <= time_ns < LONGEST_RUN_NS else None
