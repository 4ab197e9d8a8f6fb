"""A payload is carried as a part of the last link, and known to laws and references by events."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.control.controller import JointController
from sms_handover.control.protocol import Carrying, Controller, Guidance
from sms_handover.errors import ConfigurationError
from sms_handover.model.carrying import carrying
from sms_handover.model.floating_model import floating_model
from sms_handover.model.known_payload import EMPTY_HANDS, Grip, KnownPayload
from sms_handover.model.poses import se3_of
from sms_handover.model.reduced import carried_twist, drift_of_base, generalized_jacobian
from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.scenario import Overrides, Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.snapshot import load_snapshot, save_snapshot
from sms_handover.simulation.wiring import make_controller
from sms_handover.trajectory.generator import Targets, TrajectoryGenerator
from sms_handover.types import (
    GraspAction,
    GraspCommand,
    GraspEvent,
    GraspStatus,
    JointReference,
    TaskPhase,
    Twist,
)

from ..ros.short_handover import short_handover
from .conftest import Draw, MakeScenario, state_of
from .loop_rest import bytes_of, digest_of_rest

_TICK_NS = 1_000_000  # [ns]
_TOLERANT: dict[str, object] = {
    "grasp_position_tolerance": 0.05,  # [m]
    "grasp_speed_tolerance": 0.2,  # [m/s]
    "grasp_rate_tolerance": 0.5,  # [rad/s]
}
_PASSING: dict[str, object] = {
    "mass": 12.0,  # [kg]
    "twist_in_world": {"linear": [0.05, 0.0, 0.0], "angular": [0.0, 0.1, 0.05]},  # [m/s], [rad/s]
}
GRASP = GraspCommand(GraspAction.GRASP, "arm_a", "left")
TRANSFER = GraspCommand(GraspAction.TRANSFER, "arm_b", "right", "arm_a")
RELEASE = GraspCommand(GraspAction.RELEASE, "arm_b")


def event_of(
    command: GraspCommand, status: GraspStatus = GraspStatus.SUCCEEDED, stamp_ns: int = 0
) -> GraspEvent:
    return GraspEvent(stamp_ns, command, status, 0.0, 0.0, 0.0, "")


def same_model(one: RobotModel, other: RobotModel) -> bool:
    """Return whether two robots have the same inertias to the bit."""
    pairs = zip(one.pin.inertias, other.pin.inertias, strict=True)
    return all(np.array_equal(a.toDynamicParameters(), b.toDynamicParameters()) for a, b in pairs)


@pytest.mark.parametrize("arm", ["arm_a", "arm_b"])
def test_a_payload_is_a_further_link_fixed_to_the_tool(robot: RobotModel, draw: Draw, arm: str) -> None:
    """As a robot description says it, with the inertia merged by Pinocchio's own parser."""
    body = pin.Inertia(12.0, np.array([0.02, -0.01, 0.03]), np.diag([0.16, 0.16, 0.07]))
    place = se3_of(draw.pose(0.2))
    xyz, rpy = (
        " ".join(map(repr, part.tolist()))
        for part in (place.translation, pin.rpy.matrixToRpy(place.rotation))
    )
    cargo = f"""<link name="cargo"><inertial><origin xyz="0.02 -0.01 0.03"/><mass value="12"/>
      <inertia ixx="0.16" ixy="0" ixz="0" iyy="0.16" iyz="0" izz="0.07"/></inertial></link>
      <joint name="grip" type="fixed"><parent link="{arm}_tool"/><child link="cargo"/>
      <origin xyz="{xyz}" rpy="{rpy}"/></joint></robot>"""
    expected = floating_model(robot.urdf.replace("</robot>", cargo))
    expected.gravity.setZero()
    bare = [inertia.toDynamicParameters() for inertia in robot.pin.inertias]
    loaded = carrying(robot, arm, body, place)
    assert loaded.mass == pytest.approx(robot.mass + 12.0)
    data = expected.createData()
    for _ in range(5):
        q, v, a = draw.q(), draw.v(), draw.v()
        inertia = pin.crba(expected, data, q, pin.Convention.LOCAL)
        found = pin.crba(loaded.pin, loaded.data, q, pin.Convention.LOCAL)
        np.testing.assert_allclose(found, inertia, rtol=0.0, atol=1e-11)
        forces = pin.rnea(expected, data, q, v, a)
        np.testing.assert_allclose(pin.rnea(loaded.pin, loaded.data, q, v, a), forces, rtol=0.0, atol=1e-11)
    assert np.array_equal([inertia.toDynamicParameters() for inertia in robot.pin.inertias], bare)


