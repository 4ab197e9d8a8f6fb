"""The templates of the hot path give and take the very bytes that any other CDR library does."""

from collections.abc import Mapping
from itertools import permutations
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseStamped, Vector3, Vector3Stamped
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState
from sms_handover_interfaces.msg import EnergyStamped

from sms_handover.errors import GraphError
from sms_handover.messages.stamps import stamp_ns
from sms_handover.ros.codecs.convert import header, set_pose, time_message
from sms_handover.ros.codecs.loop_messages import (
    JointStateCodec,
    OdometryCodec,
    PoseCodec,
    StateCodec,
    energy_codec,
    vector_codec,
)
from sms_handover.types import Array, Pose, RobotState
from sms_handover.units import NS_PER_S

JOINTS = tuple(f"{arm}_joint_{number}" for arm in ("arm_a", "arm_b") for number in range(1, 8))
BLOCKS = ("position", "velocity", "effort")
FILLED = (
    BLOCKS,
    ("position", "velocity"),
    ("position", "effort"),
    ("velocity", "effort"),
    ("position",),
    ("velocity",),
    ("effort",),
)
STAMPS = (0, 1, 999_999_999, NS_PER_S, 61_234_567_890, (2**31 - 1) * NS_PER_S + 999_999_999)
AWKWARD = (0.0, -0.0, 5e-324, -1.7976931348623157e308, np.inf, np.nan, 0.1, -2.0 / 3.0)

ROSBAGS = get_typestore(Stores.ROS2_JAZZY)


def numbers(size: int, seed: int = 0) -> Array:
    """Return random numbers, the first of them awkward."""
    values = np.random.default_rng(seed).normal(size=size)
    awkward = AWKWARD[:size]
    values[: len(awkward)] = awkward
    return values


def rosbags_message(type_name: str, **values: Any) -> Any:
    return ROSBAGS.types[type_name](**values)


