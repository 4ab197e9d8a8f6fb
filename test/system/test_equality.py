"""A recorded run over DDS is the run in one process, bit for bit, whatever else the machine does."""

from pathlib import Path

import pytest

from sms_handover.analysis.equality import compare_runs
from sms_handover.bag.run.reader import read_run
from sms_handover.graph.topics import CONTAINER, RECORDER
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import GraspStatus

from .conftest import LAWS, TICKS
from .runs import Ended, busy_cores, sms_handover

pytestmark = [pytest.mark.system, pytest.mark.slow]


def assert_same_bits(run: RunData, expected: RunData) -> None:
    """Compare as a user can, and then the bytes of what every tick gave: there, 0.0 is not -0.0."""
    assert compare_runs(run, expected) == ()
    for name in ("tick_ns", "joint_position", "joint_velocity", "joint_effort", "joint_command", "base_pose"):
        assert getattr(run, name).tobytes() == getattr(expected, name).tobytes(), name
    assert run.base_twist.tobytes() == expected.base_twist.tobytes()


@pytest.mark.parametrize("law", LAWS)
def test_first_run(law: str, recorded: dict[str, tuple[Path, Ended]], simulated: dict[str, RunData]) -> None:
    folder, ended = recorded[law]
    run = read_run(folder / "bag")
    assert len(run.tick_ns) == TICKS
    assert [event.status for event in run.grasp_events] == [GraspStatus.SUCCEEDED] * 2
    assert_same_bits(run, simulated[law])
    assert "run complete at 2.04 s" in ended.out
    assert "grasp by arm_a: succeeded" in ended.err and "transfer by arm_b: succeeded" in ended.err


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("loaded", [False, True])
def test_further_run(
    law: str, loaded: bool, schedule: Path, simulated: dict[str, RunData], tmp_path: Path
) -> None:
    """A second time, and while as many other processes as there are cores never rest."""
    arguments = ("run", "--controller", law, "--schedule", schedule, "-o", "out")
    if loaded:
        with busy_cores():
            ended = sms_handover(*arguments, cwd=tmp_path)
    else:
        ended = sms_handover(*arguments, cwd=tmp_path)
    assert ended.code == 0, ended
    assert_same_bits(read_run(tmp_path / "out" / "bag"), simulated[law])


@pytest.mark.parametrize("transport", ["direct", "executor"])
@pytest.mark.parametrize("law", LAWS)
def test_run_in_one_process(
    law: str, transport: str, schedule: Path, simulated: dict[str, RunData], tmp_path: Path
) -> None:
    """The nodes of the loop in a container, each with a parameter of its own, and a recorder outside."""
    arguments = ["run", "--compose", "--controller", law, "--schedule", schedule, "-o", "out"]
    ended = sms_handover(*arguments, "-p", f"common.transport:={transport}", cwd=tmp_path)
    assert ended.code == 0, ended
    assert {path.stem for path in (tmp_path / "out" / "log").glob("*.log")} == {CONTAINER, RECORDER}
    assert_same_bits(read_run(tmp_path / "out" / "bag"), simulated[law])


def test_compiled_dynamics(schedule: Path, simulated: dict[str, RunData], tmp_path: Path) -> None:
    """They are the same in the graph and in one process, though not bit for bit Pinocchio's."""
    ended = sms_handover("run", "--dynamics", "compiled", "--schedule", schedule, "-o", "out", cwd=tmp_path)
    assert ended.code == 0, ended
    run = read_run(tmp_path / "out" / "bag")
    assert_same_bits(
        run, simulate(load_scenario({"common": {"schedule": str(schedule), "dynamics": "compiled"}}))
    )
    assert run.joint_velocity.tobytes() != simulated["nmpc"].joint_velocity.tobytes()


def test_the_laws_differ(simulated: dict[str, RunData]) -> None:
    """The comparison would notice: two runs of another law are not the same."""
    assert compare_runs(simulated["nmpc"], simulated["pid"])
