"""Statistics of campaigns against known answers."""

import shlex
from collections.abc import Sequence
from math import nan, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom
from statsmodels.stats.proportion import proportion_confint

from sms_handover.campaign.cases.case_row import Beside, Row, Status, Task
from sms_handover.campaign.definition.campaign_file import Campaign, read_campaign
from sms_handover.campaign.page.campaign_plots import campaign_plots
from sms_handover.campaign.record.journal import Entry
from sms_handover.campaign.sampling.samples import Samples
from sms_handover.campaign.statistics.case_columns import CaseColumns
from sms_handover.campaign.statistics.holm import holm
from sms_handover.campaign.statistics.notes import note_on_sampler, note_on_tests
from sms_handover.campaign.statistics.paired_tests import paired_tests
from sms_handover.campaign.statistics.pareto import pareto_front
from sms_handover.campaign.statistics.percentiles import least_cases, percentile
from sms_handover.campaign.statistics.proportion import proportion
from sms_handover.campaign.statistics.sensitivity import CORRELATION, DESIGNED, sensitivities
from sms_handover.campaign.statistics.tables import outcome_sections, sensitivity_sections
from sms_handover.campaign.statistics.worst_cases import rerun_command, worst_of

from .campaigns import written

PATHS = ("plant.grasp_position_tolerance", "plant.grasp_angle_tolerance", "plant.grasp_speed_tolerance")


def test_wilson_is_that_of_statsmodels_and_covers() -> None:
    """Its coverage averaged over p is within 0.94 to 0.96, of few cases and many."""
    for trials in (10, 50, 400):
        intervals = [proportion(k, trials) for k in range(trials + 1)]
        theirs = np.array([proportion_confint(k, trials, method="wilson") for k in range(trials + 1)])
        ours = np.array([(one.low, one.high) for one in intervals])
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
        shares = np.linspace(0.005, 0.995, 199)
        held = (ours[:, :1] <= shares) & (shares <= ours[:, 1:])
        chances = binom.pmf(np.arange(trials + 1)[:, np.newaxis], trials, shares)
        assert 0.94 < float((held * chances).sum(axis=0).mean()) < 0.96
    for one in (proportion(k, trials) for trials in range(1, 60) for k in range(trials + 1)):
        assert one.low <= one.share <= one.high, "in spite of rounding"
        assert (one.low == 0.0, one.high == 1.0) == (one.successes == 0, one.successes == one.trials)
    assert tuple(proportion(0, 0)) == (0, 0, 0.0, 1.0) and str(proportion(0, 0)) == "none yet"


def columns(
    metric: Sequence[float] = (), succeeded: Sequence[bool] = (), first: int = 0, **inputs: Any
) -> CaseColumns:
    """Return made-up columns of cases in a row."""
    count = max(len(metric), len(succeeded))
    values = np.array(metric, dtype=float) if len(metric) else np.full(count, nan)
    return CaseColumns(
        np.arange(first, first + count),
        np.array(succeeded, dtype=bool) if len(succeeded) else np.ones(count, dtype=bool),
        np.zeros(count, dtype=bool),
        np.ones(count),
        {"grasp_error": values},
        {name: np.asarray(column) for name, column in inputs.items()},
        np.full(count, nan),
    )


def test_laws_are_compared_case_by_case() -> None:
    """Discordant pairs 3 and 9: McNemar's exact p is 2 P(X <= 3) of Bin(12, 1/2); Holm doubles the least."""
    one = [True] * 3 + [False] * 9 + [True] * 20
    other = [False] * 3 + [True] * 9 + [True] * 20
    rng = np.random.default_rng(2)
    base = rng.normal(size=32)
    laws = {
        ("s", "a"): columns(list(base), one),
        ("s", "b"): columns(list(base + 0.3 + 0.01 * rng.normal(size=32)), other),
    }
    success, error = paired_tests(laws, ["grasp_error"])
    assert success.p == pytest.approx(2.0 * binom.cdf(3, 12, 0.5))
    assert success.cases == 32
    assert success.difference == pytest.approx(-6 / 32)
    assert error.p == pytest.approx(2.0 ** (1 - 32), rel=1e-6)  # every difference has the same sign
    assert error.difference == pytest.approx(-0.3, abs=0.02)
    assert [error.adjusted, success.adjusted] == pytest.approx([2 * error.p, success.p])


