"""Ledger keeper: the loss ledger while messages come in, cheap enough for every message of the loop."""

from dataclasses import dataclass, field
from typing import Any

from sms_handover.bag.ledger import Ledger, TopicLedger
from sms_handover.errors import BagError


@dataclass
class _Account:
    """The running account of one topic; ``holes`` are ranges of stamps not received yet."""

    name: str
    period_ns: int
    received: int = 0
    first_ns: int | None = None
    last_ns: int = 0
    duplicates: int = 0
    out_of_order: int = 0
    largest_gap_ns: int = 0
    holes: list[tuple[int, int]] = field(default_factory=list)
    published: dict[str, int] = field(default_factory=dict)

    def closed(self) -> TopicLedger:
        return TopicLedger(
            name=self.name,
            period_ns=self.period_ns,
            received=self.received,
            first_ns=self.first_ns,
            last_ns=None if self.first_ns is None else self.last_ns,
            missing=sum((end - start) // self.period_ns + 1 for start, end in self.holes),
            duplicates=self.duplicates,
            out_of_order=self.out_of_order,
            largest_gap_ns=self.largest_gap_ns,
            published=sum(self.published.values()) if self.published else None,
        )

    def irregular(self, stamp_ns: int) -> None:
        """Record a stamp that is not exactly one period after the last one."""
        if self.first_ns is None:
            self.first_ns = self.last_ns = stamp_ns
            return
        step = stamp_ns - self.last_ns
        if step > 0:
            self.largest_gap_ns = max(self.largest_gap_ns, step)
            self._open_hole(len(self.holes), self.last_ns + self.period_ns, stamp_ns - self.period_ns)
            self.last_ns = stamp_ns
        elif step < 0:
            self.out_of_order += 1
            self._late(stamp_ns, self.first_ns)
        elif self.period_ns:
            self.duplicates += 1

    def _late(self, stamp_ns: int, first_ns: int) -> None:
        """Record a stamp before the latest: it fills a hole, precedes all, or is a duplicate."""
        if stamp_ns < first_ns:
            self.first_ns = stamp_ns
            self._open_hole(0, stamp_ns + self.period_ns, first_ns - self.period_ns)
            return
        for index, (start, end) in enumerate(self.holes):
            if start <= stamp_ns <= end:
                del self.holes[index]
                self._open_hole(index, stamp_ns + self.period_ns, end)
                self._open_hole(index, start, stamp_ns - self.period_ns)
                return
        if self.period_ns:
            self.duplicates += 1

    def _open_hole(self, index: int, start: int, end: int) -> None:
        """Add the stamps from ``start`` to ``end``, if there are any, to the missing ones."""
        if self.period_ns and start <= end:
            self.holes.insert(index, (start, end))


class LedgerKeeper:
    """The running accounts of all topics of a recording."""

    def __init__(self) -> None:
        self._accounts: dict[str, _Account] = {}

    def add_topic(self, name: str, period_ns: int = 0) -> None:
        """Open the account of a topic; ``period_ns`` is the fixed step of its stamps, 0 if it has none."""
        if name in self._accounts:
            raise BagError(f"topic {name!r} is already in the ledger")
        self._accounts[name] = _Account(name, period_ns)

    def receive(self, topic: str, stamp_ns: int) -> None:
        """Count one message with a stamp."""
        account = self._accounts[topic]
        account.received += 1
        period_ns = account.period_ns
        if period_ns and stamp_ns - account.last_ns == period_ns and account.received > 1:
            account.last_ns = stamp_ns
            if account.largest_gap_ns < period_ns:
                account.largest_gap_ns = period_ns
        else:
            account.irregular(stamp_ns)

    def receive_unstamped(self, topic: str) -> None:
        """Count one message without a stamp."""
        self._accounts[topic].received += 1

    def report(self, published: Any) -> None:
        """Take a decoded PublishedCounts; topics that are not recorded are ignored."""
        for topic, count in zip(published.topics, published.counts, strict=False):
            if topic in self._accounts:
                self._accounts[topic].published[published.node] = int(count)

    def ledger(self) -> Ledger:
        """Return the current accounts."""
        return Ledger(tuple(account.closed() for account in self._accounts.values()))
