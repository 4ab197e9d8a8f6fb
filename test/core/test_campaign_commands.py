"""The verbs of campaigns: run, status, rerun, merge, and check, compare and report as they take campaigns."""

import json
import os
import re
import shlex
import signal
import sys
import time
from argparse import ArgumentParser
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from threading import Thread
from types import SimpleNamespace
from urllib.parse import unquote

import numpy as np
import psutil
import pyarrow.parquet as parquet
import pytest

from sms_handover.analysis.equality import before, compare_runs
from sms_handover.campaign.cases.case_row import Task
from sms_handover.campaign.definition.campaign_file import read_campaign
from sms_handover.campaign.definition.frozen import campaign_path
from sms_handover.campaign.engine.run import Tally
from sms_handover.campaign.record.campaign_folder import CampaignFolder
from sms_handover.campaign.record.kept_cases import keep_worst
from sms_handover.campaign.record.manifest import Shard
from sms_handover.cli.campaign import rerun
from sms_handover.cli.campaign.outputs import record_case
from sms_handover.cli.campaign.run import _words
from sms_handover.cli.main import main
from sms_handover.errors import GraphError, SmsHandoverError
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

from .campaigns import MASS, STUB, rows_of, run_here, written

SHORT = {"common.duration": 0.04}
UNIFORM = {"uniform": {"low": -2, "high": -1}}
ABORT = {"choice": {"values": ["abort"]}}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a campaign of two cases under two laws, with all that is kept."""
    path = tmp_path_factory.mktemp("campaign")
    keep = {"trajectories": "failures", "worst": 1}
    changes = {"cases": 2, "laws": ["nmpc", "pid"], "success": "peak_torque < 1e-4", "keep": keep}
    file = written(path, worst_by="peak_torque", **changes)
    assert main(["campaign", "run", str(file), "-o", str(path / "the rows")]) == 0
    return path / "the rows"


def test_a_folder_has_everything(finished: Path) -> None:
    rows = rows_of(finished)
    table = parquet.read_table(finished / "cases.parquet").to_pylist()
    assert [(one["case"], one["scenario"], one["law"]) for one in table] == sorted(rows)
    for one in table:
        row = rows[one["case"], one["scenario"], one["law"]]  # type: ignore[index]
        assert (one["row_digest"], one["run_digest"], one["seed"]) == (row.digest, row.run_digest, row.seed)
        assert one[f"input.{MASS}"] == row.inputs[MASS] and one["host"] and one["cpu"] > 0.0
        assert one["metric.peak_torque"] == row.metrics["peak_torque"]
        assert (one["success"], one["mission_failure"], one["numeric_failure"]) == (
            row.succeeded,
            row.mission_failure,
            False,
        )
    failures = {f"{t.case}_{t.scenario}_{t.law}.npz" for t, row in rows.items() if not row.succeeded}
    assert failures == {path.name for path in (finished / "trajectories").iterdir()} and len(failures) == 2
    worst = sorted(path.name for path in (finished / "full").iterdir())
    assert len(worst) == 2 and {name.split("_")[-1] for name in worst} == {"nmpc.npz", "pid.npz"}
    row = next(row for task, row in rows.items() if worst[0].startswith(f"{task.case}_smooth_{task.law}"))
    values = {"common.duration": 0.04, "law": row.task.law, "seed": row.seed, **row.inputs}
    run = simulate(load_scenario("smooth", values))
    with np.load(finished / "full" / worst[0], allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["joint_position"], run.joint_position)
    page = (finished / "index.html").read_text(encoding="utf-8")
    assert "sms-handover campaign rerun" in page and page.count(f'<a href="full/{worst[0]}">') == 1


def test_status_tells_what_failed_and_what_is_worst(
    finished: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["campaign", "status", str(finished), "--failed"]) == 0
    said = capsys.readouterr().out
    assert "campaign tiny: 4 of 4 rows" in said and "mission failed" in said
    assert main(["campaign", "status", str(finished), "--worst", "1"]) == 0
    said = capsys.readouterr().out
    assert said.count(f"kept whole: {finished}/full/") == 2
    command = next(line.strip() for line in said.splitlines() if line.strip().startswith("sms-handover"))
    assert main(shlex.split(command)[1:]) == 0
    assert "equal to its row, bit for bit" in capsys.readouterr().out


def test_a_row_that_differs_is_told(
    finished: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = finished.parent / "campaign.yaml"
    run_here(file, tmp_path / "stubbed", program=STUB)
    assert main(["campaign", "rerun", str(tmp_path / "stubbed"), "1", "--law", "pid"]) == 1
    assert "it DIFFERS from its row" in capsys.readouterr().out


def test_laws_are_compared_and_reported(
    finished: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "figures.json"
    assert main(["compare", str(finished), "--json", str(file), "--latex", str(tmp_path / "t.tex")]) == 0
    said = capsys.readouterr().out
    assert "success, 95 % interval" in said and "nmpc - pid, share of successes" in said
    figures = json.loads(file.read_text(encoding="utf-8"))
    assert [(one["law"], one["cases"], one["success"][0]) for one in figures["groups"]] == [
        ("nmpc", 2, 0.0),
        ("pid", 2, 1.0),
    ]
    assert figures["paired_tests"][0]["difference"] == -1.0
    assert main(["report", str(finished), "-o", str(tmp_path / "page.html")]) == 0
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert page.startswith("<!DOCTYPE html>")
    links = [unquote(link) for link in re.findall(r'<a href="(\S+\.npz)"', page)]
    assert len(links) == 2 and all((tmp_path / link).is_file() for link in links)


def test_check_tells_what_the_worst_cases_take(finished: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(finished.parent / "campaign.yaml")]) == 0
    told = re.search(r"worst 1 of each law as data (\S+) MB", capsys.readouterr().out)
    size = sum(path.stat().st_size for path in (finished / "full").iterdir())
    assert told and float(told[1]) == pytest.approx(size / 1e6, rel=0.05)


def test_worst_cases_that_are_not_those_of_their_rows_are_not_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The rows are made up. All else of the campaign is there, and each failure is a line with its remedy."""
    file, out = written(tmp_path, cases=2, keep={"worst": 1}), tmp_path / "out"
    run_here(file, out, program=STUB)
    assert main(["campaign", "run", str(file), "-o", str(out)]) == 3
    told, errors = capsys.readouterr()
    assert "1 worst cases by grasp_error are run again, to be kept as data" in told
    assert "case 1 of smooth under nmpc is not kept: run again it differs from its row" in errors
    assert f"sms-handover campaign rerun {out} 1 --law nmpc" in errors
    assert not (out / "full").exists() and (out / "index.html").exists()