@pytest.mark.parametrize(("metric", "worst"), [("grasp_error", [3, 2]), ("clearance", [0, 1])])
def test_the_worst_are_the_largest_or_of_clearance_the_smallest(metric: str, worst: list[int]) -> None:
    rows = [
        Row(Task(case, "s", "a"), 1, {}, Status.SUCCEEDED, "", {metric: value}, "00")
        for case, value in enumerate((0.1, 0.2, 0.3, 0.4, None))
    ]
    found = worst_of([Entry(row, Beside(0.0, 0.0, "")) for row in rows], metric, 2)
    assert [row.task.case for row in found["s", "a"]] == worst


def test_only_cases_that_both_laws_have_are_paired() -> None:
    laws = {
        ("s", "a"): columns([1.0, 2.0, 3.0, nan], [True] * 4),
        ("s", "b"): columns([5.0, 5.0], [True] * 2, first=2),
    }
    success, error = paired_tests(laws, ["grasp_error"])
    assert (success.cases, error.cases, error.difference) == (2, 1, -2.0)
    assert np.isnan(success.p), "no case tells them apart"


def test_pairs_that_agree_are_left_out_of_wilcoxons_test() -> None:
    """Of 14 pairs 2 agree, 12 favour one law: p is that of 12 coins, 2^-11; it stays exact [Wilcoxon1945]."""
    base = np.linspace(1.0, 2.0, 14)
    for other, p in ((base, nan), (base + np.maximum(np.arange(14) - 1, 0), 2.0**-11)):
        pair = {("s", "a"): columns(list(base)), ("s", "b"): columns(list(other))}
        success, error = paired_tests(pair, ["grasp_error"])
        assert error.p == pytest.approx(p, nan_ok=True) and error.cases == 14
        assert np.isnan(success.p) and (error.difference == 0.0) == bool(np.isnan(p))


@pytest.mark.parametrize("cases", [5, 6, 7])
def test_too_few_pairs_for_any_finding_are_told(cases: int) -> None:
    """Of two tests the least adjusted p is 2 x 2^(1 - n): 0.06 of six pairs, which is none, 0.03 of seven."""
    pair = {
        ("s", "a"): columns(list(np.arange(cases)), [True] * cases),
        ("s", "b"): columns(list(np.arange(cases) + np.linspace(1.0, 2.0, cases)), [False] * cases),
    }
    tests = paired_tests(pair, ["grasp_error"])
    assert [test.adjusted for test in tests] == pytest.approx([2.0 ** (2 - cases)] * 2)
    note = note_on_tests(tests)
    assert ("From 7 cases on" in note) if cases < 7 else note == ""
    assert note_on_tests(()) == ""


def test_tables_say_of_how_many_cases_and_adjust_for_how_many_draws(tmp_path: Path) -> None:
    """Of six draws one matters; Holm's least p is six times what it was [Holm1979]."""
    rng = np.random.default_rng(4)
    drawn: dict[str, Any] = {f"x{k}": rng.normal(size=30) for k in range(6)}
    values = [*(drawn["x2"] + rng.normal(size=30))[:29], nan]
    campaign = read_campaign(written(tmp_path))
    found = {("smooth", "nmpc"): columns(values, **drawn)}
    (section,) = outcome_sections(campaign, found)
    labels = {row.label: row.cells for row in section.rows}
    assert labels["grasp_error [m]"] == ("of 29 cases",) and labels["cases"] == ("30",)
    ((head, table),) = sensitivity_sections(campaign, found)
    assert head[-1] == "p, Holm"
    p, adjusted = ([float(row.cells[place]) for row in table.rows] for place in (1, 2))
    assert 0.0 < p[2] < 0.01 and adjusted[2] == pytest.approx(6.0 * p[2], rel=1e-3) == min(adjusted)
    assert holm([0.01, nan, 0.04, 0.03]) == pytest.approx([0.03, nan, 0.06, 0.06], nan_ok=True)


@pytest.mark.parametrize("values", [[0.06, np.nextafter(0.06, 1.0)], [0.0, 0.0], [1.0, 2.0], [nan, 3.0]])
def test_values_that_hardly_differ_have_a_histogram_too(values: list[float], tmp_path: Path) -> None:
    plots = campaign_plots(read_campaign(written(tmp_path)), {("smooth", "nmpc"): columns(values)})
    (bars,) = next(plot for plot in plots if plot.key == "distribution-smooth").traces
    assert bars.y.sum() == np.isfinite(values).sum()


