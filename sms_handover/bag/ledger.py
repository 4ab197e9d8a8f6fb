"""The loss ledger of a recording: per topic what was received, what is missing and how evenly it came."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass

from sms_handover.errors import BagError
from sms_handover.units import NS_PER_S

_HEADING = (
    "topic",
    "received",
    "published",
    "missing",
    "twice",
    "late",
    "first [s]",
    "last [s]",
    "rate [Hz]",
    "largest gap [ms]",
)

LEDGER_RECORD = "sms_handover.ledger"  # names of metadata records: the accounts, and
PERIODS_RECORD = "sms_handover.periods"  # before any message, the step of the stamps in ns by topic


def has_ledger(records: Iterable[str]) -> bool:
    """Whether a bag with these metadata records was recorded with a loss ledger."""
    return not {LEDGER_RECORD, PERIODS_RECORD}.isdisjoint(records)


@dataclass(frozen=True)
class TopicLedger:
    """The account of one topic; stamps are simulation time in nanoseconds.

    ``missing`` counts the stamps between the first and the last that were not received,
    ``out_of_order`` those received after a later one. Without a fixed period (``period_ns`` 0)
    nothing is missing or duplicate. Stamps are None without messages or for a type without stamp;
    ``published`` is None unless a node reported it.
    """

    name: str
    period_ns: int
    received: int
    first_ns: int | None
    last_ns: int | None
    missing: int
    duplicates: int
    out_of_order: int
    largest_gap_ns: int
    published: int | None

    @property
    def lost(self) -> int | None:
        """Return how many published messages were not received, None if that is unknown."""
        return None if self.published is None else self.published - self.received

    @property
    def rate(self) -> float | None:
        """Return the messages per second of simulation time, None for fewer than two stamps."""
        if self.first_ns is None or self.last_ns is None or self.last_ns <= self.first_ns:
            return None
        return (self.received - 1) * NS_PER_S / (self.last_ns - self.first_ns)

    @property
    def complete(self) -> bool:
        """Whether nothing is known to be missing."""
        return self.missing == 0 and (self.lost is None or self.lost <= 0)


@dataclass(frozen=True)
class Ledger:
    """The accounts of all topics of a recording."""

    topics: tuple[TopicLedger, ...]

    @property
    def complete(self) -> bool:
        """Whether nothing is known to be missing on any topic."""
        return all(topic.complete for topic in self.topics)

    def to_record(self) -> dict[str, str]:
        """Return the ledger as a metadata record: one JSON object per topic."""
        accounts = [asdict(topic) for topic in self.topics]
        return {account.pop("name"): json.dumps(account) for account in accounts}

    @classmethod
    def from_record(cls, record: Mapping[str, str]) -> "Ledger":
        """Return the ledger in a metadata record; raises BagError if it is not one."""
        try:
            return cls(tuple(TopicLedger(name=name, **json.loads(text)) for name, text in record.items()))
        except (TypeError, ValueError) as error:
            raise BagError(f"the loss ledger of the bag is not readable: {error}") from error


def periods_of(record: Mapping[str, str]) -> dict[str, int]:
    """Return the step of the stamps [ns] by topic from a metadata record; raises BagError."""
    try:
        return {name: int(text) for name, text in record.items()}
    except ValueError as error:
        raise BagError(f"the periods in the bag are not readable: {error}") from error


def ledger_table(ledger: Ledger) -> str:
    """Return the ledger as text, one line per topic under a heading."""
    rows = [_HEADING, *(_row(topic) for topic in ledger.topics)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEADING))]
    return "\n".join(
        "  ".join((name.ljust(widths[0]), *map(str.rjust, cells, widths[1:]))) for name, *cells in rows
    )


def _row(topic: TopicLedger) -> tuple[str, ...]:
    return (
        topic.name,
        str(topic.received),
        "-" if topic.published is None else str(topic.published),
        str(topic.missing) if topic.period_ns else "-",
        str(topic.duplicates),
        str(topic.out_of_order),
        _seconds(topic.first_ns),
        _seconds(topic.last_ns),
        "-" if topic.rate is None else f"{topic.rate:.1f}",
        "-" if topic.rate is None else f"{topic.largest_gap_ns / 1e6:.3f}",
    )


def _seconds(stamp_ns: int | None) -> str:
    return "-" if stamp_ns is None else f"{stamp_ns / NS_PER_S:.3f}"
