"""The robot in MuJoCo: a model from the same description, its state in our coordinates."""

import mujoco
import numpy as np

from sms_handover.frames import BASE
from sms_handover.model.assembly import RobotDescription
from sms_handover.model.mjcf import to_mjcf
from sms_handover.model.urdf import to_urdf
from sms_handover.types import Array

State = tuple[Array, Array]  # q (7 + n,) and v (6 + n,) as RobotModel has them

_NO_OTHER_FORCES = ("AUTORESET", "CONSTRAINT", "CONTACT", "DAMPER", "GRAVITY", "LIMIT", "SPRING")


def mjcf_of(robot: RobotDescription, *, floating: bool) -> str:
    """Return a robot as MJCF without solids.

    With ``floating`` the base moves freely and joints have no limits, as in the plant; without, it is
    fixed to the world and the limits hold, as inverse kinematics sees it.
    """
    rotors = {joint.name: joint.rotor_inertia for arm in robot.arms for joint in arm.joints}
    return to_mjcf(to_urdf(robot), rotors, floating=floating, limited=not floating)


class MujocoRobot:
    """The floating robot in MuJoCo, spoken to in our coordinates.

    MuJoCo has the quaternion with w first, the velocity of the base in world axes (ours: in base
    axes) and its angular velocity in base axes: v_mujoco = T v with T = diag(R, 1, 1).
    """

    def __init__(self, description: RobotDescription) -> None:
        self.model = mujoco.MjModel.from_xml_string(mjcf_of(description, floating=True))
        for name in _NO_OTHER_FORCES:
            self.model.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}")
        self.data = mujoco.MjData(self.model)
        joints = range(1, self.model.njnt)
        self.joint_names = tuple(mujoco.mj_id2name(self.model, mujoco.mjtObj.mjOBJ_JOINT, i) for i in joints)

    def place(self, q: Array, v: Array) -> None:
        """Put the robot into a state."""
        self.data.qpos[:] = np.concatenate([q[:3], q[6:7], q[3:6], q[7:]])
        self.data.qvel[:] = _map(q) @ v

    def drive(self, effort: Array) -> None:
        """Hold joint efforts (n,) from now on."""
        self.data.qfrc_applied[6:] = effort

    def advance(self, step: float, count: int) -> None:
        """Integrate ``count`` steps of ``step`` s with MuJoCo's RK4."""
        self.model.opt.timestep = step
        mujoco.mj_step(self.model, self.data, count)

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
        mass = self._mass_matrix()
        bias = to_mujoco.T @ (self.data.qfrc_bias + mass @ turning)
        return to_mujoco.T @ mass @ to_mujoco, bias, to_mujoco.T @ (self.data.qacc - turning)

    def momentum(self) -> tuple[Array, Array]:
        """Return linear and angular momentum (about the centre of mass) where it was last evaluated."""
        mujoco.mj_subtreeVel(self.model, self.data)
        root = self.model.body(BASE).id
        mass = self.model.body_subtreemass[root]
        return mass * self.data.subtree_linvel[root], np.array(self.data.subtree_angmom[root])

    def frame(self, name: str) -> tuple[Array, Array]:
        """Return position and rotation matrix in ``world`` of a body, or of a tool."""
        found = self.data.site(name) if name.endswith("_tool") else self.data.body(name)
        return np.array(found.xpos), np.array(found.xmat).reshape(3, 3)

    def _mass_matrix(self) -> Array:
        """Return M (nv, nv) in MuJoCo's coordinates, column by column."""
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


def apart(a: State, b: State) -> tuple[float, float, float]:
    """Return the largest joint difference rad, the base distance m and the base angle rad of two states."""
    turned = rotation_matrix(a[0][3:7]).T @ rotation_matrix(b[0][3:7])
    sine = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
    angle = np.arctan2(0.5 * np.linalg.norm(sine), 0.5 * (np.trace(turned) - 1.0))
    joints = np.max(np.abs(a[0][7:] - b[0][7:]))
    return float(joints), float(np.linalg.norm(a[0][:3] - b[0][:3])), float(angle)


def order(errors: Array) -> Array:
    """Return the order per column: the mean log2 of the ratio of errors (rows) as the step is halved."""
    ratios: Array = np.log2(errors[:-1] / errors[1:])
    return np.asarray(ratios.mean(axis=0))
