"""Inverse kinematics: the Jacobian of the residual.

The solver's steps are right only if its Jacobian is the derivative of its residual, also where the
orientation error is large and the derivative of the logarithm matters.
"""

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.ik.residual import PoseResidual
from sms_handover.model.poses import pose_of, se3_of
from sms_handover.model.robot_model import RobotModel
from test.evidence import Record

_STATES = 100
_STEP = 1e-3  # [rad]
_EPS = float(np.finfo(float).eps)
_FIFTH = 100.0  # [m/rad^5, -] bound on the fifth derivatives of the residual, up to 2 rad from the target
# A difference of fourth order errs by h^4 f'''''/30 and by rounding, 1.5 eps f / h with f of about 3.
_BOUND = _STEP**4 * _FIFTH / 30.0 + 1.5 * 10 * 12 * 3.0 * _EPS / _STEP


@pytest.mark.parametrize("angle", [0.0, 0.1, 1.0, 2.0])
def test_jacobian_is_the_derivative_of_the_residual(record: Record, angle: float) -> None:
    """Central differences of fourth order, both arms at once, at a given angle from the target."""
    robot = RobotModel.load()
    random = np.random.default_rng(4)
    largest = 0.0
    for _ in range(_STATES):
        base = pose_of(pin.SE3.Random())
        joints = random.uniform(robot.lower, robot.upper)
        targets = {}
        for arm, tool in robot.tools_in_world(base, joints).items():
            axis = random.normal(size=3)
            turn = pin.SE3(pin.exp3(angle * axis / np.linalg.norm(axis)), random.uniform(-1.0, 1.0, 3))
            targets[arm] = pose_of(se3_of(tool) * turn)
        problem = PoseResidual(robot, base, targets)
        jacobian = problem.jacobian(joints)
        for column, direction in zip(jacobian.T, np.eye(robot.n_joints), strict=True):
            at = {k: problem.evaluate(joints + k * _STEP * direction).values for k in (-2, -1, 1, 2)}
            slope = (at[-2] - 8.0 * at[-1] + 8.0 * at[1] - at[2]) / (12.0 * _STEP)
            largest = max(largest, float(np.max(np.abs(slope - column))))
    claim = f"Jacobian of the residual, {angle:g} rad from the target"
    record(claim, largest, _BOUND, unit="m/rad, -", against="finite differences of order four")
