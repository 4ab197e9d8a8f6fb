"""What the tests of the whole system share: a short schedule, and one recorded run of it per law."""

from pathlib import Path

import pytest

from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

from ..ros.short_handover import END_S, short_handover
from .runs import Ended, sms_handover

STRETCH = 6.0  # [-] of the short schedule: two seconds, so that DDS gets something to do
TICKS = round(STRETCH * END_S * 1000) + 1
LAWS = ("nmpc", "pid")


@pytest.fixture(scope="session")
def schedule(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A schedule of two seconds in which the deputy changes hands."""
    path = tmp_path_factory.mktemp("schedule") / "short.yaml"
    path.write_text(short_handover(stretch=STRETCH), encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def simulated(schedule: Path) -> dict[str, RunData]:
    """The same schedule in one process, by law."""
    common = {"schedule": str(schedule)}
    return {law: simulate(load_scenario({"common": common, "controller": {"law": law}})) for law in LAWS}


@pytest.fixture(scope="session")
def recorded(schedule: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, Ended]]:
    """The output folder of a run over DDS, and what was printed, by law."""
    folder = tmp_path_factory.mktemp("it's recorded")  # a name that has to be quoted
    runs = {}
    for law in LAWS:
        ended = sms_handover("run", "--controller", law, "--schedule", schedule, "-o", law, cwd=folder)
        assert ended.code == 0, ended
        runs[law] = (folder / law, ended)
    return runs
