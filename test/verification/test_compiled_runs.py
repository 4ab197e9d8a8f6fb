"""Compiled dynamics: whole runs, many robots and requests, against Python and Pinocchio."""

import logging
from pathlib import Path

import numpy as np
import pytest

from sms_handover.compiled.dynamics import CompiledStepper
from sms_handover.ik.levenberg_marquardt import Solution, find_joints
from sms_handover.plant.integrators import TABLEAUS
from sms_handover.simulation import loop
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.wiring import make_ik
from sms_handover.types import IkRequest
from test.core.test_quiet_periods import python_loop, require_same, rest_of
from test.evidence import Record

ROBOTS = 100  # of one kind
_FOUR_ARMS = """
extends: three_arms
common: {dynamics: compiled, duration: 20.0}
robot:
  arms:
    arm_d:
      description: DESCRIPTION
      mount: {xyz: [-0.5, 0.0, 0.0], rpy: [0.0, -1.5707963267948966, 0.0]}
      gripper: {mass: 0.6451, radius: 0.05, length: 0.12}
      rotor_inertia: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
schedule:
  initial: {joints: {arm_d: [0.0, -1.0, 0.0, 1.5, 0.0, -0.5, 0.0]}}
  phases:
"""


def _four_arms(folder: Path) -> str:
    """Return a scenario with a fourth arm on the far side, which moves as the others pass the deputy on."""
    names = [phase.name for phase in load_scenario("three_arms").model.schedule.phases]
    goals = ["hold", "{joints: [0.5, -1.2, 0.3, 1.0, 0.2, -0.8, 0.1]}"]
    lines = [f"    {name}: {{arms: {{arm_d: {goals[i % 2]}}}}}" for i, name in enumerate(names)]
    file = folder / "four_arms.yaml"
    shipped = Path(__file__).resolve().parents[2] / "config" / "gen3.yaml"
    text = _FOUR_ARMS.replace("DESCRIPTION", str(shipped)) + "\n".join(lines)
    file.write_text(f"{text}\n", encoding="utf-8")
    return str(file)


@pytest.mark.parametrize(
    ("name", "law"),
    [
        *((name, law) for name in ("paper", "smooth") for law in ("nmpc", "pid")),
        *((name, "nmpc") for name in ("one_arm", "three_arms", "six_joints", "planar", "four arms")),
    ],
)
def test_a_whole_run_in_c(name: str, law: str, tmp_path: Path, record: Record) -> None:
    """Every field of it; quiet periods in C, and each period and tick by Python."""
    source = _four_arms(tmp_path) if name == "four arms" else name
    scenario = load_scenario(source, {"law": law, "common.dynamics": "compiled"})
    run = simulate(scenario)
    try:
        require_same(run, rest_of(python_loop(scenario))[0])
        different = 0
    except AssertionError:
        different = 1
    last_s = run.tick_ns[-1] / 1e9
    record(f"{name}, {law}: {last_s:g} s differ in any bit", different, 0, against="the loop in Python")
    assert run.reference_ns.size * 20 >= run.tick_ns.size - 1


@pytest.mark.parametrize(("name", "law"), [("paper", "nmpc"), ("paper", "pid"), ("smooth", "nmpc")])
def test_a_whole_run_is_that_of_pinocchio(name: str, law: str, record: Record) -> None:
    """With a different rounding in every operation."""
    ours, theirs = (
        simulate(load_scenario(name, {"law": law, "common.dynamics": dynamics}))
        for dynamics in ("compiled", "pinocchio")
    )
    apart = float(np.abs(ours.joint_position - theirs.joint_position).max())
    record(f"{name}, {law}: largest difference of a joint", apart, 1e-9, unit="rad", against="Pinocchio")


@pytest.mark.parametrize("name", ["paper", "smooth"])
def test_inverse_kinematics_of_a_whole_run(
    name: str, record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each request that the trajectory makes, solved by both."""
    scenario = load_scenario(name, {"common.dynamics": "compiled"})
    requests: list[IkRequest] = []

    def kept(request: IkRequest) -> Solution:
        requests.append(request)
        return solve(request)

    python = load_scenario(name)
    solve = make_ik(python.model.robot, python.parameters.common, python.parameters.ik)
    monkeypatch.setattr(loop, "make_ik", lambda *_: kept)
    simulate(python)
    robot, parameters = scenario.model.robot, scenario.parameters
    compiled = make_ik(robot, parameters.common, parameters.ik)
    unequal, apart = 0, 0.0
    for request in requests:
        one, other = compiled(request), find_joints(robot, request, parameters.ik)
        unequal += (one.status, one.iterations) != (other.status, other.iterations)
        apart = max(apart, float(np.abs(one.joint_position - other.joint_position).max()))
    text = f"{name}: of {len(requests)} requests"
    record(f"{text}, those with another outcome or count of iterations", unequal, 0, against="Pinocchio")
    record(f"{text}, largest difference of a joint", apart, 1e-10, unit="rad", against="Pinocchio")


def test_robots_of_one_kind(record: Record, caplog: pytest.LogCaptureFixture) -> None:
    """Other masses, centres and inertias are arguments of the library."""
    random = np.random.default_rng(17)
    CompiledStepper(load_scenario("paper").truth.robot, TABLEAUS["rk4"], 1e-3)
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        for _ in range(ROBOTS):
            values = {
                "robot.base.mass": float(random.uniform(100.0, 400.0)),
                "robot.base.com": random.uniform(-0.1, 0.1, 3).tolist(),
                "robot.arms.arm_a.gripper.mass": float(random.uniform(0.1, 3.0)),
                "robot.arms.arm_b.description.joints[3].link.mass": float(random.uniform(0.5, 1.5)),
            }
            CompiledStepper(load_scenario("paper", values).truth.robot, TABLEAUS["rk4"], 1e-3)
    record(f"{ROBOTS} robots of one kind: compilations", len(caplog.records), 0, against="the first one's")
