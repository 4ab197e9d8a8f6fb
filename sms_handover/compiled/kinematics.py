"""Kinematics in C: tools, a held deputy, momenta and energy of a robot."""

import ctypes
from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from sms_handover.compiled.c_function import CFunction, NativeFunction
from sms_handover.compiled.example import example_of, require_equal
from sms_handover.compiled.library import dynamics_library
from sms_handover.compiled.names import CONSERVED, MOTION_ROWS, TOOL_ROWS
from sms_handover.compiled.tree import body_tree, parameters_of
from sms_handover.model.conserved import ConservedQuantities, conserved_quantities
from sms_handover.model.poses import pose_row
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.deputy import MasslessDeputy
from sms_handover.types import Array, Pose, Twist, frozen

POSE, POSE_ROW, TWIST = 12, 7, 6  # numbers of rotation and origin, of position and quaternion, of a twist
CONSERVED_SIZE = 10  # linear and angular momentum, centre of mass, kinetic energy


class CompiledKinematics:
    """What :class:`~sms_handover.plant.kinematics.PinocchioKinematics` has, to rounding; not thread-safe."""

    def __init__(self, robot: RobotModel) -> None:
        """Load it, compiled unless cached, and compare it with Pinocchio; raises ConfigurationError."""
        library = dynamics_library(robot)
        n, count = robot.n_joints, len(robot.arms)
        self._arms = robot.arms
        self._q, self._v = np.zeros(BASE_NQ + n), np.zeros(BASE_NV + n)
        self._rows, self._twists = np.zeros((count, POSE_ROW)), np.zeros((count, TWIST))
        self._in_tool, self._deputy = np.zeros(POSE), np.zeros(POSE_ROW + TWIST)
        self._sums = np.zeros(CONSERVED_SIZE)
        pointer, number = ctypes.c_void_p, ctypes.c_long
        self._tools = NativeFunction(library, TOOL_ROWS, [pointer] * 3)
        self._motion = NativeFunction(library, MOTION_ROWS, (*[pointer] * 3, number, *[pointer] * 5))
        self._parameters = parameters_of(body_tree(robot))
        self._parameters_at = self._parameters.ctypes.data
        given = (self._q, self._v, self._parameters)
        self._conserved = CFunction(library, CONSERVED, given, (self._sums,))
        self._at = tuple(a.ctypes.data for a in (self._q, self._v, self._rows, self._twists, self._in_tool))
        self._deputy_at = self._deputy.ctypes.data
        q, v, _ = example_of(robot)
        ours, theirs = self.tools_at(q), robot.tools_at(q)
        pairs = [(pose_row(ours[arm]), pose_row(theirs[arm])) for arm in robot.arms]
        pairs.append((sums_of(self.conserved(q, v)), sums_of(conserved_quantities(robot, q, v))))
        require_equal(library, pairs)

    def tools_at(self, q: Array, arms: Iterable[str] | None = None) -> dict[str, Pose]:
        """Return the pose of the tools of some arms in ``world``, by default of all."""
        self._q[:] = q
        self._tools(self._at[0], self._parameters_at, self._at[2])
        rows = frozen(self._rows.copy())
        poses = {arm: Pose(row[:3], row[3:]) for arm, row in zip(self._arms, rows, strict=True)}
        return poses if arms is None else {arm: poses[arm] for arm in arms}

    def tool_motion(self, q: Array, v: Array, arm: str) -> tuple[Pose, Twist]:
        """Return pose and twist of a tool: of its origin, in the axes of ``world``."""
        self._move(q, v, -1)
        index = self._arms.index(arm)
        return _motion(np.concatenate([self._rows[index], self._twists[index]]))

    def conserved(self, q: Array, v: Array) -> ConservedQuantities:
        """Return momenta, energy and centre of mass of the robot."""
        self._q[:], self._v[:] = q, v
        self._conserved()
        return quantities_of(frozen(self._sums.copy()))

    def carry(self, deputy: MasslessDeputy, q: Array, v: Array) -> None:
        """Move a held deputy with its tool."""
        self._in_tool[:] = numbers_in(deputy.in_tool)
        self._move(q, v, self._arms.index(deputy.holder))
        deputy.carry(*_motion(self._deputy.copy()))

    def _move(self, q: Array, v: Array, holder: int) -> None:
        """Work out the motion of the tools, and with a holder >= 0 that of the deputy."""
        self._q[:], self._v[:] = q, v
        at_q, at_v, rows, twists, in_tool = self._at
        deputy = self._deputy_at
        self._motion(
            at_q, at_v, self._parameters_at, holder, in_tool, rows, twists, deputy, deputy + POSE_ROW * 8
        )


def numbers_in(pose: pin.SE3) -> Array:
    """Return a pose as the functions in C have it: the rows of its rotation, its origin (12,)."""
    return np.concatenate([pose.rotation.ravel(), pose.translation])


def quantities_of(sums: Array) -> ConservedQuantities:
    """Return what is conserved by name."""
    return ConservedQuantities(sums[:3], sums[3:6], sums[6:9], float(sums[9]))


def sums_of(of: ConservedQuantities) -> Array:
    """Return what is conserved as one array (10,)."""
    energy = np.array([of.kinetic_energy])
    return np.concatenate([of.linear_momentum, of.angular_momentum, of.centre_of_mass, energy])


def _motion(numbers: Array) -> tuple[Pose, Twist]:
    """Return pose and twist from position, quaternion x y z w, and twist (13,)."""
    frozen(numbers)
    return Pose(numbers[:3], numbers[3:7]), Twist(numbers[7:10], numbers[10:])
