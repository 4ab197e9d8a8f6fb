"""A controller of somebody else's on the graph: with our helper, bare, started by hand; scored as ours."""

import json
import os
import subprocess
import sys
from pathlib import Path

import balancer
import my_law
import numpy as np
import pytest
from my_controller import task_space_pd

from sms_handover.analysis.equality import compare_runs
from sms_handover.bag.info import read_info
from sms_handover.bag.run.reader import read_run
from sms_handover.control.law import LawSetup
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import GraspStatus

from ..core.laws import offer
from .conftest import TICKS, Command
from .runs import DEADLINE_S, Ended, running, sms_handover

pytestmark = pytest.mark.system

NODES = {"helped": "my_controller.node", "bare": "my_controller.bare_node"}
LAWS = {"helped": "task_space_pd", "bare": "task_space_pd_bare"}
_ROUNDING = 1e-9  # [rad, N m] of the same law in other operations, within a second


@pytest.fixture(scope="module", autouse=True)
def examples_on_path(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Let processes import the examples and find the laws of two, as if all were installed."""
    inside = (task_space_pd.__file__, balancer.__file__)
    examples = [*(str(Path(file).parent.parent) for file in inside), str(Path(my_law.__file__).parent)]
    site = tmp_path_factory.mktemp("site")
    entry_points = str(offer(site, "my_law", joint_pd="my_law:LAW"))
    offer(site, "balancer", balancer="balancer.law:LAW")
    os.environ["PYTHONPATH"] = os.pathsep.join([*examples, entry_points, os.environ.get("PYTHONPATH", "")])
    sys.path.append(entry_points)


@pytest.fixture(scope="module")
def own(schedule: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, Ended]]:
    """The output folder of a run over DDS under each node, and what was printed."""
    folder = tmp_path_factory.mktemp("own")
    runs = {}
    for name, module in NODES.items():
        program = f"{sys.executable} -m {module}"
        if name == "helped":  # behind a shell, as behind any wrapper, it still knows its launcher
            program = f"bash -c '{program} \"$@\" & wait' bash"
        ended = sms_handover(
            "run", "--schedule", schedule, "--own-controller", program, "-o", name, cwd=folder
        )
        assert ended.code == 0, ended
        runs[name] = (folder / name, ended)
    return runs


@pytest.fixture(scope="module")
def in_one_process(schedule: Path) -> RunData:
    """The same law in one process."""
    scenario = load_scenario(values={"common": {"schedule": str(schedule)}})
    return simulate(scenario, controller=task_space_pd.TaskSpacePd(scenario.truth.robot))


def test_the_same_object_gives_the_same_bits_over_dds(
    own: dict[str, tuple[Path, Ended]], in_one_process: RunData
) -> None:
    recorded = read_run(own["helped"][0] / "bag")
    assert recorded.tick_ns.size == TICKS
    assert compare_runs(recorded, in_one_process) == ()


def test_a_law_of_a_small_package_is_as_one_of_ours(
    schedule: Path, recorded: dict[str, tuple[Path, Ended]], tmp_path: Path, called: Command
) -> None:
    """Found by its name, run over DDS in our node, recorded, made again, scored in one table, reported."""
    law = ("--controller", "joint_pd", "-p", "controller.frequency:=1.2")
    ended = sms_handover("run", *law, "--schedule", schedule, "-o", "mine", cwd=tmp_path)
    assert ended.code == 0, ended
    scenario = load_scenario(values={"common": {"schedule": str(schedule)}})
    gains = (my_law.Gains(frequency=1.2),) * len(scenario.model.schedule.phases)
    setup = LawSetup(scenario.model.robot, gains, scenario.parameters.common.tick_ns)
    by_hand = simulate(scenario, controller=my_law.JointPd(setup))
    assert compare_runs(read_run(tmp_path / "mine" / "bag"), by_hand) == ()
    assert read_info(tmp_path / "mine" / "bag").parameters["controller"]["frequency"] == 1.2
    assert sms_handover("verify", "mine", cwd=tmp_path).code == 0
    ours = (recorded["nmpc"][0], recorded["pid"][0])
    assert called("compare", "mine", *ours, "--csv", "all.csv", cwd=tmp_path).code == 0
    runs = [line.partition(",")[0] for line in (tmp_path / "all.csv").read_text().splitlines()[1:]]
    assert list(dict.fromkeys(runs)) == ["mine", "nmpc", "pid"]
    assert called("report", "mine", recorded["nmpc"][0], "-o", "page", cwd=tmp_path).code == 0
    assert "law joint_pd" in (tmp_path / "page" / "index.html").read_text(encoding="utf-8")


def test_a_law_with_every_need_has_the_same_bits_over_dds(schedule: Path, tmp_path: Path) -> None:
    """What it gets from its setup it gets in our node too; the bag has its solves."""
    task = ("--controller", "balancer", "--schedule", schedule, "--duration", "0.3")
    ended = sms_handover("run", *task, "-o", "mine", cwd=tmp_path)
    assert ended.code == 0, ended
    recorded = read_run(tmp_path / "mine" / "bag")
    common = {"schedule": str(schedule), "duration": 0.3}
    again = simulate(load_scenario(values={"common": common, "law": "balancer"}))
    assert compare_runs(recorded, again) == ()
    assert [plan.active for plan in recorded.plans] == [plan.active for plan in again.plans] != []


def test_a_bare_node_does_the_same(own: dict[str, tuple[Path, Ended]], in_one_process: RunData) -> None:
    recorded = read_run(own["bare"][0] / "bag")
    assert recorded.tick_ns.tobytes() == in_one_process.tick_ns.tobytes()
    for name in ("joint_position", "joint_command"):
        np.testing.assert_allclose(
            getattr(recorded, name), getattr(in_one_process, name), rtol=0.0, atol=_ROUNDING
        )


@pytest.mark.parametrize("name", NODES)
def test_nothing_is_missing_in_the_bag(own: dict[str, tuple[Path, Ended]], name: str) -> None:
    """Each state has its command; the bare node says how much it published to nobody, so stamps tell."""
    folder, _ = own[name]
    info = read_info(folder / "bag")
    assert info.ledger is not None and info.ledger.complete
    commands = next(topic for topic in info.ledger.topics if topic.name == "/joint_command")
    assert (commands.received, commands.missing, commands.duplicates) == (TICKS, 0, 0)
    assert commands.published == (TICKS if name == "helped" else None)
    assert info.parameters["controller"]["law"] == LAWS[name]
    events = read_run(folder / "bag").grasp_events
    assert [event.status for event in events] == [GraspStatus.SUCCEEDED] * 2


def test_it_is_scored_beside_ours(
    own: dict[str, tuple[Path, Ended]],
    recorded: dict[str, tuple[Path, Ended]],
    tmp_path: Path,
    called: Command,
) -> None:
    """The figures have a column of its own; the paper claims nothing of it, but still of our two."""
    mine, nmpc, pid = own["helped"][0], recorded["nmpc"][0], recorded["pid"][0]
    alone = called("compare", mine, nmpc, cwd=tmp_path)
    assert alone.out.splitlines()[0].split()[-2:] == ["helped", "nmpc"]
    assert "Claims of the paper" not in alone.out
    together = called("compare", mine, nmpc, pid, "--json", "all.json", cwd=tmp_path)
    claims = next(line for line in together.out.splitlines() if line.startswith("Claims of the paper"))
    assert claims.split()[-2:] == ["NMPC", "PID"]
    assert list(json.loads((tmp_path / "all.json").read_text())["runs"]) == ["helped", "nmpc", "pid"]
    done = called("report", mine, nmpc, "-o", "page", cwd=tmp_path)
    assert done.code == 0, done
    assert "law task_space_pd" in (tmp_path / "page" / "index.html").read_text(encoding="utf-8")


def test_its_commands_can_be_played_into_a_plant_but_not_made_again(
    own: dict[str, tuple[Path, Ended]], tmp_path: Path, called: Command
) -> None:
    folder, _ = own["helped"]
    again = called("verify", folder, cwd=tmp_path)
    assert again.code == 2
    assert again.errors[0].endswith("check a recording with 'sms-handover verify --with plant'")
    played = sms_handover("verify", folder, "--with", "plant", cwd=tmp_path)
    assert played.code == 0, played
    assert f"the same bit for bit as recorded: {TICKS} states" in played.out


def test_it_can_be_started_by_hand(schedule: Path, tmp_path: Path) -> None:
    """The run waits for it, however late it comes."""
    arguments = ("run", "--schedule", schedule, "--duration", "0.1", "--without-controller", "-o", "mine")
    with running(*arguments, cwd=tmp_path) as run:
        run.until(lambda: "ROS_DOMAIN_ID=" in run.text, "how to join")
        domain = run.text.split("ROS_DOMAIN_ID=", 1)[1].split()[0]
        run.until_all_nodes(["plant", "trajectory", "ik", "recorder"])
        environment = {**os.environ, "ROS_DOMAIN_ID": domain, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        by_hand = subprocess.Popen([sys.executable, "-m", NODES["bare"]], env=environment)
        try:
            assert run.end() == 0, run.text
            by_hand.terminate()
            assert by_hand.wait(DEADLINE_S) == 0
        finally:
            by_hand.kill()
            by_hand.wait()
    assert read_run(tmp_path / "mine" / "bag").tick_ns.size == 101


def test_one_that_dies_ends_the_run(schedule: Path, tmp_path: Path) -> None:
    """With its last words, in one line."""
    program = f"{sys.executable} -m {NODES['helped']}"
    arguments = ("run", "--compose", "--schedule", schedule, "--own-controller", program, "-o", "mine")
    ended = sms_handover(*arguments, "-p", "controller.stiffness:=-3.0", cwd=tmp_path)
    assert ended.code == 1
    assert "node 'controller' ended with exit code 2" in ended.err
    assert "controller: error: parameter 'stiffness' is -3.0 N/m, must be >= 0" in ended.err
