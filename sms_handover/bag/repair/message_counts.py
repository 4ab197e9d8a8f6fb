"""Message counts stated by several sources, compared with the messages found."""

from collections.abc import Mapping

from sms_handover.bag.repair.findings import Findings


class MessageCounts:
    """The number of messages of each topic, by source."""

    def __init__(self) -> None:
        self._stated: dict[str, dict[str, int]] = {}

    def add(self, source: str, counts: Mapping[str, int]) -> None:
        """Add the counts of a source; those of the files of a split bag add up."""
        for topic, count in counts.items():
            stated = self._stated.setdefault(topic, {})
            stated[source] = stated.get(source, 0) + count

    def close(self, counts: Mapping[str, int], findings: Findings) -> None:
        """Report in one line per topic which sources differ from ``counts``."""
        for topic, stated in self._stated.items():
            there = counts.get(topic, 0)
            more = [source for source, count in stated.items() if count > there]
            fewer = [f"{source} ({count})" for source, count in stated.items() if count < there]
            if more:
                most = max(stated.values())
                findings.missing(f"{topic}: {there} of {most} messages are there ({', '.join(more)})")
            if fewer:
                findings.damaged(f"{topic}: {there} messages are there, more than stated: {', '.join(fewer)}")
