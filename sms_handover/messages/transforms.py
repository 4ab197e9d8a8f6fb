"""Transforms as messages of ``/tf``, for viewers that do not know the robot model."""

import re
import struct
from collections.abc import Sequence

import numpy as np

from sms_handover.messages.message_types import MessageTypes
from sms_handover.types import Pose
from sms_handover.units import NS_PER_S

_STAMP = struct.Struct("<iI")  # seconds, nanoseconds
_NUMBERS = struct.Struct("<7d")  # translation, rotation
_MARK_NS = 1_234_567_890_123_456_789  # [ns] a stamp unlike any name or number of the prototype

TF_TYPE = "tf2_msgs/msg/TFMessage"

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
    """Packs TFMessages for one list of frames: only stamps and numbers change."""

    def __init__(self, types: MessageTypes, frames: Sequence[tuple[str, str]]) -> None:
        rows = np.arange(1.0, 1.0 + 7 * len(frames)).reshape(-1, 7)
        marked = [Pose(row[:3], row[3:]) for row in rows]
        named = [(parent, child, pose) for (parent, child), pose in zip(frames, marked, strict=True)]
        self._prototype = transforms_cdr(types, named, _MARK_NS)
        self._numbers_at = [self._prototype.index(row.tobytes()) for row in rows]
        mark = _STAMP.pack(*divmod(_MARK_NS, NS_PER_S))
        self._stamps_at = [m.start() for m in re.finditer(re.escape(mark), self._prototype)]

    def pack(self, stamp_ns: int, poses: Sequence[Pose]) -> bytes:
        """Return the bytes of one TFMessage with the poses of all frames at one stamp."""
        buffer = bytearray(self._prototype)
        stamp = divmod(stamp_ns, NS_PER_S)
        for at in self._stamps_at:
            _STAMP.pack_into(buffer, at, *stamp)
        for at, pose in zip(self._numbers_at, poses, strict=True):
            _NUMBERS.pack_into(buffer, at, *pose.position, *pose.quaternion_xyzw)
        return bytes(buffer)


def _transform(types: MessageTypes, pose: Pose) -> object:
    x, y, z = pose.position.tolist()
    qx, qy, qz, qw = pose.quaternion_xyzw.tolist()
    return types.make(
        "geometry_msgs/msg/Transform",
        translation=types.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
        rotation=types.make("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
    )
