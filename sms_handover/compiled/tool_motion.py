"""Motion of the tools in C: where they are, their paths, and the joint rates that give their twists."""

import ctypes
from collections.abc import Iterable, Mapping

import numpy as np
import pinocchio as pin

from sms_handover.compiled.c_function import NativeFunction
from sms_handover.compiled.kinematics import POSE_ROW, TWIST, CompiledKinematics, numbers_in
from sms_handover.compiled.library import dynamics_library
from sms_handover.compiled.names import ON_PATH, PLACED, RESOLVE_RATES, WITHOUT_DRIFT
from sms_handover.compiled.tree import body_tree, parameters_of
from sms_handover.model.poses import pose_row
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.trajectory.time_law import Progress
from sms_handover.types import Array, Pose, Twist, frozen


class CompiledToolMotion:
    """What :class:`~sms_handover.trajectory.tool_motion.PinocchioToolMotion` has, to rounding.

    Not thread-safe.
    """

    def __init__(self, robot: RobotModel) -> None:
        """Load it, compiled unless cached; raises ConfigurationError."""
        self._arms, self._kinematics = robot.arms, CompiledKinematics(robot)
        count, library = len(robot.arms), dynamics_library(robot)
        self._ends, self._progress = np.zeros((2, POSE_ROW)), np.zeros(2)
        self._row, self._twist = np.zeros(POSE_ROW), np.zeros(TWIST)
        self._placed = NativeFunction(library, PLACED, [ctypes.c_void_p] * 3)
        self._on_path = NativeFunction(library, ON_PATH, [ctypes.c_void_p] * 5)
        self._q, self._parameters = np.zeros(BASE_NQ + robot.n_joints), parameters_of(body_tree(robot))
        self._twists, self._led = np.zeros((count, TWIST)), np.zeros(count, dtype=np.int64)
        self._damping, self._v = np.zeros(1), np.zeros(BASE_NV + robot.n_joints)
        self._without = NativeFunction(library, WITHOUT_DRIFT, [ctypes.c_void_p] * 5)
        self._resolve = NativeFunction(library, RESOLVE_RATES, [ctypes.c_void_p] * 6)

    def tools_at(self, q: Array, arms: Iterable[str] | None = None) -> Mapping[str, Pose]:
        """Return the poses of the tools of some arms in ``world``, by default of all."""
        return self._kinematics.tools_at(q, arms)

    def placed(self, body_in_world: Pose, frame: pin.SE3, in_frame: pin.SE3) -> Pose:
        """Return the pose in ``world`` of what is fixed to a body, by its pose in a frame of it."""
        given = (pose_row(body_in_world), numbers_in(frame * in_frame), self._row)
        self._placed(*(array.ctypes.data for array in given))
        row = frozen(self._row.copy())
        return Pose(row[:3], row[3:])

    def on_path(self, start: Pose, goal: Pose, progress: Progress) -> tuple[Pose, Twist]:
        """Return pose and twist on the way from pose to pose."""
        for row, pose in zip(self._ends, (start, goal), strict=True):
            row[:3], row[3:] = pose.position, pose.quaternion_xyzw
        self._progress[:] = progress.fraction, progress.rate
        given = (*self._ends, self._progress, self._row, self._twist)
        self._on_path(*(array.ctypes.data for array in given))
        row, twist = frozen(self._row.copy()), frozen(self._twist.copy())
        return Pose(row[:3], row[3:]), Twist(twist[:3], twist[3:])

    def without_drift(self, q: Array, v: Array, twists: Mapping[str, Twist]) -> Mapping[str, Twist]:
        """Return twists of tools less what they have by the momentum alone, with joints at rest."""
        self._q[:], self._v[:] = q, v
        self._lead(twists)
        given = (self._q, self._v, self._parameters, self._led, self._twists)
        self._without(*(array.ctypes.data for array in given))
        rows = frozen(self._twists.copy())
        found = dict(zip(self._arms, rows, strict=True))
        return {arm: Twist(found[arm][:3], found[arm][3:]) for arm in twists}

    def resolved(self, q: Array, twists: Mapping[str, Twist], velocity: Array, damping: float) -> Array:
        """Return joint rates (n,): ``velocity``, and for the arms that have a twist those that give it."""
        self._q[:], self._damping[:] = q, damping
        self._lead(twists)
        rates = np.array(velocity)
        given = (self._q, self._parameters, self._twists, self._led, self._damping, rates)
        self._resolve(*(array.ctypes.data for array in given))
        return frozen(rates)

    def _lead(self, twists: Mapping[str, Twist]) -> None:
        """Say which arms are led, and how."""
        for index, arm in enumerate(self._arms):
            self._led[index] = arm in twists
            if arm in twists:
                self._twists[index, :3], self._twists[index, 3:] = twists[arm].linear, twists[arm].angular
