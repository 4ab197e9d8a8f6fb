"""Equality of a campaign's rows, bit for bit: whoever carries them out, in any order, whatever is killed.

``make campaign`` tries 500 cases under two laws and writes a section of docs/campaigns.md. The first thing
that is not equal ends it. ``--cases 8 --kills 2 --seconds 0.05 --reruns 4 --bags 0 --print`` is a quick look.
"""

import random
import subprocess
import sys
import tempfile
import time
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import psutil
import yaml

from benchmarks.machine import machine
from benchmarks.results import ROOT
from docs.tables import table
from sms_handover.analysis.equality import run_digest
from sms_handover.campaign.cases.case_row import Row, Task
from sms_handover.campaign.cases.read_back import is_same
from sms_handover.campaign.definition.campaign_file import Campaign, read_campaign
from sms_handover.campaign.definition.frozen import Frozen, freeze
from sms_handover.campaign.engine.dask_workers import DaskWorkers
from sms_handover.campaign.engine.run import run_campaign
from sms_handover.campaign.engine.workers import SerialWorkers, Workers
from sms_handover.campaign.record.campaign_folder import CampaignFolder, merge, open_campaign, tasks_of
from sms_handover.campaign.record.journal import JOURNAL
from sms_handover.campaign.record.manifest import Shard
from sms_handover.campaign.sampling.samples import Samples
from sms_handover.cli.main import main as sms_handover
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

PAGE = ROOT / "docs" / "campaigns.md"
HEAD, NEXT = "## Equal bit for bit\n", "## What is not there yet\n"
SEED = 500
SCENARIO, LAWS, CONDITIONS = "smooth", ("nmpc", "pid"), "nominal"
DRAWS: Mapping[str, Any] = {
    "truth.robot.base.mass": {"normal": {"mean": 240.0, "std": 12.0}},  # kg
    "truth.deputy.in_world.xyz[0]": {"normal": {"mean": 1.23, "std": 0.002}},  # m
    "conditions.friction.coulomb": {"uniform": {"low": 0.001, "high": 0.0025}},  # N m
    "conditions.torque.gain": {"normal": {"mean": 0.0, "std": 0.01}},  # of the torque constant
    "conditions.command.delay": {"choice": {"values": [0.001, 0.002]}},  # s
}
_ANOTHER = {"conditions.torque.offset": {"normal": {"mean": 0.0, "std": 0.002}}}  # N m
_WITHIN = 0.1  # [-] of a robot's value that a model error of nominal conditions moves it by, at most
_TORN = b'{"row":{"task":[1'  # as a writer that was killed leaves its last line
_SHARDS = 3
_RETRIES = 10  # [-] so that no case is killed too often
_MORE = 2  # [-] cases that are added at the end
_LOOK_S = 0.02  # [s] between two looks at a journal
_GONE_S = 30.0  # [s] that orphans have to end
_TAIL = 2000  # [-] characters of what a run said that are told where it failed
DRIVER, WORKER, CASES = "driver", "worker", "process of cases"


class Tried(NamedTuple):
    """One thing that was tried: what, how many rows or runs were compared, and the wall time in s."""

    what: str
    compared: str
    wall: float


def require(condition: bool, what: str) -> None:
    """End the measurement unless a condition holds."""
    if not condition:
        raise SystemExit(f"NOT EQUAL: {what}")