def recorded(tmp_path: Path) -> Path:
    """Return a folder with made-up rows of eight cases, of which the two worst are 6 and 5, as bags."""
    keep = {"worst": 2, "worst_as": "bag"}
    run_here(written(tmp_path / "file", cases=8, keep=keep), tmp_path / "out", program=STUB)
    return tmp_path / "out"


def test_bags_of_the_worst_cases_are_made_once_and_gone_on_with(tmp_path: Path) -> None:
    out, tried, broken = recorded(tmp_path), list[int](), {5: SmsHandoverError("a node died")}

    def record(folder: CampaignFolder, task: Task, output: Path) -> None:
        tried.append(task.case)
        output.mkdir()
        if task.case in broken:
            raise broken[task.case]

    first = list(keep_worst(CampaignFolder(out), record))
    assert [one.is_lacking for one in first] == [False, False, True]
    assert f"{out}/bags/6_smooth_nmpc: equal to its row, bit for bit (1 of 2)" in first[1].text
    assert "case 5 of smooth under nmpc is not kept: a node died (2 of 2)" in first[2].text
    broken[5] = KeyboardInterrupt()  # type: ignore[assignment]
    with pytest.raises(KeyboardInterrupt):
        list(keep_worst(CampaignFolder(out), record))
    assert [path.name for path in (out / "bags").iterdir()] == ["6_smooth_nmpc"]
    (out / "bags" / ".5_smooth_nmpc").mkdir()  # as a driver that was killed leaves it
    broken.clear()
    assert len(list(keep_worst(CampaignFolder(out), record))) == 2
    assert list(keep_worst(CampaignFolder(out), record)) == [] and tried == [6, 5, 5, 5]


