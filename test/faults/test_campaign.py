"""The campaign notices every way to break a promise; a real fault is tried in each run of the tests."""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from . import command, leftovers, runner
from .attempt import attempt, read_outcome, write_outcome
from .command import EXIT_BROKEN, EXIT_OK, EXIT_USAGE, main
from .discover import chosen, families, sample
from .fault import Family, Fault
from .leftovers import MARK, end_all, of_trial
from .outcome import NOTHING_LOST, CannotTry, Kept, Loss, Outcome, Status, require
from .page import page
from .runner import Job, run_one
from .trial import Trial

pytestmark = pytest.mark.system

SAMPLE = "messages/good-on-joint-command"  # of the other families test/system has one each
SEED = 3

Check = Callable[[Trial, None], Kept]
Told = Callable[[Outcome], None]


def nothing(trial: Trial) -> None:
    """Inject nothing."""


def fault(check: Check) -> Fault[None]:
    return Fault("made", "nothing", "nothing", nothing, check)


@pytest.fixture
def mark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Mark what this test starts; nobody is waited for, so that an orphan is found at once."""
    monkeypatch.setenv(MARK, tmp_path.name)
    monkeypatch.setattr(leftovers, "GRACE_S", 0.0)
    return tmp_path.name


def outcome_of(check: Check, folder: Path) -> Outcome:
    return attempt(fault(check), "family", SEED, folder)


def breaks(trial: Trial, seen: None) -> Kept:
    require(1 > 2, "one is less")
    return Kept()


def asserts(trial: Trial, seen: None) -> Kept:
    assert trial.domain < 0, "it is positive"
    return Kept()


def fails(trial: Trial, seen: None) -> Kept:
    raise OSError("no such thing")


def hangs(trial: Trial, seen: None) -> Kept:
    trial.command(["sleep", "60"], timeout_s=0.1)
    return Kept()


def leaves_a_process(trial: Trial, seen: None) -> Kept:
    begun = 'until [ "$(cat /proc/$!/comm)" = sleep ]; do :; done'
    trial.command(["sh", "-c", f"setsid sleep 61 >/dev/null 2>&1 & {begun}"])
    return Kept()


@pytest.mark.parametrize(
    ("check", "reason"),
    [
        (breaks, "one is less"),
        (asserts, "it is positive"),
        (fails, "OSError: no such thing"),
        (hangs, "sleep hung for 0.1 s"),
        (leaves_a_process, "sleep 61"),
    ],
)
def test_a_broken_promise_is_noticed(check: Check, reason: str, tmp_path: Path, mark: str) -> None:
    try:
        outcome = outcome_of(check, tmp_path)
    finally:
        end_all(of_trial(mark, without=os.getpid()))
    assert outcome.status is Status.BROKEN
    assert reason in outcome.reason
    assert not of_trial(mark, without=os.getpid())


def test_what_cannot_be_tried_is_neither_kept_nor_broken(tmp_path: Path, mark: str) -> None:
    def check(trial: Trial, seen: None) -> Kept:
        raise CannotTry("not root")

    outcome = outcome_of(check, tmp_path)
    assert (outcome.status, outcome.reason) == (Status.NOT_TRIED, "not root")


def test_an_outcome_survives_its_file(tmp_path: Path, mark: str) -> None:
    kept = Kept(3, Loss(2, 1.5), "a note")
    outcome = outcome_of(lambda trial, seen: kept, tmp_path)
    assert (outcome.status, outcome.exit_code, outcome.lost, outcome.note) == (
        Status.KEPT,
        3,
        Loss(2, 1.5),
        "a note",
    )
    write_outcome(outcome, tmp_path)
    assert read_outcome(tmp_path) == outcome
    assert read_outcome(tmp_path / "nowhere") is None


def test_the_seed_and_the_name_decide_what_is_random(tmp_path: Path, mark: str) -> None:
    drawn: list[float] = []

    def draw(trial: Trial, seen: None) -> Kept:
        drawn.append(trial.random.random())
        return Kept()

    made = fault(draw)
    for name, seed in ((made.name, 1), (made.name, 1), (made.name, 2), ("other", 1)):
        attempt(replace(made, name=name), "family", seed, tmp_path)
    assert drawn[0] == drawn[1]
    assert len(set(drawn)) == 3


def test_an_attempt_that_does_not_end_is_ended_and_nothing_of_it_is_left(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(runner, "token_hex", lambda size: tmp_path.name)
    ((family, slow),) = chosen(families(), (), ("processes/plant-killed",))
    outcome = run_one(family, replace(slow, timeout_s=0.5), SEED)
    assert outcome.status is Status.BROKEN
    assert "not at an end after 0.5 s" in outcome.reason
    assert not of_trial(tmp_path.name)


def test_the_page_shows_what_came_of_each() -> None:
    family = Family("made", "Made up", (fault(breaks), replace(fault(breaks), name="other")))
    outcomes = [
        Outcome("made/made", Status.KEPT, exit_code=1, lost=NOTHING_LOST),
        Outcome("made/other", Status.BROKEN, "it | did not", lost=Loss(ms=45.0)),
    ]
    text = page([family], outcomes, SEED)
    assert "**2 faults: 1 promises kept, 1 broken, 0 could not be tried on this machine.**" in text
    assert "| `made` | nothing | nothing | yes | nothing | 1 |" in text
    assert "| `other` | nothing | nothing | **NO**: it \\| did not | 45 ms | - |" in text


def test_a_campaign_goes_on_after_what_was_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tried: list[str] = []

    def run_all(jobs: Sequence[Job], seed: int, parallel: int, folder: object, told: Told) -> None:
        for family, made in jobs:
            tried.append(f"{family.name}/{made.name}")
            status = Status.KEPT if len(tried) != 2 else Status.BROKEN
            told(Outcome(tried[-1], status))

    monkeypatch.setattr(command, "run_all", run_all)
    arguments = ["--only", "processes/*-killed", "--resume", str(tmp_path / "outcomes")]
    assert main(arguments) == EXIT_BROKEN
    broken, everything = tried[1], len(tried)
    assert main(arguments) == EXIT_OK
    assert tried[everything:] == [broken]
    assert f"{everything} kept, 0 BROKEN" in capsys.readouterr().out
    assert main([*arguments, "--seed", "1"]) == EXIT_OK
    assert len(tried) == 2 * everything + 1


def test_wrong_names_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--list", "--family", "dsik"]) == EXIT_USAGE
    assert main(["--list", "--only", "processes/no-such"]) == EXIT_USAGE
    assert capsys.readouterr().err.count("error:") == 2


def test_every_table_is_well_formed() -> None:
    names = [fault.name for family in families() for fault in family.faults]
    assert len(names) > 5
    assert [name for name in names if name != name.lower() or " " in name] == []


def test_a_sample_has_a_fault_of_each_family_and_another_seed_another_one() -> None:
    samples = [sample(chosen(families(), (), ()), seed) for seed in (1, 1, 2)]
    assert [family for family, _ in samples[0]] == list(families())
    assert samples[0] == samples[1] != samples[2]


@pytest.mark.slow
def test_a_fault_is_tried_and_its_promise_kept() -> None:
    ((family, chosen_fault),) = chosen(families(), (), (SAMPLE,))
    outcome = run_one(family, chosen_fault, SEED)
    assert outcome.status is Status.KEPT, outcome
