"""Stop rule of a campaign: after how many cases every interval was narrow enough, by its rows alone."""

from collections import Counter
from collections.abc import Iterable

from sms_handover.campaign.definition.campaign_file import Campaign
from sms_handover.campaign.record.journal import Entry
from sms_handover.campaign.statistics.proportion import proportion


def stopped_at(campaign: Campaign, cases: int, entries: Iterable[Entry]) -> int:
    """Return the first look at which every interval of success was narrow enough, 0 if it was at none.

    A look counts once all of its cases have a row under every law in every scenario. ``cases`` is the number
    of cases that the campaign has without a stop.
    """
    rule = campaign.stop
    if rule is None:
        return 0
    looks = [look for look in rule.looks if look < cases]
    groups = [(scenario, law) for scenario in campaign.scenarios for law in campaign.laws]
    rows, successes = ({look: Counter[tuple[str, str]]() for look in looks} for _ in range(2))
    for entry in entries:
        task = entry.row.task
        first = next((look for look in looks if task.case < look), None)
        if first is not None:
            rows[first][task[1:]] += 1
            successes[first][task[1:]] += entry.row.succeeded
    all_rows, all_successes = Counter[tuple[str, str]](), Counter[tuple[str, str]]()
    for look in looks:
        all_rows += rows[look]
        all_successes += successes[look]
        if any(all_rows[group] < look for group in groups):
            return 0
        halves = (proportion(all_successes[group], look).half_width for group in groups)
        if all(half <= rule.half_width for half in halves):
            return look
    return 0