class Trial:
    """A campaign, the rows that one process gave, and what is compared with them."""

    def __init__(self, options: Namespace, folder: Path) -> None:
        """Write the campaign into a folder of ours."""
        self.options, self.folder = options, folder
        self.random = random.Random(options.seed)
        self.file = self.written("campaign")
        self.frozen, self.cases = freeze(self.file)
        self.total = options.cases * len(LAWS)
        self.rows: dict[Task, Row] = {}

    def written(self, name: str, **changes: object) -> Path:
        """Write a campaign file."""
        content: dict[str, Any] = {
            "name": "equality",
            "seed": self.options.seed,
            "cases": self.options.cases,
            "scenarios": {SCENARIO: SCENARIO},
            "laws": list(LAWS),
            "values": {
                "common.duration": self.options.seconds,
                "common.dynamics": "compiled",
                "common.conditions": CONDITIONS,
            },
            "draws": dict(DRAWS),
            "success": "peak_torque < 1",
            "limits": {"retries": _RETRIES},
        }
        path = self.folder / f"{name}.yaml"
        path.write_text(yaml.safe_dump({**content, **changes}, sort_keys=False), encoding="utf-8")
        return path

    def run(self, name: str, make: Callable[[], Workers], shard: Shard | None = None) -> Path:
        """Run the campaign to its end; return its folder."""
        path = self.folder / name
        with open_campaign(path, self.frozen, self.cases, shard or Shard()) as opened:
            run_campaign(opened, make, lambda tally: None)
        return path

    def serial(self) -> Workers:
        """Return one process."""
        return SerialWorkers(self.frozen, self.cases)

    def shuffled(self) -> dict[Task, str]:
        """Return the texts of the rows that one process gives in random order."""
        tasks = list(tasks_of(campaign_of(self.frozen, self.cases), range(self.options.cases), Shard()))
        workers = self.serial()
        done = workers.run(random.Random(self.options.seed).sample(tasks, len(tasks)))
        found = {one.row.task: one.row.text for each in done for one in each}
        workers.close()
        return found

    def dask(self, workers: int) -> Workers:
        """Return a cluster of so many workers here."""
        return DaskWorkers(self.frozen, self.cases, workers=workers)

    def require_rows(self, folder: Path, what: str) -> None:
        """Require each row of a folder once, equal to that of one process."""
        lines = (folder / JOURNAL).read_bytes().splitlines()
        found = {entry.row.task: entry.row for entry in CampaignFolder(folder).entries()}
        require(len(lines) == len(found), f"{what}: {len(lines)} lines for {len(found)} rows")
        require(found.keys() == self.rows.keys(), f"{what}: rows are missing")
        for task, row in found.items():
            require(row.text == self.rows[task].text, f"{what}: {task}")


def trials(trial: Trial) -> Iterator[Tried]:
    """Yield what was tried, one after the other."""
    options, random_ = trial.options, trial.random
    begin = time.monotonic()

    def tried(what: str, compared: str) -> Tried:
        nonlocal begin
        before, begin = begin, time.monotonic()
        return Tried(what, compared, begin - before)

    with ThreadPoolExecutor(1) as pool:  # each waits for a process of its own
        other = pool.submit(trial.shuffled)
        folder = trial.run("serial", trial.serial)
        shuffled = other.result()
    trial.rows = {entry.row.task: entry.row for entry in CampaignFolder(folder).entries()}
    require(len(trial.rows) == trial.total, "one process: rows are missing")
    require(len({row.digest for row in trial.rows.values()}) == trial.total, "two cases have the same row")
    rows = f"{trial.total} rows"
    require(shuffled == {task: row.text for task, row in trial.rows.items()}, "in another order")
    yield tried("one process, in order and, at the same time, another in random order", rows)

    for count in (1, 2, 4):
        path = trial.run(f"dask_{count}", lambda count=count: trial.dask(count))  # type: ignore[misc]
        trial.require_rows(path, f"{count} workers of Dask")
        yield tried(f"a cluster, workers: {count}", rows)

    parts = [
        trial.run(f"shard_{number}", lambda: trial.dask(2), Shard(number, _SHARDS))
        for number in range(_SHARDS, 0, -1)
    ]
    with merge(trial.folder / "merged", parts):
        pass
    trial.require_rows(trial.folder / "merged", "shards")
    yield tried(f"{_SHARDS} shards, merged", rows)

    killed = kill(trial, options.kills)
    words = ", ".join(f"{times} of a {what}" for what, times in sorted(killed.items()))
    yield tried(
        f"2 workers and {options.kills} times `kill -9` ({words}), torn last lines after the driver", rows
    )

    yield tried("every draw read back from plant or model", f"{draws_read_back(trial)} values")
    more_draws_and_cases(trial, folder)
    yield tried(f"one more draw; {_MORE} more cases", f"{options.cases} cases as before")

    reruns = random_.sample(list(trial.rows), min(options.reruns, trial.total))
    for task in reruns[options.bags :]:
        again(folder, task)
    yield tried("`rerun` in one process", f"{len(reruns[options.bags :])} runs")
    for number, task in enumerate(reruns[: options.bags]):
        again(folder, task, "--bag", "--output", str(trial.folder / f"bag_{number}"))
    if options.bags:
        yield tried("`rerun --bag`, over DDS, read from the bag", f"{options.bags} runs")

    yield tried("`simulate` with the values of a row, and without uncertainty", f"{simulated(trial)} runs")


