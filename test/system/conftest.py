"""What the tests of the whole system share: a short schedule, and one recorded run of it per law."""

import fcntl
import json
import os
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from unittest.mock import patch

import pytest

from sms_handover.cli.main import main
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

from ..ros.short_handover import END_S, short_handover
from .runs import Ended, sms_handover

STRETCH = 3.0  # [-] of the short schedule: one second, so that DDS gets something to do
TICKS = round(STRETCH * END_S * 1000) + 1
LAWS = ("nmpc", "pid")

Command = Callable[..., Ended]


@pytest.fixture(scope="session")
def schedule(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A schedule of one second in which the deputy changes hands; the same file for all test processes."""
    path = shared_folder(tmp_path_factory) / "short.yaml"
    written = tmp_path_factory.mktemp("schedule") / path.name
    written.write_text(short_handover(stretch=STRETCH), encoding="utf-8")
    return written.replace(path)  # at once, as another test process may be reading it


@pytest.fixture(scope="session")
def simulated(schedule: Path) -> dict[str, RunData]:
    """The same schedule in one process, by law."""
    common = {"schedule": str(schedule)}
    return {
        law: simulate(load_scenario(values={"common": common, "controller": {"law": law}})) for law in LAWS
    }


@pytest.fixture(scope="session")
def recorded(schedule: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, Ended]]:
    """The output folder of a run over DDS, and what was printed, by law; the same for all test processes."""
    folder = shared_folder(tmp_path_factory) / "it's recorded"  # a name that has to be quoted
    folder.mkdir(exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # until it is closed: who comes second finds the runs
        return {law: run_once(law, schedule, folder) for law in LAWS}


def shared_folder(factory: pytest.TempPathFactory) -> Path:
    """Return the temporary folder that all processes of one run of the tests have in common."""
    own = factory.getbasetemp()
    return own.parent if own.name.startswith("popen-") else own  # as pytest-xdist calls its workers


def run_once(law: str, schedule: Path, folder: Path) -> tuple[Path, Ended]:
    """Return a run of the short schedule under a law, made now unless another test process has made it."""
    printed = folder / f"{law}.json"
    if not printed.exists():
        ended = sms_handover("run", "--controller", law, "--schedule", schedule, "-o", law, cwd=folder)
        assert ended.code == 0, ended
        printed.write_text(json.dumps(asdict(ended)), encoding="utf-8")
    return folder / law, Ended(**json.loads(printed.read_text(encoding="utf-8")))


@pytest.fixture
def called(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Iterator[Command]:
    """What ``sms_handover`` does, in this process: many times as fast for what ends before it starts any."""

    def call(*arguments: object, cwd: Path) -> Ended:
        monkeypatch.chdir(cwd)
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as ended:  # as argparse ends
            code = int(ended.code or 0)
        printed = capfd.readouterr()
        return Ended(code, printed.out, printed.err)

    with patch.dict(os.environ):  # a command may set what its own process and its children read
        yield call
