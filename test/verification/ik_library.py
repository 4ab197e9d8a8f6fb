"""Inverse kinematics of an independent library, on the same robot in MuJoCo.

mink is differential: it finds the joint velocity that best brings the tool towards its target, as
a quadratic programme with the joint limits as constraints. Iterated with a unit time step it is a
local Gauss-Newton method. It does not claim to find a pose from afar; it is what users have.
"""

from dataclasses import dataclass

import mink
import mujoco
import numpy as np

from sms_handover.engines.mujoco_robot import rotation_matrix
from sms_handover.frames import tool_frame
from sms_handover.model.assembly import RobotDescription
from sms_handover.model.mjcf import to_mjcf
from sms_handover.model.urdf import to_urdf
from sms_handover.types import Array, Pose

_DAMPING = 1e-6  # [-] the same constant part as ours
_ERROR_DAMPING = 1.0  # [-] times the squared error, as in the examples of mink; ours: one half


@dataclass(frozen=True, eq=False)
class Attempt:
    """Where a solver ended: joint angles (n,), whether within tolerance, iterations spent."""

    joints: Array
    converged: bool
    iterations: int


class FixedBase:
    """The robot in MuJoCo with its base fixed at the origin of the world and its joint limits in force."""

    def __init__(self, description: RobotDescription) -> None:
        """Compile the model."""
        self.model = mujoco.MjModel.from_xml_string(to_mjcf(to_urdf(description), floating=False))
        self._configuration = mink.Configuration(self.model)
        self._limits = [mink.ConfigurationLimit(self.model, gain=1.0)]

    def errors(self, arm: str, joints: Array, target: Pose) -> tuple[float, float]:
        """Return distance m and angle rad of a tool to its target, by MuJoCo's forward kinematics."""
        self._configuration.update(joints)
        tool = self._configuration.data.site(tool_frame(arm))
        turned = rotation_matrix(target.quaternion_xyzw).T @ tool.xmat.reshape(3, 3)
        skew = turned - turned.T
        sine = 0.5 * np.linalg.norm([skew[2, 1], skew[0, 2], skew[1, 0]])
        angle = float(np.arctan2(sine, 0.5 * (np.trace(turned) - 1.0)))
        return float(np.linalg.norm(tool.xpos - target.position)), angle

    def solve(self, arm: str, target: Pose, seed: Array, tolerance: float, budget: int) -> Attempt:
        """Iterate from a seed until both errors are within ``tolerance`` (m, rad) or ``budget`` is spent."""
        task = mink.FrameTask(tool_frame(arm), "site", 1.0, 1.0, lm_damping=_ERROR_DAMPING)
        attitude = mink.SO3(np.roll(target.quaternion_xyzw, 1))
        task.set_target(mink.SE3.from_rotation_and_translation(attitude, target.position))
        at = self._configuration
        at.update(seed)
        for iteration in range(budget + 1):
            error = task.compute_error(at)
            if max(np.linalg.norm(error[:3]), np.linalg.norm(error[3:])) <= tolerance:
                return Attempt(np.array(at.q), True, iteration)
            if iteration < budget:
                step = mink.solve_ik(at, [task], 1.0, "daqp", damping=_DAMPING, limits=self._limits)
                at.integrate_inplace(step, 1.0)
        return Attempt(np.array(at.q), False, budget)