@pytest.mark.parametrize(
    ("cases", "share"), [(6, 0.5), (20, 0.5), (72, 0.05), (72, 0.95), (200, 0.95), (200, 0.5)]
)
def test_percentiles_have_intervals_that_cover(cases: int, share: float) -> None:
    """At least 95 % of all samples hold the true percentile, as the binomial distribution has it.

    Of 500 samples of a skewed distribution that is at least 0.93, two standard errors below.
    """
    rng, truth = np.random.default_rng(5), -np.log1p(-share)
    found = [percentile(rng.exponential(size=cases), share) for _ in range(500)]
    assert np.mean([one.low <= truth <= one.high for one in found]) > 0.93
    assert all(one.low <= one.value <= one.high for one in found)


def test_percentiles_have_no_interval_of_too_few_cases_and_a_narrow_one_of_many() -> None:
    """Of 4e5 normal draws the median has the half width 1.96 sqrt(pi / 2N)."""
    rng = np.random.default_rng(6)
    for cases, share in ((5, 0.5), (6, 0.95), (20, 0.95), (71, 0.95), (71, 0.05)):
        few = percentile(rng.normal(size=cases), share)
        assert few.known == cases and np.isnan(few.low) and np.isnan(few.high)
        assert cases < least_cases(share)
    many = percentile(rng.normal(size=400_000), 0.5)
    assert (many.high - many.low) / 2.0 == pytest.approx(1.96 * np.sqrt(pi / 8e5), rel=0.1)
    assert np.isnan(percentile(np.array([nan]), 0.5).value)
    alone = percentile(np.array([2.0, 2.0, nan]), 0.5)
    assert (alone.value, alone.known) == (2.0, 2) and np.isnan(alone.low)
    assert percentile(np.zeros(6), 0.5) == (0.0, 0.0, 0.0, 6), "as good as of values that differ"


def test_of_what_no_case_has_there_is_no_table_and_no_plot(tmp_path: Path) -> None:
    """As where every case failed; one case has no sensitivity, two laws without metrics have no p value."""
    campaign = read_campaign(written(tmp_path, laws=["nmpc", "pid"]))
    failed = {("smooth", law): columns([nan] * 3, [False] * 3, x=np.arange(3.0)) for law in campaign.laws}
    for law in failed.values():
        law.metrics["base_turn"] = np.full(3, nan)  # type: ignore[index]
    (section,) = outcome_sections(campaign, failed)
    labels = {row.label: row.cells for row in section.rows}
    assert labels["grasp_error [m]"] == ("of 0 cases",) * 2 and "  median" not in labels
    assert labels["success, 95 % interval"] == ("0.0 % [0.0, 56.1]",) * 2
    assert [plot.key for plot in campaign_plots(campaign, failed)] == ["convergence-smooth"]
    tests = paired_tests(failed, ["grasp_error"])
    assert np.isnan([test.p for test in tests]).all() and note_on_tests(tests) == ""
    one = {("smooth", "nmpc"): columns([1.0], x=np.array([2.0]))}
    assert sensitivity_sections(campaign, failed) == sensitivity_sections(campaign, one) == ()
    (section,) = outcome_sections(campaign, {})
    assert [row.label for row in section.rows][-1] == "numeric failures" and not campaign_plots(campaign, {})


def test_the_command_of_a_case_is_one_for_a_shell() -> None:
    command = rerun_command("-my runs/a", Task(3, "s", "my law"), one_scenario=False)
    words = ["sms-handover", "campaign", "rerun", "./-my runs/a", "3", "--law", "my law", "--scenario", "s"]
    assert shlex.split(command) == words


def test_the_pareto_front_is_what_nothing_is_better_than() -> None:
    costs = np.array(
        [[1, 5], [2, 3], [2, 4], [4, 1], [4, 1], [5, 0.5], [6, 6], [nan, 0], [1, 6]], dtype=float
    )
    expected = [
        not np.isnan(row).any()
        and not any(
            (other <= row).all() and (other < row).any() for other in costs if not np.isnan(other).any()
        )
        for row in costs
    ]
    assert pareto_front(costs).tolist() == expected
    assert sum(expected) == 5


