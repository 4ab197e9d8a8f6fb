"""A tree of transforms as any viewer keeps it, from the messages of /tf and /tf_static alone."""

from typing import Any

import numpy as np

from sms_handover.frames import WORLD
from sms_handover.types import Array


class TransformTree:
    """The latest pose of every frame in its parent, as a homogeneous matrix (4, 4)."""

    def __init__(self) -> None:
        """Know no frame yet."""
        self._in_parent: dict[str, tuple[str, Array]] = {}

    def add(self, message: Any) -> None:
        """Take a TFMessage of any library."""
        for item in message.transforms:
            at, turn = item.transform.translation, item.transform.rotation
            row = np.array([at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w])
            self.place(item.header.frame_id, item.child_frame_id, row)

    def place(self, parent: str, child: str, row: Array) -> None:
        """Take the pose (7,) of a frame in its parent."""
        self._in_parent[child] = parent, matrix_of(row)

    @property
    def frames(self) -> set[str]:
        """The names of the frames with a parent."""
        return set(self._in_parent)

    def in_world(self, frame: str) -> Array:
        """Return a frame in ``world``; KeyError if there is no way to it."""
        matrix: Array = np.eye(4)
        while frame != WORLD:
            frame, above = self._in_parent[frame]
            matrix = above @ matrix
        return matrix


def matrix_of(row: Array) -> Array:
    """Return a pose (7,), position and quaternion x y z w, as a homogeneous matrix (4, 4)."""
    x, y, z, qx, qy, qz, qw = row
    matrix: Array = np.eye(4)
    matrix[:3, 3] = x, y, z
    vector, cross = np.array([qx, qy, qz]), np.array([[0.0, -qz, qy], [qz, 0.0, -qx], [-qy, qx, 0.0]])
    matrix[:3, :3] = (qw * qw - vector @ vector) * np.eye(3) + 2.0 * (np.outer(vector, vector) + qw * cross)
    return matrix
