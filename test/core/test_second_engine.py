"""A second engine: its verdict on a run, from the bag alone; here our own stepper stands in for it."""

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.bag.recording import Recording
from sms_handover.cli import report as report_command
from sms_handover.cli import verify
from sms_handover.cli.main import main
from sms_handover.configuration.scenario_file import load_scenario_file
from sms_handover.engines.protocol import Effect, Motion, Replay
from sms_handover.engines.registry import ENGINES, load_engine
from sms_handover.engines.rigid_tree import centre_of_mass, chains, placed, rigid_bodies
from sms_handover.engines.verdict import verdict_of
from sms_handover.errors import BagError, MissingDependencyError
from sms_handover.frames import tool_frame
from sms_handover.model.conserved import conserved_quantities
from sms_handover.model.poses import pose_row
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.integrators import TABLEAUS
from sms_handover.plant.stepper import PinocchioStepper
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import Scenario, load_scenario, scenario_text
from sms_handover.simulation.simulate import simulate
from sms_handover.units import ns_to_seconds

from .bag_messages import TYPES, open_topics, record_run

ROTOR = 0.125  # kg m^2
NAME = "planar"
VALUES = {
    "common": {"duration": 0.5},
    "robot.arms.arm_a.rotor_inertia": [ROTOR, 0.0],
}


class Ours:
    """Our own stepper as a second engine, which adds ``error`` to the first joint at the end."""

    title = "ours 1.0"
    lacks: Mapping[Effect, str] = {Effect.JOINT_STOPS: "it has none"}

    def __init__(self, robot: RobotModel, error: float = 0.0) -> None:
        self._robot, self._error = robot, error

    def run(self, replay: Replay) -> Motion:
        robot = self._robot
        assert (replay.urdf, dict(replay.rotor_inertia)) == (robot.urdf, robot.description.rotor_inertia)
        stepper = PinocchioStepper(robot, TABLEAUS["rk4"], ns_to_seconds(replay.tick_ns))
        states = [(replay.start_q, replay.start_v)]
        for effort in replay.efforts:
            states.append(stepper.step(*states[-1], effort))
        taken = [states[sample] for sample in replay.samples]
        sums = [conserved_quantities(robot, *state) for state in taken]
        tools = {arm: np.array([pose_row(robot.tools_at(q)[arm]) for q, _ in taken]) for arm in replay.arms}
        rows = np.array([q for q, _ in taken])
        rows[-1, BASE_NQ] += self._error
        linear, angular = ([getattr(each, f"{n}_momentum") for each in sums] for n in ("linear", "angular"))
        momenta = np.array(linear), np.array(angular)
        return Motion(rows, tools, *momenta, np.empty((0, 7)), np.empty((0, 6)))


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    """Half a second of two planar arms, one of which has a rotor."""
    return load_scenario(NAME, VALUES)


@pytest.fixture(scope="module")
def run(scenario: Scenario) -> RunData:
    return simulate(scenario)


