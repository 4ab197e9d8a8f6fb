"""A recorded run over DDS is the run in one process, bit for bit, whatever else the machine does."""

import json
from pathlib import Path

import pytest

from sms_handover.analysis.equality import compare_runs, run_digest
from sms_handover.bag.files import read_messages
from sms_handover.bag.info import read_info
from sms_handover.bag.run.reader import read_run
from sms_handover.campaign.record.campaign_folder import CampaignFolder
from sms_handover.graph.topics import CLEARANCE, CONTAINER, RECORDER, VISION
from sms_handover.launcher.recorded_scenario import scenario_in
from sms_handover.messages.stamps import stamp_ns
from sms_handover.run_data import RunData
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import GraspStatus

from .conftest import LAWS, TICKS
from .runs import Ended, busy_cores, running, sms_handover

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
    assert "run complete at 1.02 s" in ended.out
    assert "grasp by arm_a: succeeded" in ended.err and "transfer by arm_b: succeeded" in ended.err


def test_a_capture_with_a_jump(schedule: Path, tmp_path: Path) -> None:
    """A deputy of 12 kg passes by at 50 mm/s, tumbling, and is caught; the model has half of its mass."""
    values = {
        "deputy.mass": 12.0,  # [kg]
        "deputy.twist_in_world": {"linear": [0.05, 0.0, 0.0], "angular": [0.0, 0.1, 0.05]},  # [m/s], [rad/s]
        "model.deputy.mass": 6.0,  # [kg]
        "plant.grasp_position_tolerance": 0.05,  # [m]
        "plant.grasp_speed_tolerance": 0.2,  # [m/s]
        "plant.grasp_rate_tolerance": 0.5,  # [rad/s]
    }
    given = [word for path, value in values.items() for word in ("-p", f"{path}:={json.dumps(value)}")]
    ended = sms_handover("run", "--schedule", schedule, "-o", "out", *given, cwd=tmp_path)
    assert "grasp by arm_a: succeeded" in ended.err, ended
    run = read_run(tmp_path / "out" / "bag")
    assert run.grasp_events[0].energy_lost > 0.0
    assert_same_bits(run, simulate(scenario_in(read_info(tmp_path / "out" / "bag"), tmp_path)))


def test_runs_side_by_side_do_not_hear_each_other(
    schedule: Path, simulated: dict[str, RunData], tmp_path: Path
) -> None:
    """Each takes a domain of its own, so both are whole, under different laws, a second time."""
    with running("run", "--schedule", schedule, "-o", "nmpc", cwd=tmp_path) as one:
        other = sms_handover("run", "--schedule", schedule, "--controller", "pid", "-o", "pid", cwd=tmp_path)
        assert (one.end(), other.code) == (0, 0), one.text + other.out + other.err
        domains = {text.split("running on ROS domain ")[1].split(",")[0] for text in (one.text, other.out)}
    assert len(domains) == 2
    for law in LAWS:
        assert_same_bits(read_run(tmp_path / law / "bag"), simulated[law])


def test_run_on_busy_cores(schedule: Path, simulated: dict[str, RunData], tmp_path: Path) -> None:
    """While as many other processes as there are cores never rest."""
    with busy_cores():
        ended = sms_handover("run", "--schedule", schedule, "-o", "out", cwd=tmp_path)
    assert ended.code == 0, ended
    assert_same_bits(read_run(tmp_path / "out" / "bag"), simulated["nmpc"])


def test_a_predictive_law(schedule: Path, tmp_path: Path) -> None:
    """Its plans too, with the limits that bind: all but the wall times of the solves."""
    limits = {"joint_rate_limit": 1.0, "base_rate_limit": 0.1, "least_distance": 0.01}
    options = [part for name, value in limits.items() for part in ("-p", f"controller.{name}:={value}")]
    command = ("run", "--controller", "mpc", *options, "--schedule", schedule, "-o", "mpc")
    ended = sms_handover(*command, cwd=tmp_path)
    assert ended.code == 0, ended
    values = {"common": {"schedule": str(schedule)}, "controller": {"law": "mpc", **limits}}
    expected, recorded = simulate(load_scenario(values=values)), read_run(tmp_path / "mpc" / "bag")
    assert compare_runs(recorded, expected) == ()
    assert len(recorded.plans) == len(recorded.reference_ns)
    assert all(plan.total_time > plan.program_time > 0.0 for plan in recorded.plans)
    assert {row for plan in recorded.plans for row in plan.active}


@pytest.mark.parametrize(("law", "transport"), [("nmpc", "direct"), ("pid", "executor")])
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
        run,
        simulate(load_scenario(values={"common": {"schedule": str(schedule), "dynamics": "compiled"}})),
    )
    assert run.joint_velocity.tobytes() != simulated["nmpc"].joint_velocity.tobytes()


def test_a_run_under_harsh_conditions(schedule: Path, tmp_path: Path) -> None:
    """With noise, delay, friction, wrenches, model error, and sensors that all go by: twice, and verified."""
    given = (
        *("--conditions", "harsh", "-p", "seed:=4", "-p", "conditions.command.delay:=0.003"),
        *("-p", "source:=measured", "-p", "conditions.sensors.vision.latency:=0.03"),
    )
    values = {"common": {"schedule": str(schedule), "conditions": "harsh", "seed": 4, "source": "measured"}}
    sooner = {"conditions.command.delay": 0.003, "conditions.sensors.vision.latency": 0.03}
    expected = simulate(load_scenario(values={**values, **sooner}))
    assert expected.linear_impulse[-1].any() and expected.lost[-1] > 0.0
    for name, more in (("one", ()), ("two", ("--compose",))):
        ended = sms_handover("run", *given, *more, "--schedule", schedule, "-o", name, cwd=tmp_path)
        assert ended.code in (0, 4), ended  # grasps may miss
        assert_same_bits(read_run(tmp_path / name / "bag"), expected)
    bag = tmp_path / "one" / "bag"
    recorded = read_run(bag).measured
    assert recorded is not None and expected.measured is not None
    assert recorded.base_twist.tobytes() == expected.measured.base_twist.tobytes()
    given_late = [stamp_ns(message.data) for message in read_messages(bag, [f"/{VISION}"])]
    assert given_late and all(at_ns % 100_000_000 == 0 for at_ns in given_late)  # as it was measured
    assert sms_handover("verify", bag, cwd=tmp_path).code == 0


