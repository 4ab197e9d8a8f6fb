"""Message definitions: found, hashed and turned into schemas as rosbag2 and rosidl do."""

import json
from pathlib import Path

import numpy as np
import pytest

from sms_handover.errors import BagError
from sms_handover.graph.topics import TF_TYPE
from sms_handover.messages.message_types import MessageTypes, definition_roots
from sms_handover.messages.stamps import stamp_ns
from sms_handover.messages.transforms import TransformsCodec, transforms_cdr
from sms_handover.types import Pose

from .bag_messages import OURS, TYPES, joint_state, odometry, text

JOINT_STATE_HASH = "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"


def write_definition(root: Path, name: str, content: str) -> None:
    folder = root / "user_msgs" / "msg"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.msg").write_text(content)


def test_type_hash_is_that_of_rosidl() -> None:
    assert TYPES.schema("sensor_msgs/msg/JointState").type_hash == JOINT_STATE_HASH


def test_type_hashes_agree_with_every_installed_description_of_ours() -> None:
    compared = 0
    for root in definition_roots():
        for path in (root / "sms_handover_interfaces" / "msg").glob("*.json"):
            hashes = {
                item["type_name"]: item["hash_string"] for item in json.loads(path.read_text())["type_hashes"]
            }
            name = f"{OURS}/{path.stem}"
            assert TYPES.schema(name).type_hash == hashes[name]
            compared += 1
    if not compared:
        pytest.skip("the interface package is not installed")


def test_schema_text_is_separated_as_rosbag2_does() -> None:
    parts = TYPES.schema(f"{OURS}/TaskPhase").text.split("=" * 80 + "\n")
    assert "\nstd_msgs/Header header\nuint32 index\n" in parts[0]
    assert [part.splitlines()[0] for part in parts[1:]] == [
        "MSG: std_msgs/Header",
        "MSG: builtin_interfaces/Time",
        "MSG: sms_handover_interfaces/GraspCommand",
    ]


def test_our_definitions_are_found_in_the_source_tree() -> None:
    types = MessageTypes(roots=())
    interfaces = Path(__file__).resolve().parent.parent.parent / "interfaces" / "msg"
    for path in interfaces.glob("*.msg"):
        assert types.schema(f"{OURS}/{path.stem}").text


def test_a_type_of_the_user_is_found_with_all_it_is_made_of(tmp_path: Path) -> None:
    write_definition(tmp_path, "Inner", "float64[3] values\nint32 LIMIT=3\n")
    write_definition(tmp_path, "Outer", "std_msgs/Header header\nInner[] inner\nuser_msgs/Inner one\n")
    types = MessageTypes([tmp_path])
    schema = types.schema("user_msgs/msg/Outer")
    assert "MSG: user_msgs/Inner\nint32 LIMIT=3\nfloat64[3] values\n" in schema.text
    inner = types.make("user_msgs/msg/Inner", values=np.arange(3.0))
    data = types.serialize(inner)
    assert types.deserialize(data, "user_msgs/msg/Inner").values.tolist() == [0.0, 1.0, 2.0]


def test_prefixes_of_workspaces_come_before_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'one'}:{tmp_path / 'two'}")
    assert definition_roots()[:2] == (tmp_path / "one" / "share", tmp_path / "two" / "share")
    assert len(definition_roots()) == 3


@pytest.mark.parametrize("name", ["nonsense", "", "a/b", "absent_msgs/msg/Thing", "std_msgs/msg/"])
def test_an_unknown_type_is_named(name: str) -> None:
    with pytest.raises(BagError, match="no definition of the message type"):
        TYPES.schema(name)


def test_an_unreadable_definition_is_named(tmp_path: Path) -> None:
    write_definition(tmp_path, "Broken", "float64 = = what\n")
    with pytest.raises(
        BagError, match=r"the definition of user_msgs/msg/Broken .* is not readable"
    ) as caught:
        MessageTypes([tmp_path]).schema("user_msgs/msg/Broken")
    assert "\n" not in str(caught.value)


def test_wrong_bytes_do_not_decode() -> None:
    with pytest.raises(BagError, match="does not decode as sensor_msgs/msg/JointState"):
        TYPES.deserialize(TYPES.serialize(text("short")), "sensor_msgs/msg/JointState")


def test_types_that_begin_with_a_time_are_told_from_others() -> None:
    stamped = ("sensor_msgs/msg/JointState", "rosgraph_msgs/msg/Clock", f"{OURS}/RunState")
    others = (
        "std_msgs/msg/String",
        "geometry_msgs/msg/Pose",
        f"{OURS}/PublishedCounts",
        "std_msgs/msg/Empty",
    )
    assert {TYPES.stamp_place(name) for name in stamped} == {4}
    assert {TYPES.stamp_place(name) for name in others} == {None}


@pytest.mark.parametrize("little_endian", [True, False])
@pytest.mark.parametrize("time_ns", [0, 1, 999_999_999, 10**9, 60 * 10**9 + 7, (2**31 - 1) * 10**9 + 5])
def test_stamp_is_read_from_the_bytes(time_ns: int, little_endian: bool) -> None:
    clock = TYPES.make(
        "rosgraph_msgs/msg/Clock",
        clock=TYPES.make("builtin_interfaces/msg/Time", sec=time_ns // 10**9, nanosec=time_ns % 10**9),
    )
    for message in (joint_state(time_ns), odometry(time_ns, np.zeros(7), np.zeros(6)), clock):
        data = TYPES._store.serialize_cdr(message, message.__msgtype__, little_endian=little_endian)
        assert stamp_ns(bytes(data)) == time_ns


@pytest.mark.parametrize("data", [b"", b"\0\1\0\0", b"\0\1\0\0" + bytes(7), b"\0\7\0\0" + bytes(8)])
def test_bytes_without_a_stamp_are_refused(data: bytes) -> None:
    with pytest.raises(BagError, match="does not begin with a time stamp"):
        stamp_ns(data)


def test_transforms_decode_to_what_was_given() -> None:
    pose = Pose(np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3, 0.9]))
    data = transforms_cdr(
        TYPES, [("world", "base_link", pose), ("base_link", "camera", pose)], 61 * 10**9 + 5
    )
    first, second = TYPES.deserialize(data, TF_TYPE).transforms
    assert (first.header.frame_id, first.child_frame_id) == ("world", "base_link")
    assert (second.header.frame_id, second.child_frame_id) == ("base_link", "camera")
    assert (second.header.stamp.sec, second.header.stamp.nanosec) == (61, 5)
    assert (first.transform.translation.z, first.transform.rotation.w) == (3.0, 0.9)
    place = TYPES.stamp_place(TF_TYPE)
    assert place is not None and stamp_ns(data, place) == 61 * 10**9 + 5


@pytest.mark.parametrize("count", [1, 2, 17])
def test_transforms_packed_by_their_layout_are_those_serialized(count: int) -> None:
    """Names of any length, so that numbers stand at every distance from the last name."""
    frames = [("world", "x" * (length + 1)) for length in range(count)]
    rows = np.random.default_rng(count).normal(size=(count, 7))
    poses = [(*names, Pose(row[:3], row[3:])) for names, row in zip(frames, rows, strict=True)]
    codec = TransformsCodec(TYPES, frames)
    for time_ns in (0, 61 * 10**9 + 5):
        assert codec.pack(time_ns, rows) == transforms_cdr(TYPES, poses, time_ns)
