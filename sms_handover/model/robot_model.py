"""Robot model: the free-floating robot in Pinocchio, with maps from names to indices."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType

import eigenpy
import numpy as np
import pinocchio as pin

from sms_handover.errors import RobotDescriptionError, UnknownNameError
from sms_handover.frames import tool_frame
from sms_handover.model.assembly import RobotDescription
from sms_handover.model.carried import Carried
from sms_handover.model.description import load_robot
from sms_handover.model.poses import pose_of, se3_of, twist_of
from sms_handover.model.springs import Springs
from sms_handover.model.urdf import to_urdf
from sms_handover.types import BASE_NQ, BASE_NV, Array, Pose, Twist, read_only

__all__ = ["BASE_NQ", "BASE_NV", "RobotModel"]


class RobotModel:
    """A spacecraft with arms: kinematics and dynamics of its nv = 6 + n degrees of freedom.

    The configuration is q = (base position, base quaternion x y z w, n joint angles), the
    velocity v = (base twist in ``base_link`` axes, n joint rates). There is no gravity. Panels on hinges are
    locked at rest; :func:`~sms_handover.model.moving_panels.with_moving_panels` lets them swing, with
    ``springs``. An instance owns Pinocchio's workspace and must not be shared between threads.
    """

    def __init__(self, description: RobotDescription) -> None:
        """Build the model; raises RobotDescriptionError where the description is inconsistent."""
        self.description = description
        self.urdf = to_urdf(description)
        rigid = to_urdf(description, panels_move=False) if description.flexible_panels else self.urdf
        self.pin = pin.buildModelFromXML(rigid, pin.JointModelFreeFlyer())
        self.pin.gravity.setZero()
        self.data = self.pin.createData()
        self.base_solver = eigenpy.LLT(BASE_NV)  # workspace too: Cholesky of (6, 6)
        self.joint_names: tuple[str, ...] = tuple(self.pin.names[2:])
        self.n_joints = len(self.joint_names)
        if self.pin.nv != BASE_NV + self.n_joints or self.pin.nq != BASE_NQ + self.n_joints:
            raise RobotDescriptionError("every joint of an arm must be revolute with limits (nq = 7 + n)")
        self.lower = read_only(self.pin.lowerPositionLimit[BASE_NQ:])
        self.upper = read_only(self.pin.upperPositionLimit[BASE_NQ:])
        self.effort_limit = read_only(self.pin.effortLimit[BASE_NV:])
        self._least_effort = read_only(-self.effort_limit)
        self.arms = tuple(arm.name for arm in description.arms)
        self.arm_joints: Mapping[str, slice] = MappingProxyType(self._arm_slices())
        self.tool_frame_id: Mapping[str, int] = MappingProxyType(
            {arm: self.pin.getFrameId(tool_frame(arm)) for arm in self.arms}
        )
        self.carried: Carried | None = None
        self.springs: Springs | None = None
        self._apply_rotor_inertia()

    @classmethod
    def load(cls, path: Path | None = None) -> "RobotModel":
        """Return the model of a robot description file, by default the shipped one (see load_robot)."""
        return cls(load_robot(path))

    @property
    def mass(self) -> float:
        """Total mass in kg."""
        return float(pin.computeTotalMass(self.pin))

    def joint_index(self, name: str) -> int:
        """Return the position of a joint in every joint array; raises UnknownNameError."""
        try:
            return self.joint_names.index(name)
        except ValueError:
            raise UnknownNameError("joint", name, self.joint_names) from None

    def require_arm(self, name: str, where: str = "") -> None:
        """Raise UnknownNameError unless the robot has an arm of this name."""
        if name not in self.arms:
            raise UnknownNameError("arm", name, self.arms, where)

    def configuration(self, base_in_world: Pose, joint_position: Array) -> Array:
        """Return q (7 + n,) from the pose of the base and the joint angles."""
        return np.concatenate([base_in_world.position, base_in_world.quaternion_xyzw, joint_position])

    def limited(self, effort: Array) -> Array:
        """Return joint efforts (n,) N m clamped to the limits."""
        return np.minimum(np.maximum(effort, self._least_effort), self.effort_limit)

    def within_limits(self, joint_position: Array) -> Array:
        """Return joint angles (n,) rad clamped to the limits."""
        return np.minimum(np.maximum(joint_position, self.lower), self.upper)

    def tools_in_world(
        self, base_in_world: Pose, joint_position: Array, arms: Iterable[str] | None = None
    ) -> dict[str, Pose]:
        """Return the pose of the tool frames of some arms in ``world``, by default of all."""
        return self.tools_at(self.configuration(base_in_world, joint_position), arms)

    def tools_at(self, q: Array, arms: Iterable[str] | None = None) -> dict[str, Pose]:
        """Return these poses at a configuration (7 + n,), by forward kinematics."""
        pin.forwardKinematics(self.pin, self.data, q)
        return {
            arm: pose_of(pin.updateFramePlacement(self.pin, self.data, self.tool_frame_id[arm]))
            for arm in (self.arms if arms is None else arms)
        }

    def tool_motion(self, q: Array, v: Array, arm: str) -> tuple[Pose, Twist]:
        """Return pose and twist of a tool: of its origin, in the axes of ``world``."""
        pin.forwardKinematics(self.pin, self.data, q, v)
        frame_id, aligned = self.tool_frame_id[arm], pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        placement = pin.updateFramePlacement(self.pin, self.data, frame_id)
        return pose_of(placement), twist_of(pin.getFrameVelocity(self.pin, self.data, frame_id, aligned))

    def integrate_base(self, base_in_world: Pose, twist_base_in_base: Array, duration: float) -> Pose:
        """Return the base pose after a constant body twist (6,) over ``duration`` s."""
        return pose_of(se3_of(base_in_world) * pin.exp6(pin.Motion(twist_base_in_base * duration)))

    def _arm_slices(self) -> dict[str, slice]:
        """Return the slice of each arm in the joint arrays; in a tree its joints are contiguous."""
        slices = {}
        for arm in self.description.arms:
            indices = [self.joint_index(joint.name) for joint in arm.joints]
            first, count = min(indices), len(indices)
            if indices != list(range(first, first + count)):
                raise RobotDescriptionError(f"the joints of arm {arm.name!r} are not one serial chain")
            slices[arm.name] = slice(first, first + count)
        return slices

    def _apply_rotor_inertia(self) -> None:
        """Add each joint's reflected rotor inertia to the diagonal of the mass matrix."""
        armature = np.zeros(self.pin.nv)
        for arm in self.description.arms:
            part = self.arm_joints[arm.name]
            reflected = [joint.rotor_inertia for joint in arm.joints]
            armature[BASE_NV + part.start : BASE_NV + part.stop] = reflected
        self.pin.armature = armature
