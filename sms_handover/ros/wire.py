"""The three messages of the hot path as CDR bytes, packed and read by a template.

A JointState or Odometry of the loop has the same names every time, so its layout is fixed: the
bytes of one message serve as a template in which only stamp and numbers are exchanged. A message
of another layout (other names, other order, another sender's padding) is read the general way, by name.
"""

import struct
from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from sms_handover.bag.message_types import MessageTypes
from sms_handover.bag.stamp import stamp_ns
from sms_handover.checks import check_finite, check_unit
from sms_handover.errors import BagError, GraphError, MessageError, Reason
from sms_handover.model.poses import pose_row
from sms_handover.ros.convert import joints_in_order, pose_of_message
from sms_handover.types import BASE_NQ, BASE_NV, Array, Pose, RobotState, frozen
from sms_handover.units import NS_PER_S, ns_to_seconds

_RmwError = rclpy_implementation.RMWError

_STAMP = struct.Struct("<iI")  # seconds, nanoseconds
_STAMP_AT = 4  # [byte] behind the encapsulation header
_BODY_AT = _STAMP_AT + _STAMP.size
_DOUBLE = 8  # [byte]
_LITTLE_ENDIAN = b"\x00\x01"  # encapsulation of plain CDR
_LARGEST = 65536  # [byte] of a message of another layout


