"""Deputy with mass in MuJoCo: a body of its own while it floats, a child of the hand while it is held."""

from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from sms_handover.engines.mujoco_robot import MujocoRobot
from sms_handover.engines.protocol import FreeBody, Replay
from sms_handover.frames import DEPUTY, tool_frame
from sms_handover.model.mjcf import Payload
from sms_handover.model.parts import Inertia
from sms_handover.types import Array, Pose


class MujocoScene:
    """The robot of a replay and its deputy, if it has mass.

    ``robot`` is the model that moves now: bare, or with the deputy in a hand. Each change of
    hands makes a new one.
    """

    def __init__(self, replay: Replay) -> None:
        """Place the deputy where it is at time zero; the robot is to be placed."""
        self._replay = replay
        self.robot = self._bare = MujocoRobot(replay.urdf, replay.rotor_inertia)
        self._held = False
        self._floating = _floating(replay.deputy) if replay.deputy else None

    def advance(self, step: float) -> None:
        """Integrate a step of ``step`` s."""
        self.robot.advance(step, 1)
        if self._floating and not self._held:
            self._floating.advance(step, 1)

    def evaluate(self) -> None:
        """Compute frames and velocities."""
        self.robot.evaluate()
        if self._floating:
            self._floating.evaluate()

    @property
    def deputy(self) -> Array | None:
        """The pose (7,) of the deputy, None without mass."""
        if self._floating is None:
            return None
        return (self.robot if self._held else self._floating).pose(DEPUTY)

    def momentum(self) -> tuple[Array, Array]:
        """Return linear and angular momentum of all, the latter about the common centre of mass."""
        parts = [self.robot, *([self._floating] if self._floating and not self._held else [])]
        centre = np.sum([part.mass * part.centre_of_mass for part in parts], axis=0)
        centre = centre / sum(part.mass for part in parts)
        linear, angular = np.zeros(3), np.zeros(3)
        for part in parts:
            own, spin = part.momentum()
            linear += own
            angular += spin + np.cross(part.centre_of_mass - centre, own)
        return linear, angular

    def hold(self, holder: str) -> Array | None:
        """Let the deputy change hands, '' for none; return the impulse (6,) of a hand that takes hold."""
        if self._floating is None:
            return None
        if self._held:
            self._let_go(self._floating)
        return self._take(self._floating, holder) if holder else None

    def _let_go(self, deputy: MujocoRobot) -> None:
        """Leave the deputy with the twist that it has in the hand; the robot keeps its velocity."""
        self.evaluate()
        held = self.robot
        x, y, z, w = held.pose(DEPUTY)[3:]
        deputy.data.qpos[:] = [*held.pose(DEPUTY)[:3], w, x, y, z]
        deputy.data.qvel[:] = held.jacobian(DEPUTY) @ held.data.qvel
        self._held = False
        self._exchange(self._bare)

    def _take(self, deputy: MujocoRobot, arm: str) -> Array:
        """Fix the deputy to a hand at their present relative pose; return the impulse that it gets.

        With M' the mass matrix of the robot with the deputy, M_d that of the deputy, and J its Jacobian in
        the hand: M' (v+ - v) = J^T M_d (V_d - J v), all by MuJoCo.
        """
        assert self._replay.deputy
        self.evaluate()
        tool, axes = self.robot.frame(tool_frame(arm))
        at, turned = deputy.frame(DEPUTY)
        pose = Pose(axes.T @ (at - tool), _quaternion(axes.T @ turned))
        payload = Payload(DEPUTY, tool_frame(arm), self._replay.deputy.inertia, pose)
        twist, mass = np.array(deputy.data.qvel), deputy.mass_matrix()
        self._held = True
        self._exchange(MujocoRobot(self._replay.urdf, self._replay.rotor_inertia, payload))
        self.evaluate()
        jacobian, v = self.robot.jacobian(DEPUTY), np.array(self.robot.data.qvel)
        change = jacobian.T @ (mass @ (twist - jacobian @ v))
        v += np.linalg.solve(self.robot.mass_matrix(), change)
        self.robot.data.qvel[:] = v
        impulse = mass @ (jacobian @ v - twist)
        return np.concatenate([impulse[:3], turned @ impulse[3:]])

    def _exchange(self, robot: MujocoRobot) -> None:
        """Go on with another model of the robot, in the same state."""
        robot.data.qpos[:], robot.data.qvel[:] = self.robot.data.qpos, self.robot.data.qvel
        robot.data.qfrc_applied[:] = self.robot.data.qfrc_applied
        self.robot = robot


def _floating(body: FreeBody) -> MujocoRobot:
    """Return a body that floats, placed."""
    found = MujocoRobot(_urdf(body.inertia), {})
    x, y, z, w = body.body_in_world.quaternion_xyzw
    found.data.qpos[:] = [*body.body_in_world.position, w, x, y, z]
    found.evaluate()
    to_body = found.frame(DEPUTY)[1].T
    found.data.qvel[:] = [*body.twist_in_world.linear, *(to_body @ body.twist_in_world.angular)]
    return found


def _urdf(inertia: Inertia) -> str:
    """Return the URDF of a single body."""
    root = ET.Element("robot", name=DEPUTY)
    inertial = ET.SubElement(ET.SubElement(root, "link", name=DEPUTY), "inertial")
    ET.SubElement(inertial, "origin", xyz=" ".join(repr(float(x)) for x in inertia.com), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=repr(float(inertia.mass)))
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    moments = (repr(float(moment)) for moment in inertia.moments)
    ET.SubElement(inertial, "inertia", dict(zip(keys, moments, strict=True)))
    return ET.tostring(root, encoding="unicode")


def _quaternion(axes: Array) -> Array:
    """Return the quaternion x y z w of a rotation matrix, by MuJoCo."""
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, axes.ravel())
    return np.roll(quaternion, -1)
