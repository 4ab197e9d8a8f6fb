"""The shipped schedule in small: everything near its place at the start, and little time."""

from copy import deepcopy
from functools import cache
from typing import Any

import numpy as np
import yaml

from sms_handover.configuration.package_files import config_file
from sms_handover.ik.levenberg_marquardt import solve_ik
from sms_handover.model.poses import pose_from_xyz_rpy, pose_of, se3_of
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.wiring import initial_joints
from sms_handover.types import IkRequest, IkStatus, Pose

APPROACH_S, CARRY_S, WITHDRAW_S = 0.1, 0.14, 0.1  # s, lengths of the phases
END_S = APPROACH_S + CARRY_S + WITHDRAW_S

_ARM_A_OFF = np.array([0.002, 0.004, -0.001])  # m, from its target of the second phase
_ARM_B_OFF = np.array([-0.001, -0.003, 0.002])  # m, likewise
_DEPUTY_OFF = np.array([0.001, 0.002, 0.001])  # m, from where it is handed over
_NEAR = 0.006  # m: within the tolerance of a grasp, so that both grasps succeed under any law


def short_handover(*, stretch: float = 1.0, deputy_off: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> str:
    """Return the text of a schedule of ``stretch`` times :data:`END_S` in which the deputy changes hands.

    ``deputy_off`` in m moves the deputy away at the start, so that the first grasp can be made to
    miss: its target is in reach, but not within so short a phase.
    """
    schedule = deepcopy(_schedule())
    for phase in schedule["phases"]:
        for time in ("start", "duration", "motion"):
            phase[time] = round(stretch * phase[time], 3)
    place = schedule["deputy"]["in_world"]["xyz"]
    schedule["deputy"]["in_world"]["xyz"] = (np.array(place) + deputy_off).tolist()
    return str(yaml.safe_dump(schedule, sort_keys=False))


@cache
def _schedule() -> dict[str, Any]:
    """Return the shipped schedule with its times shortened, robot and deputy placed near their targets."""
    schedule: dict[str, Any] = yaml.safe_load(
        config_file("schedules/colliding.yaml").read_text(encoding="utf-8")
    )
    starts_s = (0.0, APPROACH_S, APPROACH_S + CARRY_S)
    for phase, start, length in zip(
        schedule["phases"], starts_s, (APPROACH_S, CARRY_S, WITHDRAW_S), strict=True
    ):
        phase.update(start=start, duration=length, motion=0.8 * length)
    carry = schedule["phases"][1]
    targets = {arm: _pose(carry["arms"][arm]["tool_in_world"]) for arm in ("arm_a", "arm_b")}
    offsets = {"arm_a": _ARM_A_OFF, "arm_b": _ARM_B_OFF}
    starts = {arm: Pose(pose.position + offsets[arm], pose.quaternion_xyzw) for arm, pose in targets.items()}
    schedule["initial"]["joints"] = _joints_at(starts)
    end_a = _pose(schedule["deputy"]["grasp_frames"]["end_a"])
    handed_over = pose_of(se3_of(targets["arm_a"]) * se3_of(end_a).inverse())
    assert max(abs(_ARM_A_OFF - _DEPUTY_OFF)) < _NEAR and max(abs(_ARM_B_OFF)) < _NEAR
    schedule["deputy"]["in_world"]["xyz"] = (handed_over.position + _DEPUTY_OFF).tolist()
    return schedule


def _joints_at(tool_in_world: dict[str, Pose]) -> dict[str, list[float]]:
    """Return joint angles per arm that bring the tools to poses, found from the shipped start."""
    scenario = load_scenario("colliding")
    robot, seed = scenario.truth.robot, initial_joints(scenario.truth.robot, scenario.truth.schedule)
    request = IkRequest(scenario.truth.schedule.base_in_world, seed, tool_in_world)
    result = solve_ik(robot, request, scenario.parameters.ik)
    assert result.status is IkStatus.CONVERGED, result
    return {arm: result.joint_position[robot.arm_joints[arm]].tolist() for arm in robot.arms}


def _pose(value: dict[str, list[float]]) -> Pose:
    """Return the pose in a schedule."""
    return pose_from_xyz_rpy(np.array(value["xyz"]), np.array(value["rpy"]))