@pytest.fixture(scope="module")
def bag(scenario: Scenario, run: RunData, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag that says of the run what the recorder says."""
    folder, given = tmp_path_factory.mktemp("bags") / "run", scenario.parameters
    common = {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(given.common).items()}
    values = {
        "plant": {**common, **asdict(given.plant)},
        "trajectory": {**common, **asdict(given.trajectory)},
        "ik": {**common, **asdict(given.ik)},
    }
    with Recording(folder, types=TYPES) as recording:
        recording.describe(
            urdf=scenario.truth.robot.urdf,
            schedule=scenario.truth.schedule.text,
            scenario=scenario_text(given.common, load_scenario_file(NAME)),
            parameters={**values, "controller": {**common, "law": given.controller.law}},
        )
        open_topics(recording, arms=run.arms)
        record_run(recording, run)
    return folder


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch, scenario: Scenario) -> Callable[[float], None]:
    """Let the commands take our stepper for MuJoCo, with an error of so many rad."""

    def take(error: float) -> None:
        for module in (verify, report_command):
            monkeypatch.setattr(module, "load_engine", lambda name: Ours(scenario.truth.robot, error))

    return take


def test_our_stepper_as_an_engine_repeats_the_run(scenario: Scenario, run: RunData) -> None:
    """From what the bag carries, rotor included, not one bit of joints and base differs."""
    verdict = verdict_of(Ours(scenario.truth.robot), run, scenario, NAME)
    assert verdict.agrees and verdict.bounds == NAME and verdict.states == run.reference_ns.size
    assert {each.quantity: each.largest for each in verdict.differences[:1]} == {"joints": 0.0}
    assert len(verdict.differences) == 7 and all(each.largest < 1e-15 for each in verdict.differences)
    assert verdict_of(Ours(scenario.truth.robot), run, scenario, "mine.yaml").bounds == "paper"


@pytest.mark.parametrize(("error", "code", "told"), [(0.0, 0, "the same within"), (1e-6, 1, "beyond it")])
def test_verify_reads_all_of_it_from_the_bag(
    error: float, code: int, told: str, bag: Path, asked: Callable[[float], None],
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    asked(error)
    assert main(["verify", str(bag), "--with", "mujoco"]) == code
    assert told in capsys.readouterr().out
    assert main(["verify", str(bag), "--with", "mujoco", "--json"]) == code
    (found,) = json.loads(capsys.readouterr().out)
    joints = found["differences"][0]
    assert found["agrees"] == (code == 0) and joints["quantity"] == "joints"
    assert joints["largest"] == pytest.approx(error, abs=1e-12) and joints["within"] == (code == 0)
    assert joints["time"] == 0.5 or not error


def test_a_report_has_the_verdict(bag: Path, asked: Callable[[float], None], tmp_path: Path) -> None:
    asked(1e-6)
    page = tmp_path / "page.html"
    assert main(["report", str(bag), "--with", "mujoco", "-o", str(page)]) == 0
    assert '<li class="bad">not confirmed by ours 1.0: joints 1.0e-06 rad, bound 1e-09' in page.read_text()


def test_what_an_engine_lacks_is_one_line(scenario: Scenario, run: RunData) -> None:
    enforced = replace(scenario.parameters.plant, joint_limits="enforce")
    stops = replace(scenario, parameters=replace(scenario.parameters, plant=enforced))
    verdict = verdict_of(Ours(scenario.truth.robot), run, stops, NAME)
    assert [*verdict.lines()] == ["not supported by ours 1.0: joint stops: it has none"]
    assert not verdict.agrees


def test_a_gap_cannot_be_replayed(scenario: Scenario, run: RunData) -> None:
    effort = np.array(run.joint_effort)
    effort[200] = np.nan
    with pytest.raises(BagError, match=r"lacks 1 states or efforts, the first after 0\.199 s"):
        verdict_of(Ours(scenario.truth.robot), replace(run, joint_effort=effort), scenario, NAME)


def test_an_engine_that_diverges_does_not_agree(scenario: Scenario, run: RunData) -> None:
    verdict = verdict_of(Ours(scenario.truth.robot, np.nan), run, scenario, NAME)
    assert not verdict.agrees and json.loads(json.dumps(verdict.plain()))["differences"][0]["largest"] is None


@pytest.mark.parametrize("name", ENGINES)
def test_without_its_package_the_extra_is_named(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, ENGINES[name].imported, None)
    for module in [m for m in sys.modules if m.startswith("sms_handover.engines.in_")]:
        monkeypatch.delitem(sys.modules, module)
    with pytest.raises(MissingDependencyError, match=rf"pip install 'sms_handover\[{name}\]'"):
        load_engine(name)


def test_rigid_bodies_are_where_pinocchio_has_them() -> None:
    """Fixed joints merged: tools, total mass, centre of mass and its velocity at a random state."""
    robot = load_scenario("three_arms").truth.robot
    random = np.random.default_rng(4)
    turn = random.normal(size=4)
    joints = random.uniform(robot.lower, robot.upper)
    q = np.concatenate([[0.3, -0.2, 0.1], turn / np.linalg.norm(turn), joints])
    v = random.uniform(-1.0, 1.0, robot.pin.nv)
    bodies = rigid_bodies(robot.urdf)
    assert [len(chain) for chain in chains(bodies)] == [7, 7, 7]
    order = [robot.joint_names.index(body.joint) for body in bodies[1:]]
    axes = pin.Quaternion(q[3:BASE_NQ]).matrix()
    frames = placed(bodies, (axes, q[:3]), joints[order])
    twist = axes @ v[:3], axes @ v[3:BASE_NV]
    centre, velocity = centre_of_mass(bodies, frames, twist, v[BASE_NV:][order])
    conserved = conserved_quantities(robot, q, v)
    np.testing.assert_allclose(centre, conserved.centre_of_mass, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(velocity, conserved.linear_momentum / robot.mass, rtol=0.0, atol=1e-14)
    for arm, pose in robot.tools_at(q).items():
        (place,) = [frames[i] for i, body in enumerate(bodies) if tool_frame(arm) in body.frames]
        (inner,) = [body.frames[tool_frame(arm)] for body in bodies if tool_frame(arm) in body.frames]
        np.testing.assert_allclose(place[1] + place[0] @ inner[1], pose.position, rtol=0.0, atol=1e-14)


def test_the_mjcf_of_a_bag_has_the_rotors_of_its_scenario(bag: Path, tmp_path: Path) -> None:
    assert main(["bag", "robot", str(bag), "-o", str(tmp_path / "robot")]) == 0
    assert (tmp_path / "robot" / "robot.xml").read_text().count(f'armature="{ROTOR}"') == 1
