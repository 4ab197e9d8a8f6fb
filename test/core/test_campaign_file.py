"""Campaign files, distributions, samplers and success expressions."""

from math import isnan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from sms_handover.campaign.definition.campaign_file import read_campaign
from sms_handover.campaign.definition.distributions import (
    Choice,
    Distribution,
    Integers,
    Normal,
    Truncated,
    Uniform,
    correlated,
)
from sms_handover.campaign.definition.frozen import freeze, read_frozen
from sms_handover.campaign.definition.success_expression import success_expression
from sms_handover.campaign.sampling.samples import Samples
from sms_handover.campaign.sampling.streams import run_seed
from sms_handover.errors import ConfigurationError

from .campaigns import MASS, written

X = "deputy.in_world.xyz[0]"
UNIFORM = {"uniform": {"low": -1.0, "high": 2.0}}
TWO = {MASS: {"normal": {"mean": 240, "std": 12}}, X: UNIFORM}


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"cases": 0}, "campaign.yaml:3: cases is 0, must be >= 1"),
        ({"case": 3}, "campaign.yaml:16: unknown key 'case' (did you mean 'cases'?)"),
        ({"name": "a/b"}, "campaign.yaml:1: name is 'a/b', must be 1 to 64 letters"),
        ({"laws": ["pdi"]}, "campaign.yaml:6: laws: unknown control law 'pdi' (did you mean 'pid'?)"),
        (
            {"draws": {MASS: {"normal": {"mean": 1, "std": -1}}}},
            "draws.truth.robot.base.mass.normal.std is -1",
        ),
        ({"draws": {MASS: {"uniform": {"low": 2, "high": 1}}}}, "low is 2, must be <= high, which is 1"),
        ({"draws": {MASS: {}}}, "must have exactly one of normal, truncated, uniform, integers, choice"),
        ({"sampler": "sobl"}, "unknown sampler 'sobl' (did you mean 'sobol'?)"),
        ({"sampler": {"grid": {"levels": 3}}}, "sampler grid has its own number of cases: leave cases out"),
        ({"sampler": {"saltelli": {"base": 12}}, "cases": None}, "base is 12, must be a power of two"),
        ({"success": "complete and"}, "success 'complete and' is not an expression over metrics"),
        ({"success": "__import__('os')"}, "is not allowed: see docs/campaigns.md for what is"),
        ({"stop": {"half_width": 0.1, "looks": [5, 2]}}, "stop.looks must be whole numbers that rise"),
        ({"stop": {"half_width": 0.1, "looks": [2.5, 5]}}, "stop.looks must be whole numbers that rise"),
        ({"keep": {"worst": 1, "worst_as": "bags"}}, "unknown choice 'bags' (did you mean 'bag'?)"),
        ({"keep": {"worst_as": "bag"}}, "keep.worst_as is for the cases of keep.worst, which is 0: give it"),
        ({"correlated": [{"draws": {MASS: {"mean": 1, "std": 1}}, "correlation": [[1]]}]}, "is drawn twice"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(changes: dict[str, Any], told: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError) as error:
        read_campaign(written(tmp_path, **changes))
    assert told in str(error.value) and "campaign.yaml" in str(error.value)


QUANTILES: list[tuple[Distribution, Any]] = [
    (Normal(3.0, 2.0), stats.norm(3.0, 2.0)),
    (Truncated(3.0, 2.0, 2.0, 4.5), stats.truncnorm(-0.5, 0.75, 3.0, 2.0)),
    (Uniform(-1.0, 3.0), stats.uniform(-1.0, 4.0)),
    (Integers(-2, 5), stats.randint(-2, 6)),
]


@pytest.mark.parametrize(("ours", "theirs"), QUANTILES, ids=lambda item: type(item).__name__)
def test_quantiles_are_those_of_scipy(ours: Distribution, theirs: Any) -> None:
    shares = np.linspace(0.001, 0.999, 96)
    found = [float(ours.quantile(float(share))) for share in shares]
    np.testing.assert_allclose(found, theirs.ppf(shares), rtol=1e-9)


def test_a_choice_takes_values_by_their_weights() -> None:
    choice = Choice(("a", True, 3), (1.0, 0.0, 3.0))
    assert [choice.quantile(share) for share in (0.01, 0.24, 0.26, 1.0 - 1e-16)] == ["a", "a", 3, 3]


def test_correlated_draws_have_their_correlation() -> None:
    matrix = [[1.0, 0.8], [0.8, 1.0]]
    group = correlated({"a": Normal(1.0, 2.0), "b": Normal(0.0, 0.1)}, matrix)
    drawn = [group.values(list(shares)) for shares in np.random.default_rng(1).random((4000, 2))]
    a, b = (np.array([one[name] for one in drawn]) for name in "ab")
    assert np.corrcoef(a, b)[0, 1] == pytest.approx(0.8, abs=0.02)
    assert (a.mean(), a.std(), b.std()) == pytest.approx((1.0, 2.0, 0.1), rel=0.1)
    with pytest.raises(ConfigurationError, match="positive definite"):
        correlated({"a": Normal(1.0, 2.0), "b": Normal(0.0, 0.1)}, [[1.0, 2.0], [2.0, 1.0]])


def samples(folder: Path, **changes: Any) -> Samples:
    return Samples(read_campaign(written(folder, **changes)))


def test_neither_a_draw_nor_a_case_nor_a_law_moves_another_draw(tmp_path: Path) -> None:
    few = samples(tmp_path / "few", cases=3)
    more = samples(tmp_path / "more", cases=30, draws=dict(reversed(TWO.items())), laws=["pid"])
    for case in range(3):
        assert more.inputs(case)[MASS] == few.inputs(case)[MASS]
    every = [more.inputs(case) for case in range(30)]
    assert len({one[MASS] for one in every}) == len({one[X] for one in every}) == 30
    other = samples(tmp_path / "other", seed=4)
    assert not {other.inputs(case)[MASS] for case in range(4)} & {one[MASS] for one in every}
    assert len({run_seed(3, case) for case in range(30)} | {run_seed(4, case) for case in range(30)}) == 60


def test_random_draws_follow_their_distribution(tmp_path: Path) -> None:
    found = samples(tmp_path, draws=TWO)
    drawn = [found.inputs(case) for case in range(1500)]
    assert stats.kstest([one[MASS] for one in drawn], stats.norm(240, 12).cdf).pvalue > 0.01
    assert stats.kstest([one[X] for one in drawn], stats.uniform(-1, 3).cdf).pvalue > 0.01
    assert abs(stats.spearmanr([one[MASS] for one in drawn], [one[X] for one in drawn]).statistic) < 0.07


@pytest.mark.parametrize(
    ("sampler", "cases", "count"),
    [
        ("lhs", 10, 10),
        ("sobol", 16, 16),
        ({"grid": {"levels": 3}}, None, 9),
        ({"morris": {"trajectories": 5}}, None, 15),
        ({"saltelli": {"base": 8}}, None, 32),
    ],
    ids=str,
)
def test_designs_have_their_cases(sampler: Any, cases: int | None, count: int, tmp_path: Path) -> None:
    found = samples(tmp_path, sampler=sampler, cases=cases, draws=TWO)
    again = samples(tmp_path, sampler=sampler, cases=cases, draws=TWO)
    drawn = [found.inputs(case) for case in range(count)]
    assert found.count == count and drawn == [again.inputs(case) for case in range(count)]
    assert all(-1.0 <= float(one[X]) <= 2.0 and 180.0 < float(one[MASS]) < 300.0 for one in drawn)
    if sampler == "lhs":  # one case in each tenth
        assert sorted(int((float(one[X]) + 1.0) / 0.3) for one in drawn) == list(range(10))
    if sampler == "sobol":  # more cases leave those that are there
        more = samples(tmp_path / "more", sampler=sampler, cases=40, draws=TWO)
        assert [more.inputs(case) for case in range(count)] == drawn


def test_a_table_has_the_cases(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text(f"{MASS},law_of\n230,a\n250.5,true\n", encoding="utf-8")
    file = written(tmp_path, sampler={"list": {"file": "points.csv"}}, cases=None, draws=None)
    found = Samples(read_campaign(file))
    assert [found.inputs(case) for case in range(found.count)] == [
        {MASS: 230, "law_of": "a"},
        {MASS: 250.5, "law_of": True},
    ]
    frozen, number = freeze(file)
    (tmp_path / "points.csv").unlink()
    assert Samples(frozen.campaign(number)).inputs(1) == found.inputs(1)


def test_what_is_frozen_needs_no_other_file_and_no_number_of_cases(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("extends: smooth\nlaw: pid\n", encoding="utf-8")
    file = written(tmp_path, scenarios={"mine": {"scenario": "mine.yaml", "values": {"seed": 2}}})
    frozen, number = freeze(file)
    (tmp_path / "mine.yaml").unlink()
    frozen.unpacked(tmp_path / "there", number)
    assert read_frozen(tmp_path / "there").digest == frozen.digest and number == 4
    again, none = freeze(tmp_path / "there" / "campaign.yaml")  # what a folder has goes on by itself
    assert again.digest == frozen.digest and none is None
    (tmp_path / "mine.yaml").write_text("extends: smooth\nlaw: pid\n", encoding="utf-8")
    same = freeze(
        written(tmp_path, scenarios={"mine": {"scenario": "mine.yaml", "values": {"seed": 2}}}, cases=9)
    )
    other = freeze(written(tmp_path, scenarios={"mine": {"scenario": "mine.yaml", "values": {"seed": 3}}}))
    assert same[0].digest == frozen.digest != other[0].digest


METRICS = {"a": 2.0, "b.c": -1.0, "none": None, "odd name": 0.5}


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("a > 1 and b.c < 0", True),
        ("1 < a <= 2", True),
        ("not a == 2 or abs(b.c) * 3 - 1 == a", True),
        ("min(a, b.c, 5) == -1 and max(a, 1) / 2 == 1", True),
        ("'odd name' < 1", True),
        ("true and not false", True),
        ("none < 1", False),
        ("none != 1 or 1 != none", False),
        ("not none < 1", False),
        ("not (a < 1 or none > 1)", False),
        ("not (a < 1 and none > 1)", True),
        ("none > 1 or a == 2", True),
        ("none > 1 and a == 2", False),
        ("not none", False),
        ("none", False),
        ("max(1, none) > 0", False),
        ("a / 0 > 1", False),
    ],
)
def test_an_expression_is_judged(text: str, holds: bool) -> None:
    assert success_expression(text).holds(METRICS) is holds


@pytest.mark.parametrize(
    "text",
    [
        "().__class__",
        "a.__class__()",
        "[a for a in b]",
        "lambda: 1",
        "a if b else c",
        "open('x')",
        "a[0]",
        "f'{a}'",
        "a ** 9 ** 9 ** 9",
        "(b := a)",
        "min(a)",
        "abs(x=1)",
        "1j",
        "(" * 400 + "1" + ")" * 400,
        "x" * 2000,
        "",
    ],
)
def test_anything_else_is_no_expression(text: str) -> None:
    with pytest.raises(ConfigurationError, match="success"):
        success_expression(text)


@settings(max_examples=200, deadline=None)
@given(st.text(alphabet="ab.()<>=!+-*/ '0123456789andortmix,", max_size=30))
def test_no_text_does_anything_but_be_judged_or_rejected(text: str) -> None:
    try:
        found = success_expression(text)
    except ConfigurationError:
        return
    found.holds(dict.fromkeys(found.names, 1.0))


def test_metrics_of_an_expression_must_be_known() -> None:
    assert success_expression("a and b.c > a").names == ("a", "b.c")
    with pytest.raises(ConfigurationError, match=r"unknown metric 'b.d' \(did you mean 'b.c'\?\)"):
        success_expression("a < b.d").require_known(dict.fromkeys(METRICS))
    assert isnan(success_expression("none").tree.of(METRICS))
