"""Campaign files, distributions and samplers."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from sms_handover.campaign.cases.case import Cases
from sms_handover.campaign.cases.case_row import Task
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
from sms_handover.campaign.definition.named_files import located
from sms_handover.campaign.sampling.samples import Samples
from sms_handover.campaign.sampling.streams import run_seed
from sms_handover.configuration.conditions_content import read_conditions_content
from sms_handover.configuration.documents import as_yaml
from sms_handover.errors import ConfigurationError

from .campaigns import MASS, written

X = "deputy.in_world.xyz[0]"
UNIFORM = {"uniform": {"low": -1.0, "high": 2.0}}
TWO = {MASS: {"normal": {"mean": 240, "std": 12}}, X: UNIFORM}
SHORT, LONG = {"common.tick": 0.002}, {"common.tick": 0.004}
ANY = {"mean": 1, "std": 1}
HEAVY = {"deputy.mass": UNIFORM}
GRID_CASES = "campaign.yaml:19: sampler grid has 400000000 cases, must be <= 100000000"


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
        ({"stop": {"half_width": 0.1, "looks": [5, 2]}}, "stop.looks is [5, 2], must be whole numbers that"),
        ({"stop": {"half_width": 0.1, "looks": [2.5, 5]}}, "stop.looks is [2.5, 5], must be whole numbers"),
        (
            {"stop": {"half_width": 0.1, "looks": [2]}, "sampler": "lhs"},
            "campaign.yaml:16: stop is for the samplers random and sobol, not for lhs",
        ),
        ({"laws": ["nmpc", "nmpc"]}, "campaign.yaml:6: laws is ['nmpc', 'nmpc'], must be one or more of"),
        ({"metrics": "x"}, "campaign.yaml:16: metrics is 'x', must be a list of texts"),
        (
            {"draws": {MASS: {"choice": {"values": 3}}}},
            "choice.values is 3, must be a list of numbers",
        ),
        ({"draws": {MASS: {"choice": {"values": [3], "weights": [0]}}}}, "are [0.0], must have a sum > 0"),
        ({"correlated": [{"draws": {X: ANY}, "correlation": [[1, 2]]}]}, "is [[1, 2]], must be 1 lists of 1"),
        ({"sampler": {"grid": {"levels": 20_000}}, "cases": None, "draws": TWO}, GRID_CASES),
        (
            {"values": {"common.duration": 1, "seed": 5}},
            "campaign.yaml:10: seed is set by the campaign",
        ),
        (
            {"values": {"common": {"seed": 5}}},
            "common.seed is set by the campaign itself: give 'seed' of",
        ),
        ({"scenarios": {"a": {"scenario": "smooth", "values": {"law": "pid"}}}}, "give the list 'laws'"),
        (
            {"draws": {"controller.law": {"choice": {"values": ["pid"]}}}},
            "campaign.yaml:11: controller.law is",
        ),
        (
            {"correlated": [{"draws": {"seed": ANY}, "correlation": [[1]]}]},
            "seed is set by the campaign",
        ),
        ({"values": {"common": {"scenario": "paper"}}}, "give 'scenarios' of the campaign"),
        ({"values": {"common.tick": 1, "common": {"tick": 2}}}, "common.tick is given twice"),
        (
            {"values": {"truth": {"robot": {"arms": [{"description": "a.yaml"}]}}}},
            "truth.robot.arms[0].description names the file 'a.yaml', which a campaign cannot keep",
        ),
        ({"keep": {"worst": 1, "worst_as": "bags"}}, "unknown choice 'bags' (did you mean 'bag'?)"),
        ({"keep": {"worst_as": "bag"}}, "keep.worst_as is for the cases of keep.worst, which is 0: give it"),
        (
            {"correlated": [{"draws": {MASS: {"mean": 1, "std": 1}}, "correlation": [[1]]}]},
            f"campaign.yaml:18: {MASS} is set twice: {MASS} is drawn too",
        ),
        ({"values": {MASS: 9}}, f"campaign.yaml:11: {MASS} is set twice: {MASS} is among values too"),
        (
            {
                "scenarios": {"a": {"scenario": "smooth", "values": {"truth.deputy": {"mass": 9}}}},
                "draws": HEAVY,
            },
            "deputy.mass is set twice: truth.deputy.mass is among values too",
        ),
        ({"draws": {**HEAVY, "truth.deputy.mass": UNIFORM}}, "is set twice: truth.deputy.mass is drawn too"),
        ({"draws": {**HEAVY, "schedule.deputy.mass": UNIFORM}}, "is set twice: deputy.mass is drawn too"),
        (
            {"draws": {"robot.arms.0.gripper.mass": UNIFORM, "robot.arms[0].gripper.mass": UNIFORM}},
            "set twice",
        ),
        ({"draws": {"source": UNIFORM, "common.source": UNIFORM}}, "common.source is set twice: source is"),
        (
            {"draws": {"common.mode": {"choice": {"values": ["realtime"]}}}},
            "campaign.yaml:11: common.mode has no effect in a campaign",
        ),
        ({"values": {"common": {"cpu": 1}}}, "campaign.yaml:9: common.cpu has no effect in a campaign"),
        ({"values": {"common.duration": float("nan")}}, "campaign.yaml:9: common.duration is nan s, must be"),
        (
            {"draws": {"plant.grasp_position_tolerance": {"choice": {"values": [0.004, "0.004", True]}}}},
            "campaign.yaml:13: plant.grasp_position_tolerance is '0.004', must be a number in m",
        ),
        (
            {"draws": {X: {"choice": {"values": [4, True]}}}},
            f"campaign.yaml:13: {X} is True, must be a number in m",
        ),
        (
            {"name": "-j"},
            "campaign.yaml:1: name is '-j', must be 1 to 64 letters, digits, _ or -, not beginning",
        ),
        ({"scenarios": {"-x": "smooth"}}, "campaign.yaml:5: scenario name '-x' must be 1 to 64 letters"),
        ({"laws": ["a/b"]}, "campaign.yaml:6: law 'a/b' cannot be in a campaign, which names files by it"),
        ({"success": 5}, "campaign.yaml:15: success is 5, must be text"),
        (
            {"sampler": {"morris": {"trajectories": 2, "levels": 1_000_000_000}}, "cases": None},
            "sampler.morris.levels is 1000000000, must be >= 2 and <= 100",
        ),
        (
            {"sampler": {"morris": {"trajectories": 100_000}}, "cases": None},
            "trajectories is 100000, must be >= 2 and <= 10000",
        ),
    ],
)
def test_what_is_wrong_is_told_with_its_line(changes: dict[str, Any], told: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError) as error:
        read_campaign(written(tmp_path, **changes))
    assert told in str(error.value) and str(error.value).count("campaign.yaml") == 1


def test_files_of_cases_have_different_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sms_handover.campaign.definition.campaign_file.require_law", lambda *names: None)
    changes = {"scenarios": {"a": "smooth", "a_b": "smooth"}, "laws": ["b_c", "c"]}
    with pytest.raises(ConfigurationError, match=r"'a_b' with law 'c' would have the files of scenario 'a' "):
        read_campaign(written(tmp_path, **changes))


QUANTILES: list[tuple[Distribution, Any]] = [
    (Normal(3.0, 2.0), stats.norm(3.0, 2.0)),
    (Truncated(3.0, 2.0, 2.0, 4.5), stats.truncnorm(-0.5, 0.75, 3.0, 2.0)),
    (Truncated(1.0, 2.0, 17.0, 19.0), stats.truncnorm(8.0, 9.0, 1.0, 2.0)),
    (Truncated(1.0, 2.0, -71.0, -39.0), stats.truncnorm(-36.0, -20.0, 1.0, 2.0)),
    (Uniform(-1.0, 3.0), stats.uniform(-1.0, 4.0)),
    (Integers(-2, 5), stats.randint(-2, 6)),
]


@pytest.mark.parametrize(("ours", "theirs"), QUANTILES, ids=lambda item: type(item).__name__)
def test_quantiles_are_those_of_scipy(ours: Distribution, theirs: Any) -> None:
    shares = np.linspace(0.001, 0.999, 96)
    found = [float(ours.quantile(float(share))) for share in shares]
    np.testing.assert_allclose(found, theirs.ppf(shares), rtol=1e-9)


def test_bounds_that_no_draw_is_within_are_rejected() -> None:
    with pytest.raises(ConfigurationError, match=r"bounds are \[40, 41\], .* probability >= 1e-300"):
        Truncated(0.0, 1.0, 40.0, 41.0)


def test_a_choice_takes_values_by_their_weights() -> None:
    choice = Choice(("a", True, 3), (1.0, 0.0, 3.0))
    assert [choice.quantile(share) for share in (0.01, 0.24, 0.26, 1.0 - 1e-16)] == ["a", "a", 3, 3]
    assert choice.options == ("a", 3), "a grid has what is drawn"


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
    if sampler == "sobol" or "saltelli" in sampler:  # in the middles of cells: a corner is an infinite draw
        assert set(found.design.ravel() * 2.0**30 % 1.0) == {0.5}
    if "grid" in sampler:
        assert [one[X] for one in drawn] == [-0.5, 0.5, 1.5] * 3
        assert [one[MASS] for one in drawn[2:4]] == [drawn[0][MASS], 240.0]
    if sampler == "sobol":  # more cases leave those that are there
        more = samples(tmp_path / "more", sampler=sampler, cases=40, draws=TWO)
        assert [more.inputs(case) for case in range(count)] == drawn


def test_a_table_has_the_cases(tmp_path: Path) -> None:
    text = f'\ufeff{MASS}, law_of\r230, "a, b"\r250.5,true\r'  # as spreadsheets write it
    (tmp_path / "points.csv").write_text(text, encoding="utf-8")
    file = written(tmp_path, sampler={"list": {"file": "points.csv"}}, cases=None, draws=None)
    found = Samples(read_campaign(file))
    assert [found.inputs(case) for case in range(found.count)] == [
        {MASS: 230, "law_of": "a, b"},
        {MASS: 250.5, "law_of": True},
    ]
    frozen, number = freeze(file)
    (tmp_path / "points.csv").unlink()
    assert Samples(frozen.campaign(number)).inputs(1) == found.inputs(1)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (f"{MASS}\n230\n\n\n.nan\n", f"t.csv:5: {MASS} is .nan, must be finite"),
        (f"{MASS},x\n230,'a\n b'\n231,\n", "t.csv:4: has 2 cells, must have 2")
        if False
        else (f'{MASS},x\n230,"a\n b"\n231,\n', "t.csv:4: x is empty, must be a value"),
        (f"{MASS}\n{{a: 1}}\n", "is '{a: 1}', must be a number, a text, true or false"),
        ("x\n2026-11-30\n", "t.csv:2: x is '2026-11-30', must be a number"),
        ("x\nnull\n", "t.csv:2: x is 'null', must be a number"),
        (f"{MASS}\n230\nheavy\n", f"t.csv:3: {MASS} is 'heavy', must be a number in kg"),
        (f"{MASS}\n230,1\n", "t.csv:2: has 2 cells, must have 1"),
        (f"x\n{'1' * 140_000}\n", "t.csv:2: field larger than field limit"),
        (f"{MASS},{MASS}\n1,2\n", f"t.csv:1: column {MASS} is given twice"),
        (f"{MASS}\n", "t.csv:1: has no row of a case below the header"),
        ("deputy.mass,truth.deputy.mass\n1,2\n", "deputy.mass is set twice: truth.deputy.mass is drawn too"),
    ],
)
def test_a_bad_cell_is_told_with_line_and_column(text: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError) as error:
        read_campaign(written(tmp_path, sampler={"list": {"file": "t.csv"}}, cases=None, draws=None))
    assert told in str(error.value) and str(error.value).count("campaign.yaml:") == 1


def test_what_is_frozen_needs_no_other_file_and_no_number_of_cases(tmp_path: Path) -> None:
    mesh = "robot: {clearance: {shapes: {base_link: [{mesh: {file: base.stl}}]}}}\n"
    (tmp_path / "mine.yaml").write_text(f"extends: smooth\nlaw: pid\n{mesh}", encoding="utf-8")
    (tmp_path / "base.stl").write_text("solid", encoding="utf-8")
    file = written(tmp_path, scenarios={"mine": {"scenario": "mine.yaml", "values": SHORT}})
    frozen, number = freeze(file)
    (tmp_path / "mine.yaml").unlink()
    frozen.unpacked(tmp_path / "there", number)
    for folder in ("scenarios", "conditions"):  # what an editor leaves there
        (tmp_path / "there" / folder).mkdir(exist_ok=True)
        (tmp_path / "there" / folder / "mine (copy).yaml").write_text("x: 1", encoding="utf-8")
    assert read_frozen(tmp_path / "there").digest == frozen.digest and number == 4
    again, none = freeze(tmp_path / "there" / "campaign.yaml")  # what a folder has goes on by itself
    assert again.digest == frozen.digest and none is None
    (tmp_path / "there" / "scenarios" / "mine.yaml").unlink()
    with pytest.raises(ConfigurationError, match=r"names scenarios/mine\.yaml, which is not there"):
        read_frozen(tmp_path / "there")
    (tmp_path / "mine.yaml").write_text(f"extends: smooth\nlaw: pid\n{mesh}", encoding="utf-8")
    same = freeze(written(tmp_path, scenarios={"mine": {"scenario": "mine.yaml", "values": SHORT}}, cases=9))
    other = freeze(written(tmp_path, scenarios={"mine": {"scenario": "mine.yaml", "values": LONG}}))
    assert same[0].digest == frozen.digest != other[0].digest
    (tmp_path / "base.stl").write_text("another solid", encoding="utf-8")  # which stays where it is
    assert freeze(file)[0].files["meshes.yaml"] != frozen.files["meshes.yaml"]


def test_files_that_values_name_are_frozen_by_their_content(tmp_path: Path) -> None:
    """Shipped ones too, which another version of the package may change; of these rows have the name."""
    ours = as_yaml(read_conditions_content(Path("nominal")))
    (tmp_path / "mine.yaml").write_text(ours, encoding="utf-8")
    (tmp_path / "schedule.yaml").write_text("# as it was written\nphases: []\n", encoding="utf-8")
    drawn = {"choice": {"values": ["nominal", "./mine.yaml"]}}
    file = written(
        tmp_path,
        values={"common": {"schedule": "schedule.yaml"}, "common.robot": ""},
        draws={"common.conditions": drawn},
        scenarios={"a": "smooth"},
    )
    frozen, number = freeze(file)
    assert {name for name in frozen.files if not name.startswith("scenarios")} == {
        *("campaign.yaml", "schedules/schedule.yaml"),
        *("conditions/nominal.yaml", "conditions/mine.yaml"),
    }
    own = {"scenario": "smooth", "values": {"common.conditions": "harsh"}}
    fixed = {"values": {"common": {"conditions": "./mine.yaml"}}, "scenarios": {"a": own}}
    freeze(written(tmp_path / "fixed", **{**fixed, "values": {"common.conditions": "../mine.yaml"}}))[
        0
    ].unpacked(tmp_path / "fixed" / "there")
    assert {name for name in read_frozen(tmp_path / "fixed" / "there").files if "conditions" in name} == {
        *("conditions/harsh.yaml", "conditions/mine.yaml")
    }
    assert frozen.files["conditions/nominal.yaml"] == frozen.files["conditions/mine.yaml"] == ours
    changed = ours.replace("rotor_inertia: 0.", "rotor_inertia: 1.")
    (tmp_path / "mine.yaml").write_text(changed, encoding="utf-8")
    assert freeze(file)[0].digest != frozen.digest
    frozen.unpacked(tmp_path / "there", number)
    assert read_frozen(tmp_path / "there").digest == frozen.digest
    assert freeze(tmp_path / "there" / "campaign.yaml")[0].digest == frozen.digest
    cases = Cases(frozen, number, tmp_path / "there")
    values = [cases.values(Task(case, "a", "nmpc")) for case in range(4)]
    assert {one["common.conditions"] for one in values} == {
        str(tmp_path / "there" / "conditions" / name) for name in ("nominal.yaml", "mine.yaml")
    }
    assert values[0]["common.schedule"] == str(tmp_path / "there/schedules/schedule.yaml")
    assert {cases.samples.inputs(case)["common.conditions"] for case in range(4)} == {
        *("nominal", "conditions/mine.yaml")
    }
    (tmp_path / "there/conditions/nominal.yaml").unlink()  # as in folders of before
    assert located({"common.conditions": "nominal"}, tmp_path / "there") == {"common.conditions": "nominal"}


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"values": {"common.conditions": "no.yaml"}}, "campaign.yaml:9: cannot read"),
        (
            {"values": {"common.conditions": "nominl"}},
            "unknown conditions 'nominl' (did you mean 'nominal'?)",
        ),
        (
            {"sampler": {"list": {"file": "t.csv"}}, "cases": None, "draws": None},
            "common.conditions is 'x.yaml': a table names no files but shipped conditions, harsh, ideal,",
        ),
    ],
)
def test_a_file_that_cannot_be_frozen_is_told(changes: dict[str, Any], told: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("common.conditions\nnominal\nx.yaml\n", encoding="utf-8")
    with pytest.raises(ConfigurationError) as error:
        freeze(written(tmp_path, **changes))
    assert told in str(error.value) and "campaign.yaml" in str(error.value)