def rosbags_header(stamp: int, frame: str) -> Any:
    time = rosbags_message("builtin_interfaces/msg/Time", sec=stamp // NS_PER_S, nanosec=stamp % NS_PER_S)
    return rosbags_message("std_msgs/msg/Header", stamp=time, frame_id=frame)


def joint_state(
    names: tuple[str, ...],
    blocks: Mapping[str, Array],
    stamp: int = 0,
    *,
    frame: str = "",
    little_endian: bool = True,
) -> bytes:
    """Return a JointState as rosbags serialises it; blocks not given are empty."""
    arrays = {block: blocks.get(block, np.zeros(0)) for block in BLOCKS}
    header = rosbags_header(stamp, frame)
    message = rosbags_message("sensor_msgs/msg/JointState", header=header, name=list(names), **arrays)
    data = ROSBAGS.serialize_cdr(message, "sensor_msgs/msg/JointState", little_endian=little_endian)
    return bytes(data)


def geometry(name: str, fields: str, values: Array) -> Any:
    """Return a Point, Vector3 or Quaternion."""
    return rosbags_message(f"geometry_msgs/msg/{name}", **dict(zip(fields, values.tolist(), strict=True)))


def odometry(
    frames: tuple[str, str],
    stamp: int,
    pose: Array,
    twist: Array,
    *,
    covariance: float = 0.0,
    little_endian: bool = True,
) -> bytes:
    """Return an Odometry as rosbags serialises it."""
    where = rosbags_message(
        "geometry_msgs/msg/Pose",
        position=geometry("Point", "xyz", pose[:3]),
        orientation=geometry("Quaternion", "xyzw", pose[3:]),
    )
    motion = rosbags_message(
        "geometry_msgs/msg/Twist",
        linear=geometry("Vector3", "xyz", twist[:3]),
        angular=geometry("Vector3", "xyz", twist[3:]),
    )
    spread = np.full(36, covariance)
    message = rosbags_message(
        "nav_msgs/msg/Odometry",
        header=rosbags_header(stamp, frames[0]),
        child_frame_id=frames[1],
        pose=rosbags_message("geometry_msgs/msg/PoseWithCovariance", pose=where, covariance=spread),
        twist=rosbags_message("geometry_msgs/msg/TwistWithCovariance", twist=motion, covariance=spread),
    )
    data = ROSBAGS.serialize_cdr(message, "nav_msgs/msg/Odometry", little_endian=little_endian)
    return bytes(data)


def same_bits(a: Array, b: Array) -> bool:
    return a.shape == b.shape and a.tobytes() == b.tobytes()


def no_general_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail whatever falls back to reading a message field by field."""

    def fail(*_: object) -> None:
        raise AssertionError("not read by the template")

    monkeypatch.setattr("sms_handover.ros.codecs.loop_messages.deserialize_message", fail)


# Joint states


@pytest.mark.parametrize("stamp", STAMPS)
@pytest.mark.parametrize("blocks", FILLED)
def test_joint_state_has_the_bytes_of_rosbags(blocks: tuple[str, ...], stamp: int) -> None:
    values = {block: numbers(len(JOINTS), seed) for seed, block in enumerate(blocks)}
    packed = JointStateCodec(JOINTS, blocks).pack(stamp, **values)
    assert packed == joint_state(JOINTS, values, stamp)
    assert stamp_ns(packed) == stamp


@pytest.mark.parametrize("length", range(1, 10))
def test_names_of_any_length_keep_the_alignment(length: int) -> None:
    names = tuple(f"{number}".rjust(length, "j") for number in range(3))
    values = {block: numbers(3, seed) for seed, block in enumerate(BLOCKS)}
    codec = JointStateCodec(names, BLOCKS)
    packed = codec.pack(5, **values)
    assert packed == joint_state(names, values, 5)
    read = codec.read(packed)
    assert all(same_bits(read[block], values[block]) for block in BLOCKS)


def test_rclpy_reads_the_template() -> None:
    values = {block: np.arange(14.0) + seed for seed, block in enumerate(BLOCKS)}
    message: Any = deserialize_message(
        JointStateCodec(JOINTS, BLOCKS).pack(61_234_567_890, **values), JointState
    )
    assert tuple(message.name) == JOINTS
    assert message.header.stamp == time_message(61_234_567_890)
    assert message.header.frame_id == ""
    assert all(list(getattr(message, block)) == values[block].tolist() for block in BLOCKS)


@pytest.mark.parametrize("blocks", FILLED)
def test_own_messages_are_read_by_the_template(
    blocks: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    no_general_path(monkeypatch)
    values = {block: numbers(len(JOINTS), seed) for seed, block in enumerate(blocks)}
    codec = JointStateCodec(JOINTS, blocks)
    read = codec.read(codec.pack(3, **values))
    assert list(read) == list(blocks)
    assert all(same_bits(read[block], values[block]) for block in blocks)
    assert not any(array.flags.writeable for array in read.values())


def test_packing_leaves_nothing_behind() -> None:
    codec = JointStateCodec(JOINTS, BLOCKS)
    first = {block: numbers(14, seed) for seed, block in enumerate(BLOCKS)}
    before = codec.pack(7, **first)
    codec.pack(8, **{block: np.zeros(14) for block in BLOCKS})
    assert codec.pack(7, **first) == before


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_joints_are_found_by_name(order: tuple[int, ...]) -> None:
    names = ("one", "two", "six")
    values = {block: numbers(3, seed) for seed, block in enumerate(BLOCKS)}
    sent = joint_state(
        tuple(names[i] for i in order), {block: values[block][list(order)] for block in BLOCKS}
    )
    read = JointStateCodec(names, BLOCKS).read(sent)
    assert all(same_bits(read[block], values[block]) for block in BLOCKS)


def test_joints_of_other_robots_are_passed_over() -> None:
    sent = joint_state(("x", "two", "y", "one"), {"effort": np.array([1.0, 2.0, 3.0, 4.0])})
    assert JointStateCodec(("one", "two"), ("effort",)).read(sent)["effort"].tolist() == [4.0, 2.0]


@pytest.mark.parametrize("trailing", [1, 4, 8])
@pytest.mark.parametrize("frame", ["", "x", "base_link"])
def test_frame_and_bytes_behind_the_end_do_not_matter(frame: str, trailing: int) -> None:
    values = {block: numbers(14, seed) for seed, block in enumerate(BLOCKS)}
    sent = joint_state(JOINTS, values, frame=frame) + b"\xaa" * trailing
    read = JointStateCodec(JOINTS, BLOCKS).read(sent)
    assert all(same_bits(read[block], values[block]) for block in BLOCKS)


def test_messages_of_rclpy_are_read() -> None:
    values = {block: np.arange(14.0) + seed for seed, block in enumerate(BLOCKS)}
    message = JointState(name=list(JOINTS), **{block: array.tolist() for block, array in values.items()})
    read = JointStateCodec(JOINTS, BLOCKS).read(serialize_message(message))
    assert all(same_bits(read[block], values[block]) for block in BLOCKS)


def test_padding_may_hold_anything() -> None:
    values = {block: numbers(14, seed) for seed, block in enumerate(BLOCKS)}
    clean = joint_state(JOINTS, values)
    padded = bytearray(clean)
    first_name = clean.index(b"arm_a_joint_1\0")
    assert clean[first_name + 14 : first_name + 16] == b"\0\0"  # up to the next multiple of four
    padded[first_name + 14 : first_name + 16] = b"\xaa\xbb"
    read = JointStateCodec(JOINTS, BLOCKS).read(bytes(padded))
    assert all(same_bits(read[block], values[block]) for block in BLOCKS)


@pytest.mark.parametrize("blocks", FILLED)
def test_big_endian_is_read(blocks: tuple[str, ...]) -> None:
    values = {block: numbers(14, seed) for seed, block in enumerate(blocks)}
    sent = joint_state(JOINTS, values, 61_234_567_890, little_endian=False)
    assert stamp_ns(sent) == 61_234_567_890
    read = JointStateCodec(JOINTS, blocks).read(sent)
    assert all(same_bits(read[block], values[block]) for block in blocks)


def test_a_missing_joint_is_named() -> None:
    sent = joint_state(JOINTS[:-1], {"effort": np.zeros(13)})
    with pytest.raises(GraphError, match="lacks 'arm_b_joint_7'"):
        JointStateCodec(JOINTS, ("effort",)).read(sent)


def test_an_empty_block_is_refused() -> None:
    sent = joint_state(JOINTS, dict.fromkeys(("position", "velocity"), np.zeros(14)))
    with pytest.raises(GraphError, match="14 names and 0 values"):
        JointStateCodec(JOINTS, BLOCKS).read(sent)


@pytest.mark.parametrize("trailing", [0, 4, 8])
@pytest.mark.parametrize("wanted", FILLED)
@pytest.mark.parametrize("sent", FILLED)
def test_one_block_is_never_taken_for_another(
    sent: tuple[str, ...], wanted: tuple[str, ...], trailing: int
) -> None:
    """A message of other blocks may happen to be as long as the template, with bytes behind its end."""
    values = {block: np.arange(14.0) + 100.0 * BLOCKS.index(block) for block in sent}
    data = joint_state(JOINTS, values) + bytes(trailing)
    codec = JointStateCodec(JOINTS, wanted)
    if set(wanted) <= set(sent):
        read = codec.read(data)
        assert all(same_bits(read[block], values[block]) for block in wanted)
    else:
        with pytest.raises(GraphError, match="14 names and 0 values"):
            codec.read(data)


# Odometry


@pytest.mark.parametrize("stamp", STAMPS)
@pytest.mark.parametrize("frames", [("world", "base_link"), ("w", "b"), ("map", "spacecraft"), ("", "")])
def test_odometry_has_the_bytes_of_rosbags(frames: tuple[str, str], stamp: int) -> None:
    pose, twist = numbers(7, 1), numbers(6, 2)
    packed = OdometryCodec(*frames).pack(stamp, pose, twist)
    assert packed == odometry(frames, stamp, pose, twist)
    assert stamp_ns(packed) == stamp


def test_rclpy_reads_the_odometry() -> None:
    pose, twist = np.arange(7.0), np.arange(6.0)
    packed = OdometryCodec("world", "base_link").pack(3_000_000_004, pose, twist)
    message: Any = deserialize_message(packed, Odometry)
    assert (message.header.frame_id, message.child_frame_id) == ("world", "base_link")
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (3, 4)
    assert message.pose.pose == set_pose(PoseMessage(), Pose(pose[:3], pose[3:]))
    assert (message.twist.twist.linear.z, message.twist.twist.angular.x) == (2.0, 3.0)
    assert not np.any(message.pose.covariance) and not np.any(message.twist.covariance)


def test_own_odometry_is_read_by_the_template(monkeypatch: pytest.MonkeyPatch) -> None:
    no_general_path(monkeypatch)
    pose, twist = numbers(7, 1), numbers(6, 2)
    codec = OdometryCodec("world", "base_link")
    read_pose, read_twist = codec.read(codec.pack(8, pose, twist))
    assert same_bits(read_pose, pose)
    assert same_bits(read_twist, twist)


@pytest.mark.parametrize("little_endian", [True, False])
@pytest.mark.parametrize("trailing", [0, 3, 8])
def test_foreign_odometry_is_read(little_endian: bool, trailing: int) -> None:
    pose, twist = numbers(7, 1), numbers(6, 2)
    data = odometry(
        ("world", "base_link"), 5, pose, twist, covariance=0.5, little_endian=little_endian
    ) + bytes(trailing)
    read_pose, read_twist = OdometryCodec("world", "base_link").read(data)
    assert same_bits(read_pose, pose)
    assert same_bits(read_twist, twist)


@pytest.mark.parametrize(
    "frames",
    [("world", "base"), ("map", "base_link"), ("base_link", "world"), ("", ""), ("worlds", "bas_link")],
)
@pytest.mark.parametrize("little_endian", [True, False])
def test_other_frames_are_refused(frames: tuple[str, str], little_endian: bool) -> None:
    data = odometry(frames, 5, np.arange(7.0), np.arange(6.0), little_endian=little_endian)
    with pytest.raises(GraphError, match=r"between frames .*expected \('world', 'base_link'\)") as caught:
        OdometryCodec("world", "base_link").read(data)
    assert str(frames) in str(caught.value)


# What is a header and some numbers


@pytest.mark.parametrize("stamp", STAMPS)
@pytest.mark.parametrize("frame", ["", "w", "wo", "wor", "worl", "world", "base_link"])
def test_stamped_messages_have_the_bytes_of_rosbags(frame: str, stamp: int) -> None:
    values, header = numbers(7, 1), rosbags_header(stamp, frame)
    pose = rosbags_message(
        "geometry_msgs/msg/Pose",
        position=geometry("Point", "xyz", values[:3]),
        orientation=geometry("Quaternion", "xyzw", values[3:]),
    )
    stamped = rosbags_message("geometry_msgs/msg/PoseStamped", header=header, pose=pose)
    expected = bytes(ROSBAGS.serialize_cdr(stamped, "geometry_msgs/msg/PoseStamped"))
    assert PoseCodec(frame).pack(stamp, values) == expected
    vector = geometry("Vector3", "xyz", values[:3])
    stamped = rosbags_message("geometry_msgs/msg/Vector3Stamped", header=header, vector=vector)
    expected = bytes(ROSBAGS.serialize_cdr(stamped, "geometry_msgs/msg/Vector3Stamped"))
    assert vector_codec(frame).pack(stamp, values[:3]) == expected


def test_rclpy_reads_the_stamped_messages() -> None:
    values = np.arange(1.0, 8.0)
    pose: Any = deserialize_message(PoseCodec("world").pack(3_000_000_004, values), PoseStamped)
    assert (pose.header, pose.pose) == (
        header(3_000_000_004),
        set_pose(PoseMessage(), Pose(values[:3], values[3:])),
    )
    vector: Any = deserialize_message(vector_codec("world").pack(5, values[:3]), Vector3Stamped)
    assert vector == Vector3Stamped(header=header(5), vector=Vector3(x=1.0, y=2.0, z=3.0))
    energy: Any = deserialize_message(energy_codec("world").pack(6, values[:4]), EnergyStamped)
    account = {"kinetic": 1.0, "work": 2.0, "external_work": 3.0, "lost": 4.0}
    assert energy == EnergyStamped(header=header(6), **account)


@pytest.mark.parametrize("size", [0, 2, 4, 7])
def test_numbers_that_do_not_fill_a_message_are_refused(size: int) -> None:
    with pytest.raises(GraphError, match=f"{size} numbers do not fill"):
        vector_codec("world").pack(0, np.zeros(size))


# Both


def test_a_state_comes_back_bit_for_bit() -> None:
    q, v = numbers(7 + 14, 1), numbers(6 + 14, 2)
    state = RobotState(61_234_567_890, q, v, numbers(14, 3))
    codec = StateCodec(JOINTS, "world", "base_link")
    read = codec.read(*codec.pack(state))
    assert read.stamp_ns == state.stamp_ns
    for name in ("joint_position", "joint_velocity", "joint_effort"):
        assert same_bits(getattr(read, name), getattr(state, name))
    assert same_bits(read.base_in_world.position, q[:3])
    assert same_bits(read.base_in_world.quaternion_xyzw, q[3:7])
    assert same_bits(read.twist_base_in_base.linear, v[:3])
    assert same_bits(read.twist_base_in_base.angular, v[3:6])
