"""The robot in MuJoCo: a model from the same description, its state in our coordinates."""

from collections.abc import Mapping

import mujoco
import numpy as np

from sms_handover.conditions.wrench import BodyAtInstant, Wrench
from sms_handover.model.assembly import RobotDescription
from sms_handover.model.mjcf import Payload, to_mjcf
from sms_handover.model.urdf import to_urdf
from sms_handover.types import Array

State = tuple[Array, Array]  # q (7 + n,) and v (6 + n,) as RobotModel has them

_NO_OTHER_FORCES = ("AUTORESET", "CONSTRAINT", "CONTACT", "DAMPER", "GRAVITY", "LIMIT", "SPRING")
_ROOT = 1  # number of the body that floats, after the world


class MujocoRobot:
    """The floating robot in MuJoCo, spoken to in our coordinates.

    MuJoCo has the quaternion with w first, the velocity of the base in world axes (ours: in base
    axes) and its angular velocity in base axes: v_mujoco = T v with T = diag(R, 1, 1).
    """

    def __init__(self, urdf: str, rotor_inertia: Mapping[str, float], payload: Payload | None = None) -> None:
        """Load a robot; ``rotor_inertia`` kg m^2 by joint is what a URDF cannot say."""
        text = to_mjcf(urdf, rotor_inertia, limited=False, payload=payload)
        self.model = mujoco.MjModel.from_xml_string(text)
        for name in _NO_OTHER_FORCES:
            self.model.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}")
        self.data = mujoco.MjData(self.model)
        joints = range(1, self.model.njnt)
        self.joint_names = tuple(mujoco.mj_id2name(self.model, mujoco.mjtObj.mjOBJ_JOINT, i) for i in joints)

    @classmethod
    def of(cls, robot: RobotDescription) -> "MujocoRobot":
        """Return the robot of a description."""
        return cls(to_urdf(robot), robot.rotor_inertia)

    def place(self, q: Array, v: Array) -> None:
        """Put the robot into a state."""
        self.data.qpos[:] = np.concatenate([q[:3], q[6:7], q[3:6], q[7:]])
        self.data.qvel[:] = _map(q) @ v

    def drive(self, effort: Array) -> None:
        """Hold joint efforts (n,) from now on."""
        self.data.qfrc_applied[6:] = effort

    def push(self, wrench: Wrench) -> None:
        """Hold a wrench on the base, about its origin and in ``world`` axes, from now on."""
        self.data.qfrc_applied[:3] = wrench.force  # at the origin
        self.data.xfrc_applied[_ROOT, 3:] = wrench.torque

    @property
    def as_body(self) -> BodyAtInstant:
        """All of it as one body where it was last evaluated."""
        xx, yy, zz, xy, xz, yz = self.data.crb[_ROOT, :6]  # about the centre of mass, in world axes
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        at, axes = np.array(self.data.xpos[_ROOT]), np.array(self.data.xmat[_ROOT]).reshape(3, 3)
        return BodyAtInstant(at, axes, self.mass, self.centre_of_mass, inertia)

    def advance(self, step: float, count: int) -> None:
        """Integrate ``count`` steps of ``step`` s with MuJoCo's RK4."""
        self.model.opt.timestep = step
        mujoco.mj_step(self.model, self.data, count)

    def evaluate(self) -> None:
        """Compute frames and velocities of the state it is in; after a step they are those before it."""
        mujoco.mj_forward(self.model, self.data)

    @property
    def state(self) -> State:
        """The state (q, v) it is in."""
        at = self.data.qpos
        q = np.concatenate([at[:3], at[4:7], at[3:4], at[7:]])
        return q, _map(q).T @ self.data.qvel

    def dynamics(self, q: Array, v: Array, effort: Array) -> tuple[Array, Array, Array]:
        """Return mass matrix, bias forces and acceleration at a state, in our coordinates.

        With the derivative T' v = (R (omega x v), 0, 0) of the map: H = T^T M T,
        c = T^T (b + M T' v) and v' = T^T (a - T' v).
        """
        self.place(q, v)
        self.drive(effort)
        mujoco.mj_forward(self.model, self.data)
        to_mujoco = _map(q)
        turning = np.zeros_like(v)
        turning[:3] = to_mujoco[:3, :3] @ np.cross(v[3:6], v[:3])
        mass = self.mass_matrix()
        bias = to_mujoco.T @ (self.data.qfrc_bias + mass @ turning)
        return to_mujoco.T @ mass @ to_mujoco, bias, to_mujoco.T @ (self.data.qacc - turning)

    def momentum(self) -> tuple[Array, Array]:
        """Return linear and angular momentum (about the centre of mass) where it was last evaluated."""
        mujoco.mj_subtreeVel(self.model, self.data)
        linear = self.mass * self.data.subtree_linvel[_ROOT]
        return linear, np.array(self.data.subtree_angmom[_ROOT])

    @property
    def mass(self) -> float:
        """The mass in kg of all of it."""
        return float(self.model.body_subtreemass[_ROOT])

    @property
    def centre_of_mass(self) -> Array:
        """The centre of mass in ``world`` where it was last evaluated."""
        return np.array(self.data.subtree_com[_ROOT])

    def frame(self, name: str) -> tuple[Array, Array]:
        """Return position and rotation matrix in ``world`` of a body, or of a tool."""
        is_site = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SITE, name) >= 0
        found = self.data.site(name) if is_site else self.data.body(name)
        return np.array(found.xpos), np.array(found.xmat).reshape(3, 3)

    def pose(self, name: str) -> Array:
        """Return the pose (7,) of a body or of a tool, position and quaternion x y z w, in ``world``."""
        position, axes = self.frame(name)
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, axes.ravel())
        return np.concatenate([position, np.roll(quaternion, -1)])

    def jacobian(self, body: str) -> Array:
        """Return the Jacobian (6, nv) of a body in MuJoCo's coordinates, where it was last evaluated.

        Its rows are the velocity of the origin in ``world`` axes and the angular velocity in those of the
        body, as MuJoCo has the velocity of a body that floats.
        """
        linear, angular = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        mujoco.mj_jacBody(self.model, self.data, linear, angular, self.model.body(body).id)
        return np.concatenate([linear, self.frame(body)[1].T @ angular])

    def mass_matrix(self) -> Array:
        """Return M (nv, nv) in MuJoCo's coordinates where it was last evaluated, column by column."""
        columns = np.empty((self.model.nv, self.model.nv))
        for row, unit in zip(columns, np.eye(self.model.nv), strict=True):
            mujoco.mj_mulM(self.model, self.data, row, unit)
        return columns


def rotation_matrix(quaternion_xyzw: Array) -> Array:
    """Return the rotation matrix of a quaternion, by MuJoCo."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, np.roll(quaternion_xyzw, 1))
    return matrix.reshape(3, 3)


def _map(q: Array) -> Array:
    """Return T (nv, nv), which takes our velocity to MuJoCo's."""
    to_mujoco = np.eye(q.size - 1)
    to_mujoco[:3, :3] = rotation_matrix(q[3:7])
    return to_mujoco
