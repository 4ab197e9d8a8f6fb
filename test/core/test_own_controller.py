"""A controller from outside the package takes the place of ours in one process; the examples do the task."""

from collections.abc import Callable, Sequence

import my_law
import numpy as np
import pytest
from my_controller.task_space_pd import TaskSpaceGains, TaskSpacePd

from sms_handover.analysis.equality import compare_runs
from sms_handover.configuration.parameters import build
from sms_handover.control.law import LawSetup
from sms_handover.control.protocol import Controller, Guidance
from sms_handover.errors import ConfigurationError, ControllerError
from sms_handover.model.reduced import reduced_dynamics
from sms_handover.model.robot_model import RobotModel
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.wiring import make_controller
from sms_handover.types import Array, GraspStatus

_BOTH_GRASPS_S = 40.1  # s, the second one is at 40 s
_TICK_NS = 1_000_000  # [ns]
_ROUNDING = 1e-12  # [-] of momenta that stay at zero, in SI units


class Told:
    """A controller that keeps what it is told and answers with the same efforts every time."""

    def __init__(self, answer: Sequence[float]) -> None:
        """Answer with these efforts."""
        self.answer = np.array(answer)
        self.calls: list[str] = []
        self.guidance: list[Guidance] = []

    def reset(self) -> None:
        """Keep it."""
        self.calls.append("reset")

    def guide(self, guidance: Guidance) -> None:
        """Keep it."""
        self.calls.append("guide")
        self.guidance.append(guidance)

    def effort(self, stamp_ns: int, q: Array, v: Array) -> Array:
        """Keep it, and answer."""
        self.calls.append(f"effort {stamp_ns // 1_000_000}")
        return self.answer


def of_duration(seconds: float) -> Scenario:
    return load_scenario("colliding", {"common": {"duration": seconds}})


def test_our_own_controller_given_from_outside_changes_no_bit() -> None:
    scenario = of_duration(0.1)
    parameters = scenario.parameters
    ours = make_controller(
        scenario.truth.robot, scenario.truth.schedule, parameters.common, parameters.controller
    )
    assert compare_runs(simulate(scenario), simulate(scenario, controller=ours)) == ()


def test_a_controller_is_reset_then_guided_before_it_answers() -> None:
    told = Told(np.zeros(14).tolist())
    run = simulate(of_duration(0.04), controller=told)
    between = [[f"effort {k}" for k in range(begin, begin + 20)] for begin in (0, 20)]
    assert told.calls == ["reset", "guide", *between[0], "guide", *between[1], "guide", "effort 40"]
    for row, guidance in enumerate(told.guidance):
        assert guidance.phase == run.phases[row]
        assert guidance.reference.stamp_ns == run.reference_ns[row]
        assert guidance.reference.position.tobytes() == run.reference_position[row].tobytes()
        for arm, pose in guidance.tool_in_world.items():
            row_of = run.target_pose[arm][row]
            assert np.concatenate([pose.position, pose.quaternion_xyzw]).tobytes() == row_of.tobytes()


def test_what_a_controller_answers_is_what_acts() -> None:
    """Also if it hands out the same array every time and changes it afterwards."""
    told = Told(np.linspace(-0.1, 0.1, 14).tolist())
    run = simulate(of_duration(0.01), controller=told)
    told.answer[:] = 7.0
    assert (run.joint_command == np.linspace(-0.1, 0.1, 14)).all()
    assert (run.joint_effort[1:] == run.joint_command[:-1]).all()


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (np.zeros(13), r"0 s with an array of shape \(13,\), expected one effort in N m for each of 14"),
        (np.zeros((14, 1)), r"shape \(14, 1\)"),
        (np.full(14, np.nan), "0 s with nan N m for arm_a_joint_1, expected a finite number"),
        (np.array([*np.zeros(13), np.inf]), "inf N m for arm_b_joint_7"),
    ],
)
def test_efforts_that_are_none_are_refused(answer: Array, said: str) -> None:
    told = Told([])
    told.answer = answer
    with pytest.raises(ControllerError, match=said):
        simulate(of_duration(0.01), controller=told)


