"""Tool errors over a horizon: how far the tools are from their targets, with derivatives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.control.mpc.placement import Placement
from sms_handover.control.mpc.prediction import Derivatives
from sms_handover.model.poses import se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.previewed_targets import PreviewedTargets
from sms_handover.types import Array

ROWS = 6  # [-] of a tool: position in world, then the rotation vector from target to tool


@dataclass(frozen=True, eq=False)
class ToolErrors:
    """Errors (K, 6 A) in m and rad of A tools at K instants, zero where a tool has no target.

    ``target_rates`` (K, 6 A) is the motion of the targets in the same coordinates.
    """

    errors: Array
    target_rates: Array
    by: Derivatives


class ToolErrorModel:
    """Errors p - p_d and log(R_d^T R) of the tools; owns work space of Pinocchio."""

    def __init__(self, robot: RobotModel) -> None:
        self._robot, self._data = robot, robot.pin.createData()

    def paths(self, placed: Sequence[Placement]) -> Mapping[str, Array]:
        """Return the positions (K, 3) m of the tools in ``world`` at some placements, by arm."""
        robot, model, data = self._robot, self._robot.pin, self._data
        found = {arm: np.zeros((len(placed), 3)) for arm in robot.arms}
        for k, place in enumerate(placed):
            pin.forwardKinematics(model, data, place.q)
            for arm, path in found.items():
                path[k] = pin.updateFramePlacement(model, data, robot.tool_frame_id[arm]).translation
        return found

    def at(self, placed: Sequence[Placement], targets: Sequence[PreviewedTargets]) -> ToolErrors:
        """Return the errors at some placements; an arm without a target has zeros."""
        robot, model, data = self._robot, self._robot.pin, self._data
        count, rows, n = len(placed), ROWS * len(robot.arms), robot.n_joints
        errors, rates = np.zeros((count, rows)), np.zeros((count, rows))
        by_q, by_phi = np.zeros((count, rows, n)), np.zeros((count, rows, 3))
        for k, (place, target) in enumerate(zip(placed, targets, strict=True)):
            if not target.tool_in_world:
                continue
            pin.computeJointJacobians(model, data, place.q)
            for index, arm in enumerate(robot.arms):
                if arm not in target.tool_in_world:
                    continue
                frame, goal = robot.tool_frame_id[arm], se3_of(target.tool_in_world[arm])
                tool = pin.updateFramePlacement(model, data, frame)
                whole = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
                of_q, of_phi = place.reduced(whole)
                apart = goal.rotation.T @ tool.rotation
                turn = pin.Jlog3(apart) @ tool.rotation.T
                at = slice(ROWS * index, ROWS * index + ROWS)
                errors[k, at] = np.concatenate([tool.translation - goal.translation, pin.log3(apart)])
                twist = target.tool_twist_in_world[arm]
                rates[k, at] = np.concatenate([twist.linear, turn @ twist.angular])
                by_q[k, at] = np.vstack([of_q[:3], turn @ of_q[3:]])
                by_phi[k, at] = np.vstack([of_phi[:3], turn @ of_phi[3:]])
        return ToolErrors(errors, rates, Derivatives(by_q, np.zeros_like(by_q), by_phi))
