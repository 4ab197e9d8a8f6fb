"""Loop messages as CDR bytes, packed and read by the layout of a prototype.

A JointState or Odometry of the loop has the same names every time, so its layout is fixed. A message of
another layout (other names, other order, another sender's padding) is read the general way, by name.
"""

from collections.abc import Callable, Collection, Sequence
from typing import Any, TypeVar

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from sms_handover.errors import BagError, GraphError, MessageError, Reason
from sms_handover.messages.layout import Layout, joint_state, numbers_behind_header, odometry
from sms_handover.messages.message_types import MessageTypes
from sms_handover.messages.stamps import stamp_ns
from sms_handover.model.poses import pose_row
from sms_handover.ros.codecs.convert import joints_in_order, pose_of_message
from sms_handover.ros.codecs.validation import check_finite, check_unit
from sms_handover.types import BASE_NQ, BASE_NV, Array, Pose, RobotState, frozen
from sms_handover.units import ns_to_seconds

_RmwError = rclpy_implementation.RMWError

T = TypeVar("T")
Stamped = tuple[int, T]  # stamp of a message in ns, and what is in it

_BLOCKS = ("position", "velocity", "effort")  # of a JointState, as they stand in it
_COVARIANCE = 36  # numbers of an Odometry behind its pose, and behind its twist
_POSE, _TWIST = 0, 2  # among the blocks of an Odometry
_LARGEST = 65536  # [byte] of a message of another layout


class JointStateCodec:
    """Packs and reads JointState messages for one list of joints."""

    def __init__(self, names: Sequence[str], blocks: Sequence[str]) -> None:
        """Fix the joint names and which of position, velocity and effort are filled."""
        self._names = tuple(names)
        self._blocks = tuple(block for block in _BLOCKS if block in blocks)
        wanted = [_BLOCKS.index(block) for block in self._blocks]
        self._layout = Layout(_joint_state(self._names, self._blocks), joint_state, wanted)
        self._parts = self._layout.parts

    def pack(self, stamp_ns: int, **blocks: Array) -> bytes:
        """Return the bytes of a message with a stamp and the arrays (n,) of every block."""
        return self._layout.pack(stamp_ns, *[blocks[block] for block in self._blocks])

    def read(self, data: bytes) -> dict[str, Array]:
        """Return the arrays (n,) of every block in the order of the joints; raises MessageError."""
        if self._layout.stamp_of(data) is None:
            return self._read_anyway(data)
        numbers = self._layout.numbers(data)
        return {block: numbers[part] for block, part in zip(self._blocks, self._parts, strict=True)}

    def checked(self, data: bytes) -> Stamped[tuple[Array, ...]]:
        """Return the stamp and the arrays (n,) of every block of a good message, read-only.

        Raises MessageError unless it has every joint with finite numbers.
        """
        stamp = self._layout.stamp_of(data)
        if stamp is None:
            blocks = self._read_anyway(data)
            for block, values in blocks.items():
                check_finite(values, f"{block} in a joint message")
            return arrival_ns(data), tuple(map(frozen, blocks.values()))
        numbers = self._layout.numbers(data)
        check_finite(numbers, "a joint message")
        return stamp, tuple([numbers[part] for part in self._parts])

    def _read_anyway(self, data: bytes) -> dict[str, Array]:
        """Return the arrays of every block of a message of any layout; raises MessageError."""
        message = decoded(data, JointState)
        return {b: joints_in_order(self._names, message.name, getattr(message, b)) for b in self._blocks}


