"""Evidence on the control laws: runs the shipped campaign ``laws`` and writes docs/laws.md from its rows."""

import argparse
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np

from docs.measurement_folder import measurement_folder
from docs.tables import plain, table
from sms_handover.analysis.layout import MISSING, number
from sms_handover.campaign.definition.frozen import campaign_path, freeze
from sms_handover.campaign.engine.choice import workers_for
from sms_handover.campaign.engine.run import Tally, run_campaign
from sms_handover.campaign.record.campaign_folder import CampaignFolder, open_campaign
from sms_handover.campaign.record.manifest import Shard
from sms_handover.campaign.statistics.case_columns import CaseColumns, Group, columns_of
from sms_handover.campaign.statistics.notes import PERCENTILES, note_on_tests
from sms_handover.campaign.statistics.paired_tests import SUCCESS, paired_tests
from sms_handover.campaign.statistics.percentiles import Percentile, percentile
from sms_handover.campaign.statistics.proportion import Proportion, proportion
from sms_handover.campaign.statistics.worst_cases import failures_by_cause
from sms_handover.terminal.progress import Progress
from sms_handover.types import Array
from sms_handover.units import DEG_PER_RAD, MM_PER_M

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "laws.md"
_MS_PER_S = 1000.0  # [ms/s]
_FIGURES = {  # metric: its title, and the factor from its unit
    "grasp_error": ("grasp error [mm]", MM_PER_M),
    "grasp_angle": ("grasp angle [deg]", DEG_PER_RAD),
    "clearance": ("clearance beyond what is allowed [mm]", MM_PER_M),
    "base_turn": ("base turn [deg]", DEG_PER_RAD),
    "control_effort": ("effort [(N m)² s]", 1.0),
    "peak_torque": ("largest torque [N m]", 1.0),
    "rate_share": ("largest share of a rate limit", 1.0),
    "time_beyond_position_limit": ("time beyond position limits [s]", 1.0),
}
_RANK = "grasp_error"  # by which laws are ranked after their success, and tested
_LISTED = (_RANK, "clearance", "base_turn", "control_effort")  # in the table of all laws
_LIMITS = ("saturated_ticks", "time_above_rate_limit", "time_beyond_position_limit")
_LARGE, _SMALL = (0.5, 0.95), (0.5, 0.05)  # shares of figures that are bad where large, or where small
_MOST_CAUSES = 10