def test_where_there_is_no_ros_bags_are_left_for_later(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is said at the start too; an interrupt says how to go on; shards leave them to merge."""
    out, file = recorded(tmp_path), str(tmp_path / "file" / "campaign.yaml")
    monkeypatch.setattr("sms_handover.cli.campaign.outputs.find_spec", lambda name: None)
    assert main(["campaign", "run", file, "-o", str(out)]) == 3
    errors = capsys.readouterr().err
    assert "there will be no bags of the worst cases" in errors and "2 worst cases have no bag" in errors

    def interrupt(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("sms_handover.cli.campaign.outputs.find_spec", lambda name: name)
    monkeypatch.setattr("sms_handover.cli.campaign.outputs.record_case", interrupt)
    assert main(["campaign", "run", file, "-o", str(out)]) == 130
    assert "interrupted: the same command goes on" in capsys.readouterr().err
    merged = tmp_path / "merged"
    assert main(["campaign", "merge", str(out), "-o", str(merged)]) == 130
    told = re.search(r"'sms-handover (.*)' goes on", capsys.readouterr().err)
    makes = "sms_handover.cli.campaign.outputs.record_case"
    monkeypatch.setattr(makes, lambda folder, task, output: output.mkdir())
    assert told and main(shlex.split(told[1])) == 0 and len(list((merged / "bags").iterdir())) == 2
    run_here(Path(file), tmp_path / "part", shard=Shard(1, 2), program=STUB)
    (output,) = keep_worst(CampaignFolder(tmp_path / "part"), None)
    assert "'campaign merge' keeps them" in output.text and not (tmp_path / "part" / "bags").exists()


def test_an_interrupted_recording_ends_with_all_that_it_has_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, ready = recorded(tmp_path), tmp_path / "ready"
    stubborn = (
        "import os, pathlib, signal, time; signal.signal(signal.SIGINT, signal.SIG_IGN); "
        "signal.signal(signal.SIGTERM, signal.SIG_IGN); "
        f"pathlib.Path({str(ready)!r}).write_text(str(os.getpid())); time.sleep(60)"
    )
    for limit in ("_END_S", "_KILL_S"):
        monkeypatch.setattr(f"sms_handover.cli.campaign.outputs.{limit}", 0.1)
    monkeypatch.setattr(
        "sms_handover.cli.campaign.outputs.as_program", lambda name: (sys.executable, "-c", stubborn)
    )

    def interrupt() -> None:
        while not (ready.exists() and ready.read_text()):
            time.sleep(0.02)
        os.kill(os.getpid(), signal.SIGINT)

    Thread(target=interrupt, daemon=True).start()
    with pytest.raises(KeyboardInterrupt):
        record_case(CampaignFolder(out), Task(6, "smooth", "nmpc"), tmp_path / "bag")
    assert not psutil.pid_exists(int(ready.read_text()))


@pytest.mark.parametrize(
    ("case", "ended", "code"),
    [
        (1, 130, 130),  # interrupted: what there is is not compared
        (1, 3, 3),  # messages are missing
        (4, GraphError("container:\nmissed by 4 mm"), 0),
        (0, GraphError("container:\nmissed by 0 mm"), 1),  # it ends so, and is another run
        (4, GraphError("it hangs"), None),
        (5, GraphError("missed by 4 mm"), None),  # a success has no cause
    ],
)
def test_what_becomes_of_a_case_over_dds(
    case: int,
    ended: int | Exception,
    code: int | None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def run(words: Sequence[str]) -> int:
        assert words[1:3] == ["--controller", "nmpc"] and f"{MASS}:=" in " ".join(words)
        if isinstance(ended, Exception):
            raise ended
        return ended

    takes_words = SimpleNamespace(
        add_parser=lambda parser: setattr(parser, "parse_args", lambda words: words), command=run
    )
    monkeypatch.setattr(rerun, "import_module", lambda name: takes_words)
    monkeypatch.setattr(rerun, "read_run", lambda path: simulate(load_scenario("smooth", SHORT)))
    monkeypatch.setattr(rerun, "run_digest", lambda run: "00" if case else "11")
    parser = ArgumentParser()
    rerun.add_parser(parser)
    options = parser.parse_args([str(recorded(tmp_path)), str(case), "--bag", "-o", str(tmp_path / "bag")])
    if code is None:
        with pytest.raises(GraphError):
            rerun.command(options)
    else:
        assert rerun.command(options) == code
    told = capsys.readouterr().out
    assert ("it ends as its row says: missed by 4 mm" in told) is (code == 0)
    assert ("equal to its row, bit for bit" in told, "DIFFERS" in told) == (code == 0, code == 1)


def test_of_a_run_that_ends_without_a_plan_what_has_commands_is_compared() -> None:
    """Over DDS there is a state more, at which the law gives up."""
    run = simulate(load_scenario("smooth", SHORT))
    assert compare_runs(rerun.commanded(run), run) == ()
    command = np.where(run.tick_ns[:, None] >= 20_000_000, np.nan, run.joint_command)
    given_up = rerun.commanded(replace(run, joint_command=command))
    assert compare_runs(given_up, before(run, 20_000_000)) == () and len(given_up.tick_ns) == 20


def test_a_recording_that_fails_says_so_with_its_last_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = recorded(tmp_path)
    fails = (sys.executable, "-c", "import sys; print('warning'); print(sys.argv[1:]); sys.exit(1)")
    monkeypatch.setattr("sms_handover.cli.campaign.outputs.as_program", lambda name: fails)
    with pytest.raises(SmsHandoverError) as error:
        record_case(CampaignFolder(out), Task(6, "smooth", "nmpc"), tmp_path / "bag")
    words = ["campaign", "rerun", str(out), "6", "--law", "nmpc", "--scenario", "smooth", "--bag", "--output"]
    assert str(error.value) == str([*words, str(tmp_path / "bag")])


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["compare", "OUT", "--csv", "-"], "--csv is for runs: the cases of OUT are in its cases.parquet"),
        (["compare", "OUT", "OUT"], "OUT is a campaign: give it alone"),
        (["report", "OUT", "--figures", "x"], "figures and second engines are for runs"),
        (["campaign", "rerun", "OUT", "2"], "case is 2, must be from 0 to 1"),
        (["campaign", "rerun", "OUT", "0", "--law", "pdi"], "unknown law 'pdi' (did you mean 'pid'?)"),
        (["campaign", "rerun", "OUT", "0", "--view"], "--view shows a recording: give --bag too"),
        (["campaign", "rerun", "OUT", "0", "--bag"], "--bag needs --output FOLDER"),
        (["campaign", "status", "."], ". is no campaign folder: it has no manifest.json"),
        (["campaign", "run", "lows"], "unknown campaign 'lows' (did you mean 'laws'?)"),
        (["campaign", "run", "FILE", "-j", "0"], "--jobs is 0, must be from 1 to 1024"),
        (["campaign", "run", "FILE", "--cases", "0"], "--cases is 0, must be from 1 to"),
        (["campaign", "run", "FILE", "-o", "OUT", "--cases", "1"], "--cases is 1, must be >= 2, which OUT"),
        (["campaign", "run", "FILE", "-o", "FILE"], "no folder: choose another"),
        (
            ["campaign", "run", "FILE", "-o", "/proc/x"],
            "/proc cannot be written to: No such file or directory",
        ),
        (["campaign", "status", "OUT", "--worst", "-1"], "--worst is -1, must be >= 0"),
        (["campaign", "run", "FILE", "--shard", "4/3"], "shard '4/3' must be NUMBER/OF"),
        (["campaign", "run", "FILE", "--trust-network"], "--trust-network is for --scheduler"),
        (["campaign", "run", "FILE", "--scheduler", "tcp://10.1.1.1:1"], "is plain TCP to another machine"),
        (["check", "FILE", "--controller", "pid"], "takes no options, given is --controller: put values"),
        (["check", "FILE", "--conditions", "harsh"], "takes no options, given is --conditions: put values"),
        (["check", "laws", "--duration", "0"], "laws.yaml is a campaign, which takes no options, given is"),
        (["check", "laws", "--no-dry-run"], "takes no options, given is --no-dry-run: put values into"),
        (["check", "config/robot.yaml", "--conditions", "harsh"], "is a robot, checked alone"),
        (["campaign", "merge", "OUT", "-o", "OUT"], "OUT exists: merge into a new folder"),
    ],
)
def test_a_slip_is_one_line(
    words: list[str], told: str, finished: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    places = {"OUT": str(finished), "FILE": str(finished.parent / "campaign.yaml")}
    assert main([places.get(word, word) for word in words]) == 2
    out, err = capsys.readouterr()
    assert told.replace("OUT", str(finished)) in err and err.count("\n") == 1 and out == ""


def test_merge_takes_the_rows_and_makes_the_rest(finished: Path, tmp_path: Path) -> None:
    assert main(["campaign", "merge", str(finished), "-o", str(tmp_path / "merged")]) == 0
    assert rows_of(tmp_path / "merged") == rows_of(finished)
    for name in ("cases.parquet", "index.html", "trajectories"):
        assert (tmp_path / "merged" / name).exists()


def test_check_tells_draws_and_cost(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path, cases=10_000, metrics=["approach.arm_a.final_error"], sampler="sobol")
    assert main(["check", str(file)]) == 0
    said = capsys.readouterr().out
    assert "normal, mean 240, std 12" in said and "202.917 to 277.083" in said
    assert "10000 cases x 1 scenarios x 1 laws = 10000 runs" in said and "CPU time about " in said
    assert "sobol spreads powers of two evenly: take 8192 or 16384 cases" in said


@pytest.mark.parametrize(
    ("verb", "changes", "told"),
    [
        (
            "check",
            {"success": "grasp_eror < 1"},
            "campaign.yaml:15: success: unknown metric 'grasp_eror' (did you mean 'grasp_error'?): known are "
            "those of 'sms-handover list metrics'",
        ),
        ("check", {"cases": None}, "campaign.yaml:1: cases is missing: give the number of cases by this key"),
        ("check", {"metrics": ["approach.arm_c.final_error"]}, "unknown metric 'approach.arm_c.final_error'"),
        ("run", {"worst_by": "grasp_eror"}, "campaign.yaml:16: worst_by: unknown metric 'grasp_eror'"),
        ("check", {"draws": {"robot.base.mas": UNIFORM}}, "unknown path 'robot.base.mas'"),
        ("run", {"draws": {"schedule.phases.carry.on_miss": ABORT}}, "cannot be drawn"),
        ("run", {"draws": {"robot.base.mass": UNIFORM}}, "case 0 of smooth under nmpc: robot.base.mass:=-"),
        (
            "run",
            {"draws": {"truth.common.tick": UNIFORM}},
            "case 0 of smooth under nmpc: value 'truth.common",
        ),
        ("check", {"success": "carry.final_error < 1"}, "unknown metric 'carry.final_error' (did you mean"),
        ("check", {"success": "base_turn < solve_max"}, "metric 'solve_max' is of wall time"),
        ("check", {"limits": {"ticks": 10}}, "case 0 of smooth under nmpc: more than 10 ticks"),
    ],
)
def test_a_campaign_that_no_case_could_have_does_not_begin(
    verb: str, changes: dict[str, object], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words, out = ["check"] if verb == "check" else ["campaign", "run"], tmp_path / "out"
    more = [] if verb == "check" else ["-o", str(out)]
    assert main([*words, str(written(tmp_path, **changes)), *more]) == 2
    assert told in capsys.readouterr().err.splitlines()[-1] and not out.exists()


def test_progress_names_scenarios_where_there_are_several() -> None:
    def words(*groups: tuple[str, str]) -> str:
        return _words(Tally(8, groups, rows=Counter(groups), successes=Counter()), "")[1]

    assert words(("a", "pid"), ("b", "pid")).split("; ")[1].startswith("b pid 0.0 %")
    assert words(("a", "pid"), ("a", "nmpc")).split("; ")[1].startswith("nmpc 0.0 %")


def test_the_shipped_campaign_is_one() -> None:
    campaign = read_campaign(campaign_path("laws"))
    assert campaign.name == "laws" and len(campaign.laws) >= 2 and campaign.cases