def kill(trial: Trial, kills: int) -> Counter[str]:
    """Run the campaign with so many random kills; return what was killed how often."""
    out = trial.folder / "killed"
    at = sorted(trial.random.sample(range(1, max(trial.total * 9 // 10, kills + 1)), kills))
    found: Counter[str] = Counter()
    while True:
        command = [sys.executable, "-m", "sms_handover.cli.main", "campaign", "run", str(trial.file)]
        with (trial.folder / "killed.log").open("ab") as log:
            child = subprocess.Popen([*command, "-o", str(out), "-j", "2"], stdout=log, stderr=log)
            while child.poll() is None:
                if at and lines_of(out) >= at[0]:
                    what = killed_one(child, trial.random)
                    if what:
                        at.pop(0)
                        found[what] += 1
                    if what == DRIVER:
                        with (out / JOURNAL).open("ab") as stream:
                            stream.write(_TORN)
                time.sleep(_LOOK_S)
        if child.returncode >= 0:
            break
    said = (trial.folder / "killed.log").read_text(encoding="utf-8", errors="replace")[-_TAIL:]
    ended = f"the run ended with {child.returncode}, {len(at)} kills left: {said}"
    require(child.returncode == 0 and not at, ended)
    trial.require_rows(out, "killed")
    return found


def killed_one(child: "subprocess.Popen[bytes]", random_: random.Random) -> str:
    """Kill the driver, a worker, or a process of cases, as it comes; return what, '' if there is none."""
    named = {WORKER: "spawn_main", CASES: "case_main"}
    what = random_.choice([DRIVER, WORKER, CASES])
    try:
        below = psutil.Process(child.pid).children(recursive=True)
        if what == DRIVER:
            child.kill()
            child.wait()
            psutil.wait_procs(below, _GONE_S)
            return DRIVER
        chosen = [one for one in below if any(named[what] in word for word in one.cmdline())]
        if chosen:
            random_.choice(chosen).kill()
    except psutil.Error:  # it ended by itself just now
        return ""
    return what if chosen else ""


def lines_of(folder: Path) -> int:
    """Return how many lines a journal has, 0 if there is none yet."""
    path = folder / JOURNAL
    return path.read_bytes().count(b"\n") if path.exists() else 0


def draws_read_back(trial: Trial) -> int:
    """Require the value of every draw of every case to be what was drawn; return how many there are.

    Where the true robot differs further by a model error, its values are near what was drawn.
    """
    samples, count = Samples(campaign_of(trial.frozen, trial.cases)), 0
    for task, row in trial.rows.items():
        drawn = samples.inputs(task.case)
        require(drawn.keys() == row.inputs.keys() == set(DRAWS), f"{task} has other draws")
        for path, asked in drawn.items():
            found, count = row.inputs[path], count + 1
            near = path.startswith("truth.robot.") and abs(float(found) / float(asked) - 1.0) < _WITHIN
            require(near or is_same(asked, found), f"{task}: {path} is {found}, not {asked}")
    return count


def more_draws_and_cases(trial: Trial, folder: Path) -> None:
    """Require the draws to stay under one more draw, and the rows under more cases."""
    one_more = read_campaign(trial.written("more", draws={**DRAWS, **_ANOTHER}))
    samples, others = Samples(campaign_of(trial.frozen, trial.cases)), Samples(one_more)
    for case in range(trial.options.cases):
        known, more = samples.inputs(case), others.inputs(case)
        require(more.keys() - known.keys() == set(_ANOTHER), f"case {case} lacks the new draw")
        require({path: more[path] for path in known} == known, f"case {case} moved with a new draw")
    before = (folder / JOURNAL).read_bytes()
    trial.cases = trial.options.cases + _MORE
    trial.run(folder.name, trial.serial)
    after = (folder / JOURNAL).read_bytes()
    added = after.removeprefix(before).count(b"\n")
    require(
        after.startswith(before) and added == _MORE * len(LAWS), "more cases moved the rows that were there"
    )


def again(folder: Path, task: Task, *options: str) -> None:
    """Require a rerun to be equal to its row."""
    words = ["campaign", "rerun", str(folder), str(task.case), "--law", task.law, *options]
    with redirect_stdout(StringIO()) as said:
        code = sms_handover(words)
    require(code == 0 and "equal to its row, bit for bit" in said.getvalue(), f"rerun of {task}")


def simulated(trial: Trial) -> int:
    """Require runs of ``simulate`` to be equal to rows, and to those without uncertainty; return how many."""
    values = {"common.duration": trial.options.seconds, "common.dynamics": "compiled"}
    fixed = {path: one.quantile(0.5) for path, one in campaign_of(trial.frozen, trial.cases).draws.items()}
    certain = {path: value for path, value in fixed.items() if not path.startswith("conditions.")}
    draws = {path: {"normal": {"mean": value, "std": 0.0}} for path, value in certain.items()}
    frozen, cases = freeze(trial.written("certain", cases=1, draws=draws, values=values))
    workers = SerialWorkers(frozen, cases)
    rows = [one.row for done in workers.run(Task(0, SCENARIO, law) for law in LAWS) for one in done]
    workers.close()
    for row in rows:  # nothing drawn: the scenario as it is, at ideal conditions
        require(
            run_digest(simulate(load_scenario(SCENARIO, {**values, "law": row.task.law}))) == row.run_digest,
            f"no uncertainty under {row.task.law}",
        )
    samples = Samples(campaign_of(trial.frozen, trial.cases))
    for law in LAWS:
        task = Task(0, SCENARIO, law)
        drawn = {"common.conditions": CONDITIONS, **samples.inputs(0), "seed": trial.rows[task].seed}
        run = simulate(load_scenario(SCENARIO, {**values, **drawn, "law": law}))
        require(run_digest(run) == trial.rows[task].run_digest, f"simulate of {task}")
    return 2 * len(LAWS)


def campaign_of(frozen: Frozen, cases: int | None) -> Campaign:
    """Return the campaign with so many cases."""
    return frozen.campaign(cases)


def section(options: Namespace, found: Sequence[Tried]) -> str:
    """Return the text of the section."""
    rows = [(one.what, one.compared, f"{one.wall:.0f}") for one in found]
    lines = "\n".join(f"- {line}" for line in machine())
    asked = " ".join(sys.argv[1:])
    this_time = f", this time by\n`python -m benchmarks.campaign_equality {asked}`" if asked else ""
    return f"""\
This section is written by `make campaign`{this_time}: {options.cases} cases of `{SCENARIO}` under
{" and ".join(LAWS)} at `{CONDITIONS}` conditions, their first {options.seconds:g} s, with {len(DRAWS)} drawn
values. All of it was equal bit for bit, no row twice or missing; what is not ends the command. Tests run 20
cases with two kills.

{lines}

{table(["Tried", "Compared", "Wall time [s]"], rows)}
"""


def with_section(page: str, text: str) -> str:
    """Return a page with another text in the section that is written here."""
    begin = page.index(HEAD) + len(HEAD)
    return f"{page[:begin]}\n{text}\n{page[page.index(NEXT, begin) :]}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Try everything, and write the section."""
    parser = ArgumentParser(prog="python -m benchmarks.campaign_equality", description=__doc__)
    parser.add_argument("--seed", type=int, default=SEED, help="of every random number")
    parser.add_argument("--cases", type=int, default=500, metavar="N")
    parser.add_argument("--seconds", type=float, default=10.0, metavar="S", help="simulated time of a case")
    parser.add_argument("--kills", type=int, default=20, metavar="N")
    parser.add_argument("--reruns", type=int, default=50, metavar="N")
    parser.add_argument("--bags", type=int, default=3, metavar="N", help="of the reruns, over DDS")
    parser.add_argument("--print", action="store_true", help="print the section, do not write it")
    options = parser.parse_args(arguments)
    found = []
    with tempfile.TemporaryDirectory(prefix="sms_handover_equality_") as folder:
        for one in trials(Trial(options, Path(folder))):
            found.append(one)
            print(f"{one.what}: {one.compared}, {one.wall:.1f} s", file=sys.stderr, flush=True)
    text = section(options, found)
    if options.print:
        print(text)
    else:
        PAGE.write_text(with_section(PAGE.read_text(encoding="utf-8"), text), encoding="utf-8")


if __name__ == "__main__":
    main()
