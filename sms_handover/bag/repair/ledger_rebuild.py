"""Make the loss ledger anew from the messages in a bag, as the recorder would have kept it."""

from collections.abc import Mapping

from sms_handover.bag.ledger import Ledger
from sms_handover.bag.ledger_keeper import LedgerKeeper
from sms_handover.bag.mcap.scan import ScannedMessage, Source
from sms_handover.bag.recording import LONGEST_RUN_NS, PUBLISHED_COUNTS
from sms_handover.bag.schemas import SchemaTypes, types_of
from sms_handover.errors import BagError
from sms_handover.graph.topics import is_refused
from sms_handover.messages.stamps import stamp_ns


class LedgerRebuild:
    """The accounts of the topics of a bag; ``periods`` are the fixed steps of their stamps in ns."""

    def __init__(self, periods: Mapping[str, int] | None = None) -> None:
        """Begin with the periods that are known."""
        self._periods = dict(periods or {})
        self._keeper = LedgerKeeper()
        self._stamped: dict[str, bool] = {}
        self._reports: dict[str, SchemaTypes] = {}

    def expect(self, periods: Mapping[str, int]) -> None:
        """Take the periods of topics that have no account yet."""
        self._periods.update(periods)

    def open(self, source: Source) -> None:
        """Open the account of a topic, if it has none."""
        name = source.topic
        if name in self._stamped:
            return
        self._keeper.add_topic(name, self._periods.get(name, 0))
        try:
            types = types_of(source)
        except BagError:  # a topic that nobody can decode is only counted
            self._stamped[name] = False
            return
        self._stamped[name] = types.stamped
        if source.schema.name == PUBLISHED_COUNTS and not is_refused(name):
            self._reports[name] = types

    def book(self, message: ScannedMessage) -> None:
        """Book one message; the topic must be open."""
        name = message.source.topic
        if self._stamped[name]:
            try:
                time_ns = stamp_ns(message.data)
            except BagError:
                time_ns = -1
            if 0 <= time_ns < LONGEST_RUN_NS:
                self._keeper.receive(name, time_ns)
                return
        elif self._periods.get(name):
            self._keeper.receive(name, message.log_time_ns)  # such as /tf, whose time the recorder knew
            return
        self._keeper.receive_unstamped(name)
        if name in self._reports:
            try:
                report = self._reports[name].decode(message.data)
            except BagError:
                return  # it is in the bag, but counts nothing
            for topic, count in zip(report.topics, report.counts, strict=False):
                self._keeper.report_published(report.node, topic, int(count))

    def ledger(self) -> Ledger:
        """Return the accounts as they stand."""
        return self._keeper.ledger()
