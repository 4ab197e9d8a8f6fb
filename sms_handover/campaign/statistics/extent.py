"""Extent of a campaign: how many of its rows there are, and after how many cases it stopped early."""

from collections.abc import Sequence
from dataclasses import dataclass

from sms_handover.campaign.record.campaign_folder import CampaignFolder
from sms_handover.campaign.record.journal import Entry
from sms_handover.campaign.record.manifest import Shard
from sms_handover.campaign.statistics.stop_rule import stopped_at


@dataclass(frozen=True)
class Extent:
    """How many ``rows`` of ``runs`` a part of a campaign has; ``stopped_at`` is 0 without a stop."""

    name: str
    rows: int
    runs: int
    cases: int
    shard: Shard
    stopped_at: int

    @property
    def is_whole(self) -> bool:
        """Whether every run has a row."""
        return self.rows >= self.runs

    @property
    def in_words(self) -> tuple[str, ...]:
        """The extent in a line, or in two where it stopped early."""
        there = f"campaign {self.name}: {self.rows} of {self.runs} rows, shard {self.shard}"
        stop = f"stopped after {self.stopped_at} of {self.cases} cases: every interval is narrow enough"
        return (there, stop) if self.stopped_at else (there,)

    @property
    def without_failure(self) -> str:
        """What is to be said where no row is a failure."""
        if not self.rows:
            return "No case has a row yet."
        return "Every case is a success." if self.is_whole else f"None of {self.rows} rows is a failure."


def extent_of(folder: CampaignFolder, entries: Sequence[Entry]) -> Extent:
    """Return the extent of a campaign folder that has some entries."""
    campaign, cases = folder.campaign, folder.cases
    stop = stopped_at(campaign, cases, entries)
    return Extent(campaign.name, len(entries), folder.runs(stop), cases, folder.manifest.shard, stop)