def test_events_tell_who_carries(make_scenario: MakeScenario) -> None:
    """What was missed or rejected changes nothing; empty hands are the bare robot itself."""
    scenario = make_scenario(deputy={"mass": 4.0})
    robot, deputy = scenario.truth.robot, scenario.truth.schedule.deputy
    known = KnownPayload(robot, deputy)
    assert known.has_mass and known.robot is robot
    assert not known.grasped(event_of(GRASP, GraspStatus.MISSED)) and known.grip == EMPTY_HANDS
    for command, grip in ((GRASP, Grip("arm_a", "left")), (TRANSFER, Grip("arm_b", "right"))):
        assert known.grasped(event_of(command)) and known.grip == grip
        in_tool = se3_of(deputy.grasp_frames[grip.grasp_frame]).inverse()
        assert deputy.inertia is not None
        assert same_model(known.robot, carrying(robot, grip.arm, deputy.inertia, in_tool))
        assert not same_model(known.robot, robot)
    assert not known.grasped(event_of(RELEASE, GraspStatus.REJECTED)) and known.grip.arm == "arm_b"
    assert known.grasped(event_of(RELEASE)) and known.robot is robot
    massless = KnownPayload(robot, make_scenario().truth.schedule.deputy)
    assert not massless.grasped(event_of(GRASP)) and massless.robot is robot


def controller_of(scenario: Scenario, robot: RobotModel | None = None, mass: bool = True) -> Controller:
    """Return the controller of a scenario, of another robot or without a deputy that has mass."""
    schedule = scenario.truth.schedule
    if not mass:
        schedule = replace(schedule, deputy=replace(schedule.deputy, body=None))
    parameters = scenario.parameters
    return make_controller(robot or scenario.truth.robot, schedule, parameters.common, parameters.controller)


def test_a_law_carries_from_the_first_state_after_the_event(make_scenario: MakeScenario) -> None:
    """At the state of the event its efforts are those of the bare robot, to the bit; then of both."""
    scenario = make_scenario(deputy={"mass": 12.0})
    robot, deputy = scenario.truth.robot, scenario.truth.schedule.deputy
    draw = Draw(robot, seed=3)
    q, v = draw.q(), draw.v(0.1)
    reference = JointReference(0, q[7:] + 0.01, np.zeros(robot.n_joints))
    guidance = Guidance(TaskPhase(0, 0, "approach"), reference, {})
    assert deputy.inertia is not None
    in_tool = se3_of(deputy.grasp_frames["left"]).inverse()
    loaded = carrying(robot, "arm_a", deputy.inertia, in_tool)
    knows, bare = controller_of(scenario), controller_of(scenario, mass=False)
    carries = controller_of(scenario, loaded, mass=False)
    assert isinstance(knows, JointController) and isinstance(knows, Carrying)
    for controller in (knows, bare, carries):
        controller.guide(guidance)
    knows.grasped(event_of(GRASP, stamp_ns=_TICK_NS))
    pending = knows.state
    at_event, after = (bytes(knows.effort(stamp, q, v)) for stamp in (_TICK_NS, 2 * _TICK_NS))
    assert at_event == bytes(bare.effort(_TICK_NS, q, v)) != after
    assert after == bytes(carries.effort(2 * _TICK_NS, q, v))
    knows.restore(pending)  # the event not yet heeded
    assert bytes(knows.effort(_TICK_NS, q, v)) == at_event
    assert bytes(knows.effort(2 * _TICK_NS, q, v)) == after
    knows.reset()
    knows.guide(guidance)
    assert bytes(knows.effort(2 * _TICK_NS, q, v)) == bytes(bare.effort(2 * _TICK_NS, q, v))


def test_tools_move_as_asked_on_a_robot_with_momentum(make_scenario: MakeScenario) -> None:
    """Tools have the twists asked for at the joint rates of the reference, with the base as momentum says.

    The hands shall stand still in the world while the whole spins after a capture. Without the part of the
    momentum they would be carried along at several millimetres per second.
    """
    scenario = make_scenario(deputy={"mass": 12.0})
    robot, schedule = scenario.truth.robot, scenario.truth.schedule
    generator = TrajectoryGenerator(robot, schedule, scenario.parameters.trajectory)
    generator.grasped([event_of(GRASP)])
    deputy = schedule.deputy
    assert deputy.inertia is not None
    loaded = carrying(robot, "arm_a", deputy.inertia, se3_of(deputy.grasp_frames["left"]).inverse())
    joints = np.array([0.7, -1.7, 1.4, 1.9, 1.6, -1.4, 1.2, -0.7, -1.7, -1.4, 1.9, -1.6, -1.4, -1.2])  # [rad]
    q = robot.configuration(schedule.base_in_world, joints)
    v = np.concatenate([[0.004, -0.002, 0.003, 0.002, 0.005, -0.003], np.full(14, 0.01)])
    tools, still = robot.tools_at(q), Twist(np.zeros(3), np.zeros(3))
    state = state_of(robot, q, v)
    twists = {"arm_a": still, "arm_b": Twist(np.array([0.01, 0.0, -0.02]), np.array([0.0, 0.03, 0.0]))}
    targets = Targets(0, tools, twists, joints, np.zeros(14))
    reference, _ = generator.reference(state, targets, joints)
    inertia = pin.crba(loaded.pin, loaded.data, q, pin.Convention.LOCAL)
    momentum = inertia[:BASE_NV] @ v
    rates = reference.velocity
    base = np.linalg.solve(inertia[:BASE_NV, :BASE_NV], momentum - inertia[:BASE_NV, BASE_NV:] @ rates)
    for arm, twist in twists.items():
        _, moves = robot.tool_motion(q, np.concatenate([base, rates]), arm)
        np.testing.assert_allclose(moves.row, twist.row, rtol=0.0, atol=1e-6)  # [m/s], [rad/s] by the damping
    carried = carried_twist(state.base_in_world, drift_of_base(loaded, q, v), tools["arm_a"].position)
    assert np.linalg.norm(carried.linear) > 2e-3  # [m/s] it would be off by that
    whole = generalized_jacobian(loaded, q, "arm_a") @ v[BASE_NV:] + carried.row
    np.testing.assert_allclose(whole, robot.tool_motion(q, v, "arm_a")[1].row, rtol=0.0, atol=1e-14)


