"""Transforms as messages of ``/tf`` and ``/tf_static``, for viewers that do not know the robot model."""

import re
import struct
from collections.abc import Sequence

import numpy as np

from sms_handover.graph.topics import TF_TYPE
from sms_handover.messages.message_types import MessageTypes
from sms_handover.types import Array, Pose
from sms_handover.units import NS_PER_S

_STAMP = struct.Struct("<iI")  # seconds, nanoseconds
_MARK_NS = 1_234_567_890_123_456_789  # [ns] a stamp unlike any name or number of the prototype
_ORIGIN = 4  # [byte] size of the encapsulation, from behind which CDR aligns
_INT, _DOUBLE = 4, 8  # [byte]

Transform = tuple[str, str, Pose]  # parent frame, child frame, pose of the child in the parent


def transforms_cdr(types: MessageTypes, transforms: Sequence[Transform], stamp_ns: int) -> bytes:
    """Return the CDR bytes of one TFMessage with all transforms at one stamp."""
    seconds, nanoseconds = divmod(stamp_ns, NS_PER_S)
    stamp = types.make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    stamped = [
        types.make(
            "geometry_msgs/msg/TransformStamped",
            header=types.make("std_msgs/msg/Header", stamp=stamp, frame_id=parent),
            child_frame_id=child,
            transform=_transform(types, pose),
        )
        for parent, child, pose in transforms
    ]
    return types.serialize(types.make(TF_TYPE, transforms=stamped))


class TransformsCodec:
    """Packs TFMessages for one list of frames, (parent, child): only stamps and numbers change."""

    def __init__(self, types: MessageTypes, frames: Sequence[tuple[str, str]]) -> None:
        rows = np.arange(1.0, 1.0 + 7 * len(frames)).reshape(-1, 7)
        marked = [Pose(row[:3], row[3:]) for row in rows]
        named = [(parent, child, pose) for (parent, child), pose in zip(frames, marked, strict=True)]
        prototype = transforms_cdr(types, named, _MARK_NS)
        body = prototype[_ORIGIN:]
        self._head = prototype[:_ORIGIN]
        self._body = np.zeros(-(-len(body) // _DOUBLE) * _DOUBLE, np.uint8)
        self._body[: len(body)] = np.frombuffer(body, np.uint8)
        self._size = len(body)
        doubles_at = np.array([body.index(row.tobytes()) // _DOUBLE for row in rows])
        self._doubles_at = doubles_at[:, np.newaxis] + np.arange(7)
        mark = re.escape(_STAMP.pack(*divmod(_MARK_NS, NS_PER_S)))
        self._stamps_at = np.array([found.start() // _INT for found in re.finditer(mark, body)])

    def pack(self, stamp_ns: int, poses: Array) -> bytes:
        """Return the bytes of one TFMessage with the poses (N, 7) of all frames at one stamp."""
        numbers = self._body.view("<u4")
        numbers[self._stamps_at], numbers[self._stamps_at + 1] = divmod(stamp_ns, NS_PER_S)
        self._body.view("<f8")[self._doubles_at] = poses
        return self._head + self._body[: self._size].tobytes()


def _transform(types: MessageTypes, pose: Pose) -> object:
    x, y, z = pose.position.tolist()
    qx, qy, qz, qw = pose.quaternion_xyzw.tolist()
    return types.make(
        "geometry_msgs/msg/Transform",
        translation=types.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
        rotation=types.make("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
    )