class JointStateWire:
    """Packs and reads JointState messages for one list of joints."""

    def __init__(self, names: Sequence[str], blocks: Sequence[str]) -> None:
        """Fix the joint names and which of position, velocity and effort are filled."""
        self._names = tuple(names)
        self._blocks = tuple(blocks)
        n = len(self._names)
        marked = {block: np.full(n, float(i + 1)) for i, block in enumerate(self._blocks)}
        self._template = _joint_state(self._names, marked)
        self._at = {block: _find(self._template, values) for block, values in marked.items()}
        self._fixed = _around(self._template, self._at.values(), n * _DOUBLE)
        self._buffer = bytearray(self._template)
        self._numbers = {block: np.frombuffer(self._buffer, "<f8", n, at) for block, at in self._at.items()}
        self._first_at = min(self._at.values())
        self._count = (max(self._at.values()) - self._first_at) // _DOUBLE + n  # of numbers, lengths included

    def pack(self, stamp_ns: int, **blocks: Array) -> bytes:
        """Return the bytes of a message with a stamp and the arrays (n,) of every block."""
        _STAMP.pack_into(self._buffer, _STAMP_AT, stamp_ns // NS_PER_S, stamp_ns % NS_PER_S)
        for block, numbers in self._numbers.items():
            numbers[:] = blocks[block]
        return bytes(self._buffer)

    def read(self, data: bytes) -> dict[str, Array]:
        """Return the arrays (n,) of every block in the order of the joints; raises MessageError."""
        if len(data) == len(self._template) and self._same_layout(data):
            n = len(self._names)
            return {block: np.frombuffer(data, "<f8", n, at) for block, at in self._at.items()}
        message = decoded(data, JointState)
        return {b: joints_in_order(self._names, message.name, getattr(message, b)) for b in self._blocks}

    def check(self, data: bytes) -> None:
        """Raise MessageError unless the message has every joint with finite numbers.

        What stands between the blocks of the template is their length, which is finite too if it is
        taken for a number, so one look is enough for all of them.
        """
        if len(data) == len(self._template) and self._same_layout(data):
            check_finite(np.frombuffer(data, "<f8", self._count, self._first_at), "a joint message")
            return
        for block, values in self.read(data).items():
            check_finite(values, f"{block} in a joint message")

    def _same_layout(self, data: bytes) -> bool:
        """Tell whether the bytes are little endian and have names and lengths where the template has them."""
        if not data.startswith(_LITTLE_ENDIAN):
            return False
        for at, part in self._fixed:  # noqa: SIM110  all() with a generator takes three times as long
            if not data.startswith(part, at):
                return False
        return True


class OdometryWire:
    """Packs and reads Odometry messages between two frames; covariances stay zero."""

    def __init__(self, frame: str, child_frame: str) -> None:
        """Fix the names of the frames."""
        self._frames = (frame, child_frame)
        pose, twist = np.arange(1.0, 8.0), np.arange(11.0, 17.0)
        self._template = _odometry(frame, child_frame, pose, twist)
        self._pose_at = _find(self._template, pose)
        self._twist_at = _find(self._template, twist)
        self._fixed = self._template[_BODY_AT : self._pose_at]
        self._buffer = bytearray(self._template)
        self._pose = np.frombuffer(self._buffer, "<f8", BASE_NQ, self._pose_at)
        self._twist = np.frombuffer(self._buffer, "<f8", BASE_NV, self._twist_at)

    def pack(self, stamp_ns: int, pose: Array, twist: Array) -> bytes:
        """Return the bytes of a message with a stamp.

        ``pose`` (7,) is position and quaternion x y z w, ``twist`` (6,) the linear, then the angular part.
        """
        _STAMP.pack_into(self._buffer, _STAMP_AT, stamp_ns // NS_PER_S, stamp_ns % NS_PER_S)
        self._pose[:] = pose
        self._twist[:] = twist
        return bytes(self._buffer)

    def read(self, data: bytes) -> tuple[Array, Array]:
        """Return pose (7,) and twist (6,) as they are packed; raises MessageError on others."""
        if len(data) >= len(self._template) and self._same_layout(data):
            pose = np.frombuffer(data, "<f8", BASE_NQ, self._pose_at)
            return pose, np.frombuffer(data, "<f8", BASE_NV, self._twist_at)
        message = decoded(data, Odometry)
        frames = (message.header.frame_id, message.child_frame_id)
        if frames != self._frames:
            text = f"an odometry message is between frames {frames}, expected {self._frames}"
            raise MessageError(Reason.FRAME, text)
        linear, angular = message.twist.twist.linear, message.twist.twist.angular
        twist = [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
        return pose_row(pose_of_message(message.pose.pose)), np.array(twist)

    def check(self, data: bytes) -> None:
        """Raise MessageError unless frames, rotation and numbers are good."""
        pose, twist = self.read(data)
        check_finite(pose, "the pose of an odometry message")
        check_finite(twist, "the twist of an odometry message")
        check_unit(pose[3:], "an odometry message")

    def _same_layout(self, data: bytes) -> bool:
        """Tell whether the bytes are little endian and have the frames of the template."""
        return data.startswith(_LITTLE_ENDIAN) and data.startswith(self._fixed, _BODY_AT)


class StampedWire:
    """Packs messages that are a header and then a fixed count of doubles, such as PoseStamped."""

    def __init__(
        self, type_name: str, frame: str, fields: Callable[[MessageTypes, Array], dict[str, Any]]
    ) -> None:
        """Fix type and frame; ``fields`` makes the fields beside the header from some numbers."""
        types = MessageTypes()
        numbers = np.arange(1.0, 16.0)
        message = types.make(type_name, header=_header(types, frame), **fields(types, numbers))
        self._template = types.serialize(message)
        self._at = self._template.index(numbers[:1].tobytes())

    def read(self, data: bytes) -> Array | None:
        """Return the numbers in the bytes of a message, or None if it is of another layout."""
        if len(data) != len(self._template) or not data.startswith(_LITTLE_ENDIAN):
            return None
        if not data.startswith(self._template[_BODY_AT : self._at], _BODY_AT):
            return None
        return np.frombuffer(data, "<f8", offset=self._at)

    def pack(self, stamp_ns: int, numbers: Array) -> bytes:
        """Return the bytes of a message with a stamp and all its numbers in the order of the fields."""
        buffer = bytearray(self._template)
        _STAMP.pack_into(buffer, _STAMP_AT, stamp_ns // NS_PER_S, stamp_ns % NS_PER_S)
        if numbers.nbytes != len(buffer) - self._at:
            raise GraphError(f"{numbers.size} numbers do not fill a message of this layout")
        buffer[self._at :] = numbers.tobytes()
        return bytes(buffer)


class PoseWire(StampedWire):
    """Packs and reads PoseStamped in one frame: position, then quaternion x y z w."""

    def __init__(self, frame: str) -> None:
        """Fix the frame."""
        super().__init__("geometry_msgs/msg/PoseStamped", frame, lambda types, n: {"pose": _pose(types, n)})
        self._frame = frame

    def read_pose(self, data: bytes) -> Pose:
        """Return the pose in the bytes of a message of any layout; raises MessageError."""
        numbers = self.read(data)
        if numbers is not None:
            return Pose(numbers[:3], numbers[3:])
        message = decoded(data, PoseStamped)
        if message.header.frame_id != self._frame:
            text = f"a pose is in frame {message.header.frame_id!r}, expected {self._frame!r}"
            raise MessageError(Reason.FRAME, text)
        return pose_of_message(message.pose)

    def check(self, data: bytes) -> None:
        """Raise MessageError unless frame, rotation and numbers are good."""
        pose = pose_row(self.read_pose(data))
        check_finite(pose, "a pose")
        check_unit(pose[3:], "a pose")


def vector_wire(frame: str) -> StampedWire:
    """Return what packs Vector3Stamped."""
    name = "geometry_msgs/msg/Vector3Stamped"
    return StampedWire(name, frame, lambda types, n: {"vector": _geometry(types, "Vector3", n[:3])})


def energy_wire(frame: str) -> StampedWire:
    """Return what packs EnergyStamped: kinetic energy, then work."""
    name = "sms_handover_interfaces/msg/EnergyStamped"
    return StampedWire(name, frame, lambda types, n: {"kinetic": float(n[0]), "work": float(n[1])})


class StateWire:
    """Packs and reads the two messages that carry a robot state."""

    def __init__(self, joint_names: Sequence[str], world: str, base: str) -> None:
        """Fix joint and frame names."""
        self.joints = JointStateWire(joint_names, ("position", "velocity", "effort"))
        self.odometry = OdometryWire(world, base)

    def pack(self, state: RobotState) -> tuple[bytes, bytes]:
        """Return the bytes of the JointState and the Odometry of a state."""
        joints = self.joints.pack(
            state.stamp_ns,
            position=state.joint_position,
            velocity=state.joint_velocity,
            effort=state.joint_effort,
        )
        odometry = self.odometry.pack(state.stamp_ns, state.q[:BASE_NQ], state.v[:BASE_NV])
        return joints, odometry

    def read(self, joints: bytes, odometry: bytes) -> RobotState:
        """Return the state that two messages of equal stamp carry."""
        blocks = self.joints.read(joints)
        base_in_world, twist_base_in_base = self.odometry.read(odometry)
        q = frozen(np.concatenate([base_in_world, blocks["position"]]))
        v = frozen(np.concatenate([twist_base_in_base, blocks["velocity"]]))
        return RobotState(stamp_ns(joints), q, v, blocks["effort"])


def decoded(data: bytes, kind: Any) -> Any:
    """Return a message of any layout, order and sender; raises MessageError if it is not of this class."""
    if len(data) > _LARGEST:
        raise MessageError(Reason.MALFORMED, f"a message has {len(data)} bytes, allowed are {_LARGEST}")
    try:
        return deserialize_message(data, kind)
    except (_RmwError, UnicodeDecodeError) as error:
        text = f"{len(data)} bytes do not decode as {kind.__name__}"
        raise MessageError(Reason.MALFORMED, text) from error


def arrival_ns(data: bytes) -> int:
    """Return the stamp in the bytes of a message in ns; raises MessageError if it is none."""
    try:
        stamp = stamp_ns(data)
    except BagError as error:
        raise MessageError(Reason.MALFORMED, str(error)) from error
    if stamp < 0:
        raise MessageError(Reason.OLD, f"a message is stamped {ns_to_seconds(stamp):g} s, before any run")
    return stamp


def check_stamp(data: bytes) -> None:
    """Raise MessageError unless a message begins with a stamp, of which there is nothing else to check."""
    arrival_ns(data)


def _joint_state(names: tuple[str, ...], blocks: dict[str, Array]) -> bytes:
    """Return the bytes of a JointState with stamp zero; blocks that are not given are empty."""
    types = MessageTypes()
    arrays = {block: blocks.get(block, np.zeros(0)) for block in ("position", "velocity", "effort")}
    message = types.make("sensor_msgs/msg/JointState", header=_header(types, ""), name=list(names), **arrays)
    return types.serialize(message)


def _odometry(frame: str, child_frame: str, pose: Array, twist: Array) -> bytes:
    """Return the bytes of an Odometry with stamp zero and zero covariances."""
    types = MessageTypes()
    linear, angular = (_geometry(types, "Vector3", part) for part in (twist[:3], twist[3:]))
    motion = types.make("geometry_msgs/msg/Twist", linear=linear, angular=angular)
    covariance = {"covariance": np.zeros(36)}
    message = types.make(
        "nav_msgs/msg/Odometry",
        header=_header(types, frame),
        child_frame_id=child_frame,
        pose=types.make("geometry_msgs/msg/PoseWithCovariance", pose=_pose(types, pose), **covariance),
        twist=types.make("geometry_msgs/msg/TwistWithCovariance", twist=motion, **covariance),
    )
    return types.serialize(message)


def _pose(types: MessageTypes, numbers: Array) -> Any:
    """Return a Pose message from position and quaternion."""
    position = _geometry(types, "Point", numbers[:3])
    return types.make(
        "geometry_msgs/msg/Pose", position=position, orientation=_geometry(types, "Quaternion", numbers[3:7])
    )


def _geometry(types: MessageTypes, name: str, numbers: Array) -> Any:
    """Return a Point, Vector3 or Quaternion message from its components."""
    return types.make(f"geometry_msgs/msg/{name}", **dict(zip("xyzw", numbers.tolist(), strict=False)))


def _header(types: MessageTypes, frame: str) -> Any:
    """Return a header with stamp zero."""
    time = types.make("builtin_interfaces/msg/Time", sec=0, nanosec=0)
    return types.make("std_msgs/msg/Header", stamp=time, frame_id=frame)


def _around(template: bytes, starts: Collection[int], size: int) -> tuple[tuple[int, bytes], ...]:
    """Return the bytes behind the stamp that every message of a layout has, each part with its place.

    They are what is left when ``size`` bytes of numbers are taken out at each of ``starts``.
    """
    begins = [_BODY_AT, *(start + size for start in starts)]
    ends = [*starts, len(template)]
    return tuple((begin, template[begin:end]) for begin, end in zip(begins, ends, strict=True))


def _find(raw: bytes, values: Array) -> int:
    """Return where the doubles of an array stand in the bytes of a message."""
    return raw.index(values.tobytes())
