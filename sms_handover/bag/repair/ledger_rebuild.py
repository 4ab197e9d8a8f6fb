"""Ledger rebuild: the loss ledger from the messages in a bag, as the recorder would have kept it."""

from collections.abc import Mapping
from contextlib import suppress

from sms_handover.bag.ledger import Ledger
from sms_handover.bag.ledger_keeper import LedgerKeeper
from sms_handover.bag.mcap.scan import ScannedMessage, Source
from sms_handover.bag.recording import PUBLISHED_COUNTS, run_stamp_ns
from sms_handover.bag.schemas import SchemaTypes, types_of
from sms_handover.errors import BagError
from sms_handover.graph.topics import is_refused


class LedgerRebuild:
    """The accounts of the topics of a bag."""

    def __init__(self) -> None:
        self._periods: dict[str, int] = {}  # [ns] fixed steps of the stamps, by topic
        self._keeper = LedgerKeeper()
        self._stamp_places: dict[str, int | None] = {}
        self._reports: dict[str, SchemaTypes] = {}

    def expect(self, periods: Mapping[str, int]) -> None:
        """Set the periods in ns of topics that have no account yet."""
        self._periods.update(periods)

    def open(self, source: Source) -> None:
        """Open the account of a topic unless it has one."""
        name = source.topic
        if name in self._stamp_places:
            return
        self._keeper.add_topic(name, self._periods.get(name, 0))
        try:
            types = types_of(source)
        except BagError:  # not decodable: only counted
            self._stamp_places[name] = None
            return
        self._stamp_places[name] = types.stamp_place
        if source.schema.name == PUBLISHED_COUNTS and not is_refused(name):
            self._reports[name] = types

    def add(self, message: ScannedMessage) -> None:
        """Count one message; the topic must be open."""
        name = message.source.topic
        place = self._stamp_places[name]
        time_ns = None if place is None else run_stamp_ns(message.data, place)
        if time_ns is not None:
            self._keeper.receive(name, time_ns)
            return
        self._keeper.receive_unstamped(name)
        if name in self._reports:
            with suppress(BagError):  # a broken report is in the bag, but counts nothing
                self._keeper.report(self._reports[name].decode(message.data))

    def ledger(self) -> Ledger:
        """Return the current accounts."""
        return self._keeper.ledger()