# --- the examples ---------------------------------------------------------------------------------


def joint_pd(robot: RobotModel, frequency: float = 1.0) -> my_law.JointPd:
    """Return the law with the same gains in the four phases of a handover."""
    return my_law.JointPd(LawSetup(robot, (my_law.Gains(frequency),) * 4, _TICK_NS))


@pytest.mark.slow
@pytest.mark.parametrize("law", [TaskSpacePd, joint_pd])
def test_an_example_hands_the_deputy_over(law: Callable[[RobotModel], Controller]) -> None:
    """Both grasps succeed on the shipped schedule; docs/own_controller.md tells how near."""
    scenario = of_duration(_BOTH_GRASPS_S)
    run = simulate(scenario, controller=law(scenario.truth.robot))
    assert [event.status for event in run.grasp_events] == [GraspStatus.SUCCEEDED] * 2
    assert max(event.position_error for event in run.grasp_events) < 1e-3
    assert np.abs(run.linear_momentum).max() < _ROUNDING
    assert np.abs(run.angular_momentum).max() < _ROUNDING


def test_task_space_pd_takes_energy_out_of_what_it_acts_on(scenario: Scenario) -> None:
    """Its power is what the springs give less what all dampers take: u . q_m' = f . x' - d |q_m'|^2."""
    robot, gains = scenario.truth.robot, TaskSpaceGains()
    guidance = _guidance(scenario)
    springless = build(TaskSpaceGains, {"stiffness": 0.0, "angular_stiffness": 0.0}, "test")
    dampers = TaskSpacePd(robot, springless)
    dampers.guide(guidance)
    for seed in range(20):
        q, v = _state(robot, seed)
        power = float(dampers.effort(0, q, v) @ v[6:])
        assert power <= -gains.joint_damping * float(v[6:] @ v[6:]) < 0.0


def test_task_space_pd_at_its_target_rests(scenario: Scenario) -> None:
    robot = scenario.truth.robot
    q, v = _state(robot, 1)
    law = TaskSpacePd(robot)
    guidance = _guidance(scenario)
    law.guide(Guidance(guidance.phase, guidance.reference, robot.tools_at(q)))
    assert np.abs(law.effort(0, q, 0.0 * v)).max() < 1e-12  # N m


def test_joint_pd_brings_a_joint_back_without_overshoot(scenario: Scenario) -> None:
    """For one joint alone m e'' = u with m its reduced inertia: u / m = -(w^2 e + 2 w e')."""
    robot = scenario.truth.robot
    q, v = _state(robot, 2)
    law = joint_pd(robot, frequency=0.5)
    guidance = _guidance(scenario)
    law.guide(guidance)
    acceleration = law.effort(0, q, v) / np.diag(reduced_dynamics(robot, q, v).inertia)
    wanted = -(0.25 * (q[7:] - guidance.reference.position) + 1.0 * v[6:])
    np.testing.assert_allclose(acceleration, wanted, rtol=1e-12)


def test_gains_of_an_example_are_checked_as_ours_are() -> None:
    with pytest.raises(ConfigurationError, match=r"'stiffness' is -1.0 N/m, must be >= 0"):
        build(TaskSpaceGains, {"stiffness": -1.0}, "controller")
    assert build(TaskSpaceGains, {}, "controller") == TaskSpaceGains()


def _guidance(scenario: Scenario) -> Guidance:
    """Return the guidance of the first instant."""
    told = Told(np.zeros(14).tolist())
    simulate(of_duration(0.001), controller=told)
    return told.guidance[0]


def _state(robot: RobotModel, seed: int) -> tuple[Array, Array]:
    """Return any configuration and velocity within the limits."""
    random = np.random.default_rng(seed)
    q = np.concatenate([[0.1, -0.2, 0.3, 0.0, 0.0, 0.0, 1.0], 0.5 * random.uniform(robot.lower, robot.upper)])
    return q, 0.1 * random.normal(size=6 + robot.n_joints)