def test_a_collision_ends_the_run_in_the_same_tick(schedule: Path, tmp_path: Path) -> None:
    """The plant measures, the trajectory gives up a period later; the bag is whole, and names the bodies.

    The gripper that has let go is more than 1 mm in the deputy at 0.86 s.
    """
    abort = ("-p", "common.on_collision:=abort", "-p", "trajectory.failure_hold:=0.05")
    arguments = ("run", "--compose", "--time-law", "step", "--schedule", schedule, *abort, "-o", "out")
    ended = sms_handover(*arguments, cwd=tmp_path, dry_run=True)
    assert "warning: in a dry run bodies collide from 0.86 s on, at worst arm_a_gripper" in ended.err
    assert ended.code == 1 and "phase 'withdraw' has failed at 0.93 s" in ended.out, ended
    assert "arm_a_gripper and deputy overlap by 1.00 mm at 0.86 s; the joints are held" in ended.err
    bag = tmp_path / "out" / "bag"
    assert sms_handover("bag", "check", bag, cwd=tmp_path).code == 0
    common = {"schedule": str(schedule), "on_collision": "abort"}
    scenario = load_scenario(
        values={"common": common, "trajectory": {"failure_hold": 0.05, "time_law": "step"}}
    )
    assert_same_bits(read_run(bag), simulate(scenario))
    assert measured_in(bag) == measured_by(scenario)


def measured_in(bag: Path) -> list[list[tuple[float, list[float]]]]:
    """Return the distance and the nearest points of every group of bodies, by period, as recorded."""
    types = read_info(bag).topics[f"/{CLEARANCE}"].types
    messages = [types.decode(message.data) for message in read_messages(bag, [f"/{CLEARANCE}"])]
    points = [
        [(item.distance, [item.first_point, item.second_point]) for item in message.groups]
        for message in messages
    ]
    return [[(d, [c for p in pair for c in (p.x, p.y, p.z)]) for d, pair in groups] for groups in points]


def measured_by(scenario: Scenario) -> list[list[tuple[float, list[float]]]]:
    """Return the same of a run in one process."""
    loop, found = Loop(scenario), []
    while not loop.finished:
        period = loop.advance().period
        if period and period.clearance:
            groups = period.clearance.groups
            found.append([(g.distance, g.nearest.points_in_world.ravel().tolist()) for g in groups])
    return found


def test_every_node_has_the_robot_that_is_its(
    schedule: Path, simulated: dict[str, RunData], tmp_path: Path
) -> None:
    """The plant is heavier than all others believe: read back from the bag, and repeated bit for bit."""
    scenario = tmp_path / "heavy.yaml"
    truth = "truth: {robot: {base: {mass: 264.0}}}"
    scenario.write_text(f"extends: paper\nschedule: {schedule}\n{truth}\n", encoding="utf-8")
    believed = "model.robot.arms.arm_a.gripper.mass:=0.7"
    ended = sms_handover("run", scenario, "-p", believed, "-o", "out", cwd=tmp_path)
    assert ended.code == 0, ended
    bag = tmp_path / "out" / "bag"
    same = load_scenario(scenario, {"model.robot.arms.arm_a.gripper.mass": 0.7})
    assert_same_bits(read_run(bag), simulate(same))
    assert compare_runs(read_run(bag), simulated["nmpc"])
    found = scenario_in(read_info(bag), tmp_path)
    assert (found.truth.robot.urdf, found.model.robot.urdf) == (same.truth.robot.urdf, same.model.robot.urdf)
    assert found.truth.robot.mass - found.model.robot.mass == pytest.approx(24.0 - (0.7 - 0.6451))
    scenario.unlink()  # the bag alone says what it was made with
    assert sms_handover("verify", bag, cwd=tmp_path).code == 0


def test_the_laws_differ(simulated: dict[str, RunData]) -> None:
    """The comparison would notice: two runs of another law are not the same."""
    assert compare_runs(simulated["nmpc"], simulated["pid"])


def test_a_case_of_a_campaign_is_recorded_as_it_was_run(tmp_path: Path) -> None:
    campaign = {
        "name": "one",
        "seed": 3,
        "cases": 1,
        "scenarios": {"smooth": "smooth"},
        "laws": ["nmpc"],
        "values": {"common.duration": 0.1},  # [s]
        "draws": {"truth.robot.base.mass": {"normal": {"mean": 240.0, "std": 12.0}}},  # [kg]
        "worst_by": "peak_torque",
        "keep": {"worst": 1, "worst_as": "bag"},
    }
    (tmp_path / "one.yaml").write_text(json.dumps(campaign), encoding="utf-8")
    ended = sms_handover("campaign", "run", "one.yaml", "-o", "out", cwd=tmp_path)
    assert ended.code == 0 and "out/bags/0_smooth_nmpc: equal to its row, bit for bit" in ended.out, ended
    (entry,) = CampaignFolder(tmp_path / "out").entries()
    assert run_digest(read_run(tmp_path / "out" / "bags" / "0_smooth_nmpc" / "bag")) == entry.row.run_digest
    assert not list(tmp_path.glob("out/bags/.*"))
