"""Runs of campaigns: the same rows whoever carries them out and whatever happens to them meanwhile."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import distributed
import psutil
import pytest

from sms_handover.campaign.cases.case import Cases
from sms_handover.campaign.cases.case_process import Done
from sms_handover.campaign.cases.case_row import Beside, Row, Status, Task
from sms_handover.campaign.definition.frozen import freeze
from sms_handover.campaign.engine.choice import workers_for
from sms_handover.campaign.engine.dask_workers import DaskWorkers, answers_of
from sms_handover.campaign.engine.run import run_campaign
from sms_handover.campaign.engine.scheduler_url import require_safe
from sms_handover.campaign.page.campaign_page import campaign_page
from sms_handover.campaign.record.campaign_folder import CampaignFolder, merge, open_campaign
from sms_handover.campaign.record.journal import JOURNAL
from sms_handover.campaign.record.manifest import Shard
from sms_handover.cli.main import main
from sms_handover.errors import ConfigurationError, SmsHandoverError

from .campaigns import STUB, command, digests_of, rows_of, run_here, written

CASES = 20
PATIENCE_S = 120.0


def until(condition: object, what: str) -> None:
    """Wait until a condition holds."""
    assert callable(condition)
    latest = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < latest, f"it never came to {what}"
        time.sleep(0.02)


def journal_lines(folder: Path) -> int:
    """Return how many lines a journal has."""
    path = folder / JOURNAL
    return path.read_bytes().count(b"\n") if path.exists() else 0


def family(pid: int) -> list[psutil.Process]:
    """Return the processes below one."""
    try:
        return list(psutil.Process(pid).children(recursive=True))
    except psutil.NoSuchProcess:
        return []


@contextmanager
def ended_at_last(child: "subprocess.Popen[str]") -> Iterator[list[psutil.Process]]:
    """Yield a list for processes that must have ended with a child."""
    below: list[psutil.Process] = []
    try:
        yield below
    finally:
        child.kill()
        child.wait()
    until(lambda: not [one for one in below if one.is_running() and one.status() != "zombie"], "no orphan")


@pytest.mark.slow
def test_rows_depend_on_no_worker_order_or_kill(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One process; the same backwards; 2 workers with kill -9 of one, then of the driver; 1 worker."""
    values = {"common.duration": 0.04, "common.conditions": "nominal"}
    file = written(tmp_path, cases=CASES, values=values)
    (tmp_path / "scratch").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "scratch"))
    run_here(file, tmp_path / "serial")
    assert not list((tmp_path / "scratch").iterdir())
    expected = digests_of(tmp_path / "serial")
    assert len(expected) == CASES == len(set(expected.values()))

    cases = Cases(*freeze(file), tmp_path / "unpacked")
    for task in list(reversed(expected))[::4]:
        assert cases.run(task).row.digest == expected[task]

    out = tmp_path / "killed"
    child = command("campaign", "run", str(file), "-o", str(out), "-j", "2", stderr=subprocess.DEVNULL)
    with ended_at_last(child) as below:
        until(lambda: journal_lines(out) >= 2, "two rows")
        below.extend(family(child.pid))
        assert_only_local([*below, psutil.Process(child.pid)])
        workers = [one for one in below if "spawn_main" in " ".join(one.cmdline())]
        workers[-1].kill()
        known = journal_lines(out)
        until(lambda: journal_lines(out) >= min(known + 4, CASES - 2), "more rows")
        below.extend(family(child.pid))
        child.send_signal(signal.SIGKILL)
    with (out / JOURNAL).open("ab") as stream:
        stream.write(b'{"row":{"task":[1')  # as a writer that was killed leaves it
    assert 0 < len(rows_of(out)) <= CASES

    frozen, number = freeze(file)
    with open_campaign(out, frozen, number, Shard()) as opened:
        assert "17 bytes of an unfinished last line are cut off" in opened.faults[0]
        run_campaign(opened, lambda: DaskWorkers(frozen, number, workers=1), lambda tally: None)
    assert digests_of(out) == expected
    assert journal_lines(out) == CASES, "no case twice"
    until(lambda: not list((tmp_path / "scratch").glob("sms_handover_*")), "no scratch folder left behind")


def assert_only_local(processes: list[psutil.Process]) -> None:
    """Assert from the socket table that processes listen and speak on 127.0.0.1 only."""
    found = 0
    for process in processes:
        for connection in process.net_connections("inet") if process.is_running() else ():
            ends = [end.ip for end in (connection.laddr, connection.raddr) if end]
            assert set(ends) <= {"127.0.0.1"}, (process.cmdline(), connection)
            found += 1
    assert found, "a cluster has sockets"