def campaign_of(folder: Path, sampler: object) -> Campaign:
    """Return a campaign with three uniform draws in [-pi, pi], as Ishigami's function takes."""
    draws = {path: {"uniform": {"low": -pi, "high": pi}} for path in PATHS}
    return read_campaign(written(folder, sampler=sampler, cases=None, draws=draws))


def ishigami(campaign: Campaign) -> CaseColumns:
    """Return Ishigami's function of every case, a = 7, b = 0.1."""
    samples = Samples(campaign)
    drawn = [[float(value) for value in samples.inputs(case).values()] for case in range(samples.count)]
    values = [sin(x) + 7.0 * sin(y) ** 2 + 0.1 * z**4 * sin(x) for x, y, z in drawn]
    return columns(values, **dict(zip(PATHS, np.array(drawn).T, strict=True)))


def test_sobol_indices_of_ishigami_are_within_their_intervals(tmp_path: Path) -> None:
    """S = 0.3139, 0.4424, 0 and S_T = 0.5576, 0.4424, 0.2437 [Saltelli2010]."""
    campaign = campaign_of(tmp_path, {"saltelli": {"base": 1024}})
    found = sensitivities(campaign, ishigami(campaign), "grasp_error")
    for one, first, total in zip(found, (0.3139, 0.4424, 0.0), (0.5576, 0.4424, 0.2437), strict=True):
        assert one.kind == "sobol" and abs(one.first - first) < one.first_half < 0.12
        assert abs(one.second - total) < one.second_half < 0.12


def test_morris_finds_what_matters(tmp_path: Path) -> None:
    campaign = campaign_of(tmp_path, {"morris": {"trajectories": 8}})
    samples = Samples(campaign)
    drawn = np.array([list(samples.shares(case).values()) for case in range(samples.count)])
    linear = columns(list(3.0 * drawn[:, 0] - drawn[:, 1]), **dict(zip(PATHS, drawn.T, strict=True)))
    found = sensitivities(campaign, linear, "grasp_error")
    effects = [one.first for one in found]
    assert effects == pytest.approx([3.0, 1.0, 0.0]) and found[0].second == pytest.approx(0.0, abs=1e-9)


def test_a_failed_case_leaves_the_correlation(tmp_path: Path) -> None:
    campaign = campaign_of(tmp_path, {"saltelli": {"base": 16}})
    values = ishigami(campaign)
    values.metrics["grasp_error"][3] = nan
    assert {one.kind for one in sensitivities(campaign, values, "grasp_error")} == {DESIGNED}
    ((head, table),) = sensitivity_sections(campaign, {("smooth", "nmpc"): values})
    assert head == ("Spearman's rho",), "the rows of a design have no p value"
    assert all(len(row.cells) == 1 for row in table.rows)
    drawn = np.linspace(0.0, 1.0, 20)
    independent = read_campaign(written(tmp_path))
    (one,) = sensitivities(independent, columns(list(drawn**3), x=drawn), "grasp_error")
    assert one.kind == CORRELATION and one.first == pytest.approx(1.0) and one.second < 1e-6


@pytest.mark.parametrize(
    ("sampler", "cases"),
    [
        *(("lhs", 8), ("sobol", 8), ({"grid": {"levels": 8}}, 8)),
        *(({"morris": {"trajectories": 8}}, 16), ({"saltelli": {"base": 64}}, 192)),
    ],
)
def test_one_draw_has_a_design_and_a_sensitivity(sampler: object, cases: int, tmp_path: Path) -> None:
    """Of the draw itself as metric the effect of one draw is all there is: 2 pi per unit of probability."""
    draws = {PATHS[0]: {"uniform": {"low": -pi, "high": pi}}}
    campaign = read_campaign(
        written(tmp_path, sampler=sampler, cases=8 if isinstance(sampler, str) else None, draws=draws)
    )
    samples = Samples(campaign)
    drawn = [float(samples.inputs(case)[PATHS[0]]) for case in range(samples.count)]
    assert len(drawn) == cases and -pi < min(drawn) < max(drawn) < pi
    given: dict[str, Any] = {PATHS[0]: drawn}
    found = columns(drawn, **given)
    (one,) = sensitivities(campaign, found, "grasp_error")
    assert one.first == pytest.approx(2.0 * pi if one.kind == "morris" else 1.0, rel=0.05)
    note = note_on_sampler(campaign.sampler.kind)
    assert ("not independent" in note) == (one.kind != CORRELATION)
    assert ("usually too wide" in note) == (one.kind == CORRELATION)