class OdometryCodec:
    """Packs and reads Odometry messages between two frames; covariances stay zero."""

    def __init__(self, frame: str, child_frame: str) -> None:
        """Fix the names of the frames."""
        self._frames = (frame, child_frame)
        self._layout = Layout(_odometry(frame, child_frame), odometry, (_POSE, _TWIST))
        self._pose, self._twist = self._layout.parts

    def pack(self, stamp_ns: int, pose: Array, twist: Array) -> bytes:
        """Return the bytes of a message with a stamp.

        ``pose`` (7,) is position and quaternion x y z w, ``twist`` (6,) the linear, then the angular part.
        """
        return self._layout.pack(stamp_ns, pose, twist)

    def read(self, data: bytes) -> tuple[Array, Array]:
        """Return pose (7,) and twist (6,) as they are packed; raises MessageError on others."""
        if self._layout.stamp_of(data) is None:
            return self._read_anyway(data)
        numbers = self._layout.numbers(data)
        return numbers[self._pose], numbers[self._twist]

    def checked(self, data: bytes) -> Stamped[tuple[Array, Array]]:
        """Return the stamp, and pose (7,) and twist (6,), of a good message, read-only.

        Raises MessageError unless frames, rotation and numbers are good.
        """
        stamp = self._layout.stamp_of(data)
        if stamp is None:
            pose, twist = map(frozen, self._read_anyway(data))
        else:
            numbers = self._layout.numbers(data)
            pose, twist = numbers[self._pose], numbers[self._twist]
        check_finite(pose, "the pose of an odometry message")
        check_finite(twist, "the twist of an odometry message")
        check_unit(pose[3:], "an odometry message")
        return arrival_ns(data) if stamp is None else stamp, (pose, twist)

    def _read_anyway(self, data: bytes) -> tuple[Array, Array]:
        """Return pose and twist of a message of any layout; raises MessageError."""
        message = decoded(data, Odometry)
        frames = (message.header.frame_id, message.child_frame_id)
        if frames != self._frames:
            text = f"an odometry message is between frames {frames}, expected {self._frames}"
            raise MessageError(Reason.FRAME, text)
        linear, angular = message.twist.twist.linear, message.twist.twist.angular
        twist = [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
        return pose_row(pose_of_message(message.pose.pose)), np.array(twist)


class StampedCodec:
    """Packs messages that are a header and then a fixed count of doubles, such as PoseStamped."""

    def __init__(
        self, type_name: str, frame: str, count: int, fields: Callable[[MessageTypes, Array], dict[str, Any]]
    ) -> None:
        """Fix type and frame; ``fields`` makes the fields beside the header from ``count`` numbers."""
        types = MessageTypes()
        self._count = count
        message = types.make(type_name, header=_header(types, frame), **fields(types, np.zeros(count)))
        self._layout = Layout(types.serialize(message), numbers_behind_header(count), (0,))

    def pack(self, stamp_ns: int, numbers: Array) -> bytes:
        """Return the bytes of a message with a stamp and all its numbers in the order of the fields."""
        if numbers.size != self._count:
            raise GraphError(f"{numbers.size} numbers do not fill a message of this layout")
        return self._layout.pack(stamp_ns, numbers)


class PoseCodec(StampedCodec):
    """Packs and reads PoseStamped in one frame: position, then quaternion x y z w."""

    def __init__(self, frame: str) -> None:
        super().__init__(
            "geometry_msgs/msg/PoseStamped", frame, BASE_NQ, lambda types, n: {"pose": pose_message(types, n)}
        )
        self._frame = frame

    def read_pose(self, data: bytes) -> Pose:
        """Return the pose in the bytes of a message of any layout; raises MessageError."""
        if self._layout.stamp_of(data) is not None:
            numbers = self._layout.numbers(data)
            return Pose(numbers[:3], numbers[3:])
        message = decoded(data, PoseStamped)
        if message.header.frame_id != self._frame:
            text = f"a pose is in frame {message.header.frame_id!r}, expected {self._frame!r}"
            raise MessageError(Reason.FRAME, text)
        return pose_of_message(message.pose)

    def checked(self, data: bytes) -> Stamped[Pose]:
        """Return stamp and pose of a message; raises MessageError unless frame and numbers are good."""
        pose = self.read_pose(data)
        check_finite(pose_row(pose), "a pose")
        check_unit(pose.quaternion_xyzw, "a pose")
        return arrival_ns(data), pose


def vector_codec(frame: str) -> StampedCodec:
    """Return what packs Vector3Stamped."""
    name = "geometry_msgs/msg/Vector3Stamped"
    return StampedCodec(name, frame, 3, lambda types, n: {"vector": geometry(types, "Vector3", n)})


def energy_codec(frame: str) -> StampedCodec:
    """Return what packs EnergyStamped: kinetic energy, work, external work, losses."""
    name, fields = "sms_handover_interfaces/msg/EnergyStamped", ("kinetic", "work", "external_work", "lost")
    return StampedCodec(name, frame, 4, lambda types, n: dict(zip(fields, n.tolist(), strict=True)))


class StateCodec:
    """Packs and reads the two messages that carry a robot state."""

    def __init__(self, joint_names: Sequence[str], world: str, base: str) -> None:
        """Fix joint and frame names."""
        self.joints = JointStateCodec(joint_names, _BLOCKS)
        self.odometry = OdometryCodec(world, base)

    def pack(self, state: RobotState) -> tuple[bytes, bytes]:
        """Return the bytes of the JointState and the Odometry of a state."""
        return self.pack_arrays(state.stamp_ns, state.q, state.v, state.joint_effort)

    def pack_arrays(self, stamp_ns: int, q: Array, v: Array, joint_effort: Array) -> tuple[bytes, bytes]:
        """Return the same for a state as bare arrays."""
        position, velocity = q[BASE_NQ:], v[BASE_NV:]
        joints = self.joints.pack(stamp_ns, position=position, velocity=velocity, effort=joint_effort)
        return joints, self.odometry.pack(stamp_ns, q[:BASE_NQ], v[:BASE_NV])

    def read(self, joints: bytes, odometry: bytes) -> RobotState:
        """Return the state that two messages of equal stamp carry."""
        blocks = tuple(self.joints.read(joints).values())
        return state_of(stamp_ns(joints), blocks, self.odometry.read(odometry))


def state_of(stamp_ns: int, joints: tuple[Array, ...], odometry: tuple[Array, Array]) -> RobotState:
    """Return the state that two messages carry, from what :class:`StateCodec` has read in them."""
    return RobotState(stamp_ns, *coordinates(joints, odometry), joints[2])


def coordinates(joints: tuple[Array, ...], odometry: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return q (7 + n,) and v (6 + n,) of that state, read-only."""
    position, velocity, _ = joints
    base_in_world, twist_base_in_base = odometry
    q = np.concatenate((base_in_world, position))
    return frozen(q), frozen(np.concatenate((twist_base_in_base, velocity)))


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


def stamped(data: bytes) -> Stamped[bytes]:
    """Return the stamp of a message, of which there is nothing else to check, and its bytes.

    Raises MessageError unless it begins with one.
    """
    return arrival_ns(data), data


def _joint_state(names: tuple[str, ...], filled: Collection[str]) -> bytes:
    """Return the bytes of a JointState of zeros; blocks that are not ``filled`` are empty."""
    types = MessageTypes()
    arrays = {block: np.zeros(len(names) if block in filled else 0) for block in _BLOCKS}
    message = types.make("sensor_msgs/msg/JointState", header=_header(types, ""), name=list(names), **arrays)
    return types.serialize(message)


def _odometry(frame: str, child_frame: str) -> bytes:
    """Return the bytes of an Odometry of zeros."""
    types = MessageTypes()
    vector, covariance = geometry(types, "Vector3", np.zeros(3)), np.zeros(_COVARIANCE)
    twist = types.make("geometry_msgs/msg/Twist", linear=vector, angular=vector)
    pose = pose_message(types, np.zeros(BASE_NQ))
    message = types.make(
        "nav_msgs/msg/Odometry",
        header=_header(types, frame),
        child_frame_id=child_frame,
        pose=types.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=covariance),
        twist=types.make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=covariance),
    )
    return types.serialize(message)


def pose_message(types: MessageTypes, numbers: Array) -> Any:
    """Return a Pose message from position and quaternion."""
    position = geometry(types, "Point", numbers[:3])
    return types.make(
        "geometry_msgs/msg/Pose", position=position, orientation=geometry(types, "Quaternion", numbers[3:7])
    )


def geometry(types: MessageTypes, name: str, numbers: Array) -> Any:
    """Return a Point, Vector3 or Quaternion message from its components."""
    return types.make(f"geometry_msgs/msg/{name}", **dict(zip("xyzw", numbers.tolist(), strict=False)))


def _header(types: MessageTypes, frame: str) -> Any:
    """Return a header with stamp zero."""
    time = types.make("builtin_interfaces/msg/Time", sec=0, nanosec=0)
    return types.make("std_msgs/msg/Header", stamp=time, frame_id=frame)
