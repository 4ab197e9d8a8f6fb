"""Numbers of messages as several places tell them, held against how many there are."""

from collections.abc import Mapping

from sms_handover.bag.repair.findings import Findings


class MessageCounts:
    """Who says how many messages each topic has."""

    def __init__(self) -> None:
        self._claims: dict[str, dict[str, int]] = {}

    def add(self, who: str, counts: Mapping[str, int]) -> None:
        """Take what one place says; said again, as by the files of a split bag, it adds up."""
        for topic, count in counts.items():
            claims = self._claims.setdefault(topic, {})
            claims[who] = claims.get(who, 0) + count

    def close(self, counts: Mapping[str, int], findings: Findings) -> None:
        """Tell in one line for each topic who says something else than what is there."""
        for topic, claims in self._claims.items():
            there = counts.get(topic, 0)
            more = [who for who, count in claims.items() if count > there]
            fewer = [f"{who} ({count})" for who, count in claims.items() if count < there]
            if more:
                most = max(claims.values())
                findings.missing(f"{topic}: {there} of {most} messages are there ({', '.join(more)})")
            if fewer:
                findings.damaged(f"{topic}: {there} messages are there, more than told: {', '.join(fewer)}")
