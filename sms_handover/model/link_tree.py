"""Link tree: the links of the robot as a tree of transforms, those that move and those that do not."""

import numpy as np
import pinocchio as pin

from sms_handover.frames import WORLD
from sms_handover.model.poses import pose_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array, Pose


class LinkTree:
    """Every link with its parent; the parent of the base is ``world``.

    ``moving`` are the links behind a joint, ``fixed`` those that keep their pose in their parent, such as the
    tools; each is its parent and its own name, and ``fixed`` has that pose too.
    """

    def __init__(self, robot: RobotModel) -> None:
        """Find the parent of every link."""
        self._model, self._data = robot.pin, robot.pin.createData()
        frames = robot.pin.frames
        links = [index for index, frame in enumerate(frames) if frame.type == pin.FrameType.BODY]
        self._pairs: list[tuple[int | None, int]] = []
        self.moving: list[tuple[str, str]] = []
        self.fixed: list[tuple[str, str, Pose]] = []
        for index in links:
            frame, parent = frames[index], _parent_link(robot.pin, index)
            if parent is None or frames[parent].parentJoint != frame.parentJoint:
                self._pairs.append((parent, index))
                self.moving.append((WORLD if parent is None else frames[parent].name, frame.name))
            else:
                pose = pose_of(frames[parent].placement.actInv(frame.placement))
                self.fixed.append((frames[parent].name, frame.name, pose))

    def moving_in_parent(self, q: Array) -> Array:
        """Return the pose in its parent of every moving link, rows (7,) in the order of ``moving``.

        ``q`` is a configuration (7 + n,): the pose of the base in ``world``, then the joint positions in rad.
        """
        pin.framesForwardKinematics(self._model, self._data, q)
        in_world = self._data.oMf
        rows = np.empty((len(self._pairs), 7))
        for row, (parent, index) in zip(rows, self._pairs, strict=True):
            here = in_world[index]
            row[:] = pin.SE3ToXYZQUAT(here if parent is None else in_world[parent].actInv(here))
        return rows


def _parent_link(model: pin.Model, index: int) -> int | None:
    """Return the index of the link that carries a link, None for the base."""
    above = model.frames[index].parentFrame
    while above != 0 and model.frames[above].type != pin.FrameType.BODY:
        above = model.frames[above].parentFrame
    return above or None
