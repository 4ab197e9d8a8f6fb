"""Inverse kinematics in C: the iterations of Levenberg and Marquardt with the same numbers to rounding."""

import ctypes
from typing import Any

import numpy as np

from sms_handover.compiled.c_function import NativeFunction
from sms_handover.compiled.kinematics import POSE_ROW
from sms_handover.compiled.library import dynamics_library
from sms_handover.compiled.names import FIND_JOINTS
from sms_handover.compiled.tree import body_tree, parameters_of
from sms_handover.ik.levenberg_marquardt import Solution
from sms_handover.ik.parameters import IkParameters
from sms_handover.ik.residual import Residual
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import BASE_NQ, IkRequest, IkStatus, frozen

STATUSES = (IkStatus.CONVERGED, IkStatus.STALLED, IkStatus.ITERATION_LIMIT)  # by their number in C
_ROWS = 6  # residual rows per tool: position, orientation


class CompiledIk:
    """Finds joints of one robot as :func:`~sms_handover.ik.levenberg_marquardt.find_joints`; not thread-safe.

    Iterations and status are the same; the angles differ by the rounding of another order of sums.
    """

    def __init__(self, robot: RobotModel, parameters: IkParameters) -> None:
        """Load the solver, compiled unless cached; raises ConfigurationError."""
        self._arms = {arm: index for index, arm in enumerate(robot.arms)}
        count = len(robot.arms)
        self._base, self._rows = np.zeros(BASE_NQ), np.zeros((count, POSE_ROW))
        self._led = np.zeros(count, dtype=np.int64)
        self._settings = ik_settings(robot, parameters)
        self._solution = np.zeros((), _layout(robot.n_joints, count))
        library, arguments = dynamics_library(robot), 6
        self._call = NativeFunction(library, FIND_JOINTS, [ctypes.c_void_p] * arguments)
        self._parameters = parameters_of(body_tree(robot))
        given = (self._base, self._parameters, self._rows, self._led, self._settings, self._solution)
        self._at = tuple(array.ctypes.data for array in given)

    def __call__(self, request: IkRequest) -> Solution:
        """Return the joint angles that bring the tools to their targets, or come nearest from the seed."""
        base, found, led = request.base_in_world, self._solution, self._led
        self._base[:3], self._base[3:] = base.position, base.quaternion_xyzw
        led[:] = 0
        for arm, pose in request.tool_in_world.items():
            index = self._arms[arm]
            led[index] = 1
            self._rows[index, :3], self._rows[index, 3:] = pose.position, pose.quaternion_xyzw
        found["joints"] = request.seed
        self._call(*self._at)
        asked = [self._arms[arm] for arm in request.tool_in_world]
        values = found["values"].reshape(-1, _ROWS)[asked].ravel()
        residual = Residual(
            values, float(found["position_error"]), float(found["orientation_error"]), float(found["energy"])
        )
        status, iterations = STATUSES[int(found["status"])], int(found["iterations"])
        return Solution(frozen(found["joints"].copy()), residual, status, iterations)


def ik_settings(robot: RobotModel, parameters: IkParameters) -> Any:
    """Return ``ik_settings_t`` of native/inverse_kinematics.c."""
    n = robot.n_joints
    reals = ("position_tolerance", "orientation_tolerance", "damping_bias", "stall_step")
    fields: list[tuple[str, Any, Any]] = [(name, "f8", n) for name in ("lower", "upper")]
    fields += [(name, "f8", ()) for name in reals]
    settings = np.zeros((), [*fields, ("max_iterations", "i8", ())])
    settings["lower"], settings["upper"] = robot.lower, robot.upper
    for name in (*reals, "max_iterations"):
        settings[name] = getattr(parameters, name)
    return settings


def _layout(joints: int, arms: int) -> Any:
    """Return the fields of ``ik_solution_t``."""
    reals = [(name, "f8", ()) for name in ("position_error", "orientation_error", "energy")]
    counts = [(name, "i8", ()) for name in ("status", "iterations")]
    return np.dtype([("joints", "f8", joints), ("values", "f8", _ROWS * arms), *reals, *counts])