def passing(folder: Path, **deputy: object) -> Overrides:
    """Return a handover of a third of a second whose deputy passes by, tumbling, and is caught in a jump."""
    schedule = folder / "short.yaml"
    schedule.write_text(short_handover(), encoding="utf-8")
    return {"common": {"schedule": str(schedule)}, "plant": _TOLERANT, "deputy": {**_PASSING, **deputy}}


def test_a_run_with_a_payload_goes_on_from_any_snapshot(tmp_path: Path) -> None:
    """With the deputy tumbling, at the state of a grasp, in either hand, and after a reset, to the bit."""
    given = passing(tmp_path)
    loop, shown = Loop(load_scenario("colliding", given)), list[bytes]()
    ticks = {60: "", 101: "arm_a", 180: "arm_a", 300: "arm_b"}
    while not loop.finished:
        tick = len(shown)
        if tick in ticks:
            assert loop.deputy.holder == ticks[tick]
            save_snapshot(loop.snapshot(), tmp_path / f"{tick}.json")
        shown.append(bytes_of(loop.advance()))
    again = Loop(load_scenario("colliding", given))
    for tick in (*reversed(ticks),):
        again.restore(load_snapshot(tmp_path / f"{tick}.json"))
        rest = list[bytes]()
        while not again.finished:
            rest.append(bytes_of(again.advance()))
        assert rest == shown[tick:], tick
    again.reset()
    whole = digest_of_rest(again)
    loop.reset()
    assert digest_of_rest(loop) == whole


@pytest.mark.parametrize(("mass", "other"), [(0.0, 12.0), (12.0, 0.0)])
def test_a_snapshot_is_of_a_deputy_with_mass_or_without(mass: float, other: float) -> None:
    snapshot = Loop(load_scenario("smooth", {"deputy.mass": mass})).snapshot()
    with pytest.raises(ConfigurationError, match=r"deputy with(out)? mass.*set deputy\.mass, in kg"):
        Loop(load_scenario("smooth", {"deputy.mass": other})).restore(snapshot)


def test_a_run_with_a_payload_conserves_and_says_what_it_lost(tmp_path: Path) -> None:
    """A whole run, as recorded: momenta from the tumbling deputy to the end, energy, and the jump as heat."""
    run = simulate(load_scenario("colliding", passing(tmp_path)))
    caught, handed_over = run.grasp_events
    assert {caught.status, handed_over.status} == {GraspStatus.SUCCEEDED}
    assert caught.energy_lost > 1e-3 and caught.relative_speed > 0.02  # [J], [m/s]
    for momentum in (run.linear_momentum, run.angular_momentum):
        assert np.linalg.norm(momentum[0]) > 0.01
        np.testing.assert_allclose(
            momentum, np.broadcast_to(momentum[0], momentum.shape), rtol=0.0, atol=1e-11
        )
    balance = run.kinetic_energy - run.work + run.lost
    np.testing.assert_allclose(balance, balance[0], rtol=0.0, atol=1e-11)  # [J]
    assert run.lost[-1] == pytest.approx(caught.energy_lost + handed_over.energy_lost, rel=1e-12)


def test_a_deputy_of_almost_no_mass_is_as_good_as_massless(tmp_path: Path) -> None:
    """Also where it passes by and is caught; tumbling it would turn otherwise than without mass."""
    drifts = {"linear": [0.05, 0.0, 0.0], "angular": [0.0, 0.0, 0.0]}  # [m/s], [rad/s]
    light, none = (
        simulate(load_scenario("colliding", passing(tmp_path, mass=mass, twist_in_world=drifts)))
        for mass in (1e-9, 0.0)
    )
    np.testing.assert_allclose(light.joint_position, none.joint_position, rtol=0.0, atol=1e-8)  # [rad]
    assert np.any(light.joint_position != none.joint_position)