def page(folder: CampaignFolder) -> str:
    """Return the text of the page."""
    campaign, entries = folder.campaign, list(folder.entries())
    columns = columns_of(entries)
    counted = failures_by_cause(entries).most_common()
    causes = [
        (scenario, law, status, plain(cause), str(times))
        for (scenario, law, status, cause), times in counted[:_MOST_CAUSES]
    ]
    draws = [(f"`{path}`", str(one)) for path, one in campaign.draws.items()]
    made = paired_tests(columns, [_RANK])
    tests = [
        (
            test.scenario,
            f"{test.one} - {test.other}",
            "share of successes" if test.metric == SUCCESS else f"median of {test.metric}",
            str(test.cases),
            *map(number, (test.difference, test.p, test.adjusted)),
        )
        for test in made
    ]
    further = f"\n{len(counted) - len(causes)} more causes.\n" if len(counted) > len(causes) else ""
    failures = (
        f"## Failures by cause\n\n{table(['Scenario', 'Law', 'Status', 'Cause', 'Cases'], causes)}\n{further}"
        if causes
        else "No case failed.\n"
    )
    head = ["Scenario", "Law", "Success", *(_FIGURES[metric][0] for metric in _LISTED)]
    laws, seconds = ", ".join(campaign.laws), campaign.values["common.duration"]
    too_few = f"{note}\n\n" if (note := note_on_tests(made)) else ""
    return f"""\
# Ranking of the control laws

This page is written by `make evidence` from the shipped campaign
[`laws`](../config/campaigns/laws.yaml): {folder.cases} cases, each in
{len(campaign.scenarios)} scenarios under {laws} with the same draws, {len(entries)} runs, of each the
first {seconds:g} s, which have both grasps. `sms-handover campaign run laws` makes the same with plots,
`python -m docs.evidence --cases 50` this page of more cases; [campaigns.md](campaigns.md) tells how to
read it, and how a [law of your own](campaigns.md#a-law-of-your-own) enters by one line.

The plant has the drawn mass properties, the laws have those of the scenario, with a deputy of
{campaign.values["deputy.mass"]} kg. `smooth` and `paper` are at ideal [conditions](conditions.md), the
others at nominal ones: friction, errors and noise of torques, a delay, wrenches, and a true robot that
differs further. A case is a success if `{campaign.success.text}`: no grasp missed, no bodies in each other.
`mpc` has its defaults, which limit torques and rates of joints, and keep bodies 10 mm apart
(`controller.least_distance`): without, it takes the shortest way on the steps of `paper`, through what is
there.

{table(["Drawn for the plant", "Distribution"], draws)}

## All laws

By success, then by grasp error. Success has Wilson's 95 % interval, the rest are medians, with intervals
below. **A law is ranked above another only where their intervals of success, or else of the median grasp
error, are apart; laws of which both overlap are not ranked by this evidence**, as each scenario says. Beyond
limits are cases in which any torque was clipped or any joint was faster, or further, than it may, among the
cases that have these figures, with Wilson's interval; the solve time is the wall time of a plan, which only
laws that plan have. {PERCENTILES}

{table([*head, "Beyond limits", "Solve time [ms]", "CPU of a run [s]"], _ranking(folder, columns))}

{_outcomes(folder, columns)}
## Paired tests

McNemar's exact test of successes and Wilcoxon's signed-rank test of the grasp error, by which laws are
ranked; p adjusted by Holm over all of these. Of the other figures there are intervals.

{too_few}{table(["Scenario", "Laws", "What", "Cases", "Difference", "p", "p, Holm"], tests)}

{failures}
## What this is not

The spreads are own choices, and {folder.cases} cases are few: mind the intervals. How often the paper's
claims hold over random possible geometries is on [its own page](geometries.md).
"""


def _ranking(folder: CampaignFolder, columns: Mapping[Group, CaseColumns]) -> list[tuple[str, ...]]:
    """Return a row for each law in each scenario, the better law first."""
    rows = []
    for scenario in folder.campaign.scenarios:
        laws = [law for law in folder.campaign.laws if (scenario, law) in columns]
        laws.sort(key=lambda law: _rank(columns[scenario, law]))
        for law in laws:
            one = columns[scenario, law]
            figures = (_median(one.metrics.get(metric), _FIGURES[metric][1]) for metric in _LISTED)
            success = str(_success(one))
            costs = (_median(one.solve, _MS_PER_S), number(float(one.cpu.mean())))
            rows.append((scenario, law, success, *figures, _beyond(one), *costs))
    return rows


def _success(one: CaseColumns) -> Proportion:
    """Return the share of successes."""
    return proportion(int(one.succeeded.sum()), len(one.case))


def _beyond(one: CaseColumns) -> str:
    """Return in how many of the cases that have the figures of all limits one was exceeded."""
    figures = np.array([one.metrics.get(name, np.full(len(one.case), np.nan)) for name in _LIMITS])
    known = ~np.isnan(figures).any(axis=0)
    share = proportion(int((figures[:, known] > 0.0).any(axis=0).sum()), int(known.sum()))
    return f"{share.successes} of {share.trials}: {share}" if share.trials else MISSING


def _rank(one: CaseColumns) -> tuple[float, float]:
    """Return by what laws are sorted, the better the smaller."""
    errors = one.metrics.get(_RANK, np.array([np.inf]))
    return -_success(one).share, float(np.nan_to_num(percentile(errors, 0.5).value, nan=np.inf))