def test_shards_and_more_cases_leave_the_rows(tmp_path: Path) -> None:
    file = written(tmp_path, cases=8, laws=["nmpc", "pid"])
    run_here(file, tmp_path / "whole", program=STUB)
    for number in (3, 1, 2):
        tally = run_here(file, tmp_path / f"shard{number}", shard=Shard(number, 3), program=STUB)
        assert tally.done == tally.total == 2 * len(range(number - 1, 8, 3))
    with merge(tmp_path / "merged", [tmp_path / f"shard{number}" for number in (1, 2, 3)]):
        pass
    assert digests_of(tmp_path / "merged") == digests_of(tmp_path / "whole")
    assert run_here(file, tmp_path / "merged", cases=12, program=STUB).before == 16
    more = digests_of(tmp_path / "merged")
    assert len(more) == 24 and digests_of(tmp_path / "whole").items() <= more.items()
    assert CampaignFolder(tmp_path / "merged").cases == 12


def test_what_is_missing_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of a shard without rows, of one that was ended, and of one whose line is corrupted."""
    frozen, number = freeze(written(tmp_path, cases=6))
    out = tmp_path / "shard"
    for cases, told in (((), "No case has a row yet."), ((0, 2), "None of 2 rows is a failure.")):
        with open_campaign(out, frozen, number, Shard(1, 2)) as opened:
            opened.add(*(next(Confused(0, 1).run([Task(case, "smooth", "nmpc")]))[0] for case in cases))
        assert main(["campaign", "status", str(out), "--failed"]) == 3
        assert f"{len(cases)} of 3 rows, shard 1/2" in (said := capsys.readouterr().out)
        assert said.endswith(f"\n{told}\n") and "cause" not in said
        assert main(["campaign", "status", str(out), "--worst", "1"]) == 3
        assert capsys.readouterr().out.endswith("\nNo case has grasp_error.\n")
        page = campaign_page(CampaignFolder(out))
        assert told in page and "Every case is a success" not in page
        assert "No case has grasp_error." in page and "There is nothing to test" in page
    (out / JOURNAL).write_bytes((out / JOURNAL).read_bytes().replace(b"succeeded", b"died", 1))
    assert main(["compare", str(out)]) == 0
    compared = capsys.readouterr()
    assert compared.out.startswith("campaign tiny: 1 of 3 rows, shard 1/2\n")
    assert f"{out / JOURNAL}, line 1 is corrupted and left out" in compared.err


def test_it_stops_at_a_look_whatever_the_order(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stop = {"half_width": 0.28, "looks": [4, 8, 12]}
    file = written(tmp_path, cases=40, stop=stop)
    tally = run_here(file, tmp_path / "out", program=STUB)
    assert tally.stopped_at == 8 and sorted(task.case for task in rows_of(tmp_path / "out")) == [*range(8)]
    assert run_here(file, tmp_path / "out", program=STUB).done == 8, "the same command has nothing to do"
    assert main(["campaign", "status", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "8 of 8 rows" in said and "stopped after 8 of 40 cases: every interval is narrow enough" in said
    assert "Stopping early makes an interval too narrow" in said and "It stopped after 8." in said
    assert main(["compare", str(tmp_path / "out"), "--json", str(tmp_path / "json")]) == 0
    compared = capsys.readouterr().out
    assert compared.startswith(said[: said.index("enough")]) and "It stopped after 8." in compared
    figures = json.loads((tmp_path / "json").read_text())
    told = {"rows": 8, "runs": 8, "shard": "1/1", "stopped_at": 8, "sampler": "random"}
    assert told.items() <= figures.items()
    page = campaign_page(CampaignFolder(tmp_path / "out"))
    assert "It stopped after 8." in page and "8 of 8 runs." in page
    run_here(written(tmp_path / "all", cases=3, stop=stop), tmp_path / "few", program=STUB)
    assert main(["campaign", "status", str(tmp_path / "few")]) == 0
    said = capsys.readouterr().out
    assert "stopped after" not in said and "It has not stopped early." in said


def test_drivers_share_a_scheduler(tmp_path: Path) -> None:
    """Each gets its own rows; the first to end leaves the other its workers, at its next look too."""
    quiet = {"n_workers": 1, "threads_per_worker": 2, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**quiet) as cluster:

        def driver(*laws: str) -> DaskWorkers:
            frozen, number = freeze(written(tmp_path / laws[0], laws=list(laws), cases=9))
            return DaskWorkers(frozen, number, scheduler=cluster.scheduler_address, program=STUB)

        def tasks(law: str, cases: range) -> list[Task]:
            return [Task(case, "smooth", law) for case in cases]

        one, same, other = driver("nmpc"), driver("nmpc"), driver("pid")
        running = one.run(tasks("nmpc", range(9)))
        found = [done.row.task for done in next(running)]
        for another, law in ((other, "pid"), (same, "nmpc")):
            asked = tasks(law, range(5))
            assert sorted(done.row.task for chunk in another.run(asked) for done in chunk) == asked
            another.close()
        found += [done.row.task for chunk in running for done in chunk]
        found += [done.row.task for chunk in one.run(tasks("nmpc", range(9, 12))) for done in chunk]
        assert sorted(found) == tasks("nmpc", range(12))
        one.close()


class Confused:
    """Workers that give another case than they were asked for."""

    def __init__(self, shift: int, times: int) -> None:
        self._shift, self._times = shift, times

    def run(self, tasks: Iterable[Task]) -> Iterator[Sequence[Done]]:
        for case, scenario, law in tasks:
            row = Row(Task(case + self._shift, scenario, law), case, {}, Status.SUCCEEDED, "", {}, "00")
            yield [Done(row, Beside(0.0, 0.0, "here"))] * self._times

    def close(self) -> None:
        pass


@pytest.mark.parametrize(("shift", "times"), [(1, 1), (0, 2)])
def test_rows_that_nobody_asked_for_are_an_error(shift: int, times: int, tmp_path: Path) -> None:
    frozen, number = freeze(written(tmp_path))
    told = pytest.raises(SmsHandoverError, match=f"gave a row of case {shift} .* were not asked for")
    with open_campaign(tmp_path / "out", frozen, number, Shard()) as opened, told:
        run_campaign(opened, lambda: Confused(shift, times), lambda tally: None)
    assert not journal_lines(tmp_path / "out")


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_ctrl_c_leaves_soon_and_says_how_to_go_on(jobs: str, tmp_path: Path) -> None:
    """As a terminal sends it: to the driver and to every process of its group.

    Whatever the load, it leaves sooner than twice what it took to start; docs/scale.md has the wall time.
    """
    file, out = written(tmp_path, cases=1000), tmp_path / "out"
    words = ("campaign", "run", str(file), "-o", str(out), "-j", jobs)
    begin = time.monotonic()
    child = command(*words, stderr=subprocess.PIPE, start_new_session=True)
    with ended_at_last(child) as below:
        until(lambda: journal_lines(out) >= 1, "a row")
        to_start = time.monotonic() - begin
        below.extend(family(child.pid))
        assert below
        os.killpg(child.pid, signal.SIGINT)
        begin = time.monotonic()
        _, said = child.communicate(timeout=PATIENCE_S)
        took = time.monotonic() - begin  # from the signal to the end of the driver
    assert took < 2.0 * to_start
    assert child.returncode == 130 and "interrupted: the same command goes on" in said
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("url", "trusted", "told"),
    [
        ("tls://cluster:8786", False, ""),
        ("tcp://127.0.0.1:8786", False, ""),
        ("tcp://localhost:8786", False, ""),
        ("tcp://10.0.0.1:8786", True, ""),
        ("tcp://10.0.0.1:8786", False, "is plain TCP to another machine"),
        ("ws://10.0.0.1:8786", True, "must be of the form"),
        ("tls://cluster", False, "must be of the form"),
        ("tcp://127.0.0.1:99999", False, "must be of the form .*: Port out of range"),
        ("tls://cluster:abc", False, "must be of the form .*: Port could not be cast"),
        ("tls://[::1:8786", False, "must be of the form .*: Invalid IPv6 URL"),
    ],
)
def test_a_scheduler_is_reached_safely_or_on_request(url: str, trusted: bool, told: str) -> None:
    if told:
        with pytest.raises(ConfigurationError, match=told):
            require_safe(url, trust_network=trusted)
    else:
        require_safe(url, trust_network=trusted)


# What it keeps of the worker is not looked at.
DIED_AGAIN = distributed.KilledWorker("chunk", None, 20)  # type: ignore[arg-type]


class Broken:
    """A future of a chunk that failed."""

    def __init__(self, error: Exception) -> None:
        self._error = error

    def result(self) -> None:
        raise self._error


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (DIED_AGAIN, "workers die again and again: see what kills them"),
        (distributed.CancelledError("chunk"), "a worker failed: CancelledError: chunk"),
        (ModuleNotFoundError("No module named 'casadi'"), "a worker failed: ModuleNotFoundError: No module"),
        (SmsHandoverError("a process for cases cannot start"), "^a process for cases cannot start$"),
    ],
)
def test_whatever_fails_in_a_cluster_is_one_error(error: Exception, told: str) -> None:
    with pytest.raises(SmsHandoverError, match=told):
        answers_of(Broken(error))


def test_workers_that_cannot_be_reached_are_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frozen, number = freeze(written(tmp_path))
    monkeypatch.setattr("sms_handover.campaign.engine.dask_workers._TIMEOUT", "1s")
    with pytest.raises(SmsHandoverError, match="cannot be reached"):
        workers_for(frozen, number, jobs=1, scheduler="tcp://127.0.0.1:1")


def test_without_the_extra_one_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frozen, number = freeze(written(tmp_path))
    monkeypatch.setitem(sys.modules, "sms_handover.campaign.engine.dask_workers", None)
    with pytest.raises(SmsHandoverError, match=r"need distributed, .* 'sms_handover\[campaign\]'"):
        workers_for(frozen, number, jobs=2)
    assert json.loads(frozen.text)
