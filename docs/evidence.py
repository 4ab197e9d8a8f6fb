"""Evidence on the control laws: runs the shipped campaign ``laws`` and writes docs/laws.md from its rows."""

import argparse
from collections.abc import Mapping
from pathlib import Path

from docs.tables import plain, table
from sms_handover.analysis.layout import number
from sms_handover.campaign.definition.frozen import campaign_path, freeze
from sms_handover.campaign.engine.choice import workers_for
from sms_handover.campaign.engine.run import Tally, run_campaign
from sms_handover.campaign.record.campaign_folder import CampaignFolder, open_campaign
from sms_handover.campaign.record.manifest import Shard
from sms_handover.campaign.statistics.case_columns import CaseColumns, Group, columns_of
from sms_handover.campaign.statistics.paired_tests import SUCCESS, paired_tests
from sms_handover.campaign.statistics.percentiles import percentile
from sms_handover.campaign.statistics.proportion import proportion
from sms_handover.campaign.statistics.tables import TESTED
from sms_handover.campaign.statistics.worst_cases import failures_by_cause
from sms_handover.terminal.progress import Progress
from sms_handover.units import DEG_PER_RAD, MM_PER_M

ROOT = Path(__file__).resolve().parent.parent
PAGE, FOLDER = ROOT / "docs" / "laws.md", ROOT / "build" / "evidence" / "laws"
_FIGURES = {  # metric: its title, and the factor from its unit
    "grasp_error": ("grasp error [mm]", MM_PER_M),
    "grasp_angle": ("grasp angle [deg]", DEG_PER_RAD),
    "clearance": ("clearance beyond what is allowed [mm]", MM_PER_M),
    "base_turn": ("base turn [deg]", DEG_PER_RAD),
    "control_effort": ("effort [(N m)² s]", 1.0),
    "rate_share": ("largest share of a rate limit", 1.0),
    "time_beyond_position_limit": ("time beyond position limits [s]", 1.0),
}
_LARGE, _SMALL = (0.5, 0.95), (0.5, 0.05)  # shares of figures that are bad where large, or where small
_MOST_CAUSES = 10


def page(folder: CampaignFolder) -> str:
    """Return the text of the page."""
    campaign, entries = folder.campaign, list(folder.entries())
    columns = columns_of(entries)
    causes = [
        (law, status, plain(cause), str(times))
        for (law, status, cause), times in failures_by_cause(entries).most_common(_MOST_CAUSES)
    ]
    draws = [(f"`{path}`", str(one)) for path, one in campaign.draws.items()]
    tests = [
        (
            test.scenario,
            f"{test.one} - {test.other}",
            "share of successes" if test.metric == SUCCESS else f"median of {test.metric}",
            str(test.cases),
            *map(number, (test.difference, test.p, test.adjusted)),
        )
        for test in paired_tests(columns, TESTED)
    ]
    failures = (
        f"## Failures by cause\n\n{table(['Law', 'Status', 'Cause', 'Cases'], causes)}\n"
        if causes
        else "No case failed.\n"
    )
    scenarios, laws = len(campaign.scenarios), len(campaign.laws)
    return f"""\
# Ranking of the control laws

This page is written by `make evidence` from the shipped campaign
[`laws`](../config/campaigns/laws.yaml): {folder.cases} cases, each in {scenarios} scenarios under {laws} laws
with the same draws, {len(entries)} runs. `sms-handover campaign run laws` and `sms-handover report runs/laws`
make the same with plots; [campaigns.md](campaigns.md) tells how to read it. A law of your own enters by its
name in `laws` of a copy of the file.

The plant has the drawn mass properties, the laws have those of the scenario, with a deputy of
{campaign.values["deputy.mass"]} kg. A case is a success if `{campaign.success.text}`: every grasp made, and
no bodies in each other.

{table(["Drawn for the plant", "Distribution"], draws)}

{_outcomes(folder, columns)}
## Paired tests

McNemar's exact test of successes, Wilcoxon's signed-rank test of metrics, p adjusted by Holm over all.

{table(["Scenario", "Laws", "What", "Cases", "Difference", "p", "p, Holm"], tests)}

{failures}
## What this is not

The spreads are own choices, and {folder.cases} cases are few: mind the intervals. How often the paper's
claims hold over random possible geometries is on [its own page](geometries.md).
"""


def _outcomes(folder: CampaignFolder, columns: Mapping[Group, CaseColumns]) -> str:
    """Return the tables of each scenario."""
    parts = []
    for scenario in folder.campaign.scenarios:
        laws = [(law, columns[scenario, law]) for law in folder.campaign.laws if (scenario, law) in columns]
        successes = (f"{law}: {proportion(int(one.succeeded.sum()), len(one.case))}" for law, one in laws)
        rows = []
        for metric, (title, factor) in _FIGURES.items():
            for share in _SMALL if metric == "clearance" else _LARGE:
                label = f"{title}, {'median' if share == 0.5 else f'{100 * share:g} %'}"
                rows.append((label, *(_percentile(one, metric, share, factor) for _, one in laws)))
        rows.append(("CPU time of a run [s], mean", *(number(float(one.cpu.mean())) for _, one in laws)))
        head = ["Figure", *(law for law, _ in laws)]
        parts.append(
            f"## Scenario `{scenario}`\n\nSuccess with Wilson's 95 % interval: {'; '.join(successes)}.\n\n"
            f"{table(head, rows)}\n"
        )
    return "\n".join(parts)


def _percentile(one: CaseColumns, metric: str, share: float, factor: float) -> str:
    """Return a percentile with its bootstrap interval."""
    if metric not in one.metrics:
        return "-"
    found = percentile(factor * one.metrics[metric], share)
    interval = "" if found.low != found.low else f" [{number(found.low)}, {number(found.high)}]"
    return number(found.value) + interval


def main() -> None:
    """Run what the campaign lacks, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-j", "--jobs", type=int, default=2, metavar="N", help="cases at the same time")
    jobs = parser.parse_args().jobs
    frozen, cases = freeze(campaign_path("laws"))
    with open_campaign(FOLDER, frozen, cases, Shard()) as folder, Progress() as progress:

        def show(tally: Tally) -> None:
            if progress.due:
                progress.show(f"{tally.done} of {tally.total}", share=tally.done / tally.total)

        run_campaign(folder, lambda: workers_for(frozen, cases, jobs=jobs), show)
    PAGE.write_text(page(CampaignFolder(FOLDER)), encoding="utf-8")


if __name__ == "__main__":
    main()