def _order(laws: Sequence[tuple[str, CaseColumns]]) -> str:
    """Return which laws are above which others by intervals that are apart, and which are not ranked."""
    ranked, others = [], []
    for (law, one), (other, another) in combinations(laws, 2):
        successes, errors = (_success(one), _success(another)), (_error(one), _error(another))
        if _apart(*successes):
            first = successes[0].low > successes[1].high
            ranked.append(_above(law, other, "success", first=first))
        elif _apart(*errors):
            ranked.append(_above(law, other, "grasp error", first=errors[0].high < errors[1].low))
        else:
            others.append(f"{law} and {other}")
    return f"Ranked: {', '.join(ranked) or 'none'}. Not ranked: {', '.join(others) or 'none'}."


def _above(law: str, other: str, figure: str, *, first: bool) -> str:
    """Return which of two laws is above the other, and by what."""
    better, worse = (law, other) if first else (other, law)
    return f"{better} above {worse} by {figure}"


def _error(one: CaseColumns) -> Percentile:
    """Return the median grasp error."""
    return percentile(one.metrics.get(_RANK, np.empty(0)), 0.5)


def _apart(one: Proportion | Percentile, other: Proportion | Percentile) -> bool:
    """Return whether two intervals are apart, not so where there is none."""
    return one.high < other.low or other.high < one.low


def _median(values: Array | None, factor: float) -> str:
    """Return the median of what is known, a dash where nothing is."""
    return number(np.nan if values is None else factor * percentile(values, 0.5).value)


def _outcomes(folder: CampaignFolder, columns: Mapping[Group, CaseColumns]) -> str:
    """Return the tables of each scenario."""
    parts = []
    for scenario in folder.campaign.scenarios:
        laws = [(law, columns[scenario, law]) for law in folder.campaign.laws if (scenario, law) in columns]
        successes = (f"{law}: {_success(one)}" for law, one in laws)
        rows = []
        for metric, (title, factor) in _FIGURES.items():
            for share in _SMALL if metric == "clearance" else _LARGE:
                label = f"{title}, {'median' if share == 0.5 else f'{100 * share:g} %'}"
                rows.append((label, *(_percentile(one, metric, share, factor) for _, one in laws)))
        rows.append(("solve time [ms], median", *(_known(one.solve, 0.5, _MS_PER_S) for _, one in laws)))
        rows.append(("CPU time of a run [s], mean", *(number(float(one.cpu.mean())) for _, one in laws)))
        head = ["Figure", *(law for law, _ in laws)]
        parts.append(
            f"## Scenario `{scenario}`\n\nSuccess with Wilson's 95 % interval: {'; '.join(successes)}.\n"
            f"{_order(laws)}\n\n{table(head, rows)}\n"
        )
    return "\n".join(parts)


def _percentile(one: CaseColumns, metric: str, share: float, factor: float) -> str:
    """Return a percentile of a metric with its interval."""
    return _known(one.metrics[metric], share, factor) if metric in one.metrics else "-"


def _known(values: Array, share: float, factor: float) -> str:
    """Return a percentile of the cases that have a value, its interval, and their number if it is less."""
    found = percentile(factor * values, share)
    interval = "" if found.low != found.low else f" [{number(found.low)}, {number(found.high)}]"
    fewer = f", {found.known} cases" if 0 < found.known < len(values) else ""
    return number(found.value) + interval + fewer


def main() -> None:
    """Run what the campaign lacks, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-j", "--jobs", type=int, default=2, metavar="N", help="cases at the same time")
    parser.add_argument(
        "--cases", type=int, metavar="N", help="in place of those of the file; more are added"
    )
    options = parser.parse_args()
    frozen, cases = freeze(campaign_path("laws"))
    cases = options.cases or cases
    place = measurement_folder("evidence")
    with open_campaign(place, frozen, cases, Shard()) as folder, Progress() as progress:

        def show(tally: Tally) -> None:
            if progress.due:
                progress.show(f"{tally.done} of {tally.total}", share=tally.done / tally.total)

        run_campaign(folder, lambda: workers_for(frozen, folder.cases, jobs=options.jobs), show)
    PAGE.write_text(page(CampaignFolder(place)), encoding="utf-8")


if __name__ == "__main__":
    main()
