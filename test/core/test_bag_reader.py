"""A run read back from its bag is the run that was written, and what is no such bag is refused."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from sms_handover.analysis.joints import joints_of
from sms_handover.bag.info import read_info
from sms_handover.bag.recording import Recording
from sms_handover.bag.run.reader import read_run
from sms_handover.bag.writer import BagWriter
from sms_handover.errors import BagError
from sms_handover.graph import topics
from sms_handover.run_data import RunData

from .bag_damage import chunks_of
from .bag_messages import (
    JOINT_STATE,
    JOINTS,
    TICK_NS,
    TYPES,
    WALL_NS,
    joint_state,
    made_up_run,
    odometry,
    open_topics,
    record_run,
    text,
    write_run,
)


def assert_same_run(run: RunData, expected: RunData) -> None:
    """Compare bit for bit: arrays by their bytes."""
    for item in fields(RunData):
        value, other = getattr(run, item.name), getattr(expected, item.name)
        if item.name in {"target_pose", "tool_pose"}:
            assert list(value) == list(other)
            pairs = [(value[arm], other[arm]) for arm in other]
        elif isinstance(other, np.ndarray):
            pairs = [(value, other)]
        else:
            assert repr(value) == repr(other), item.name  # repr, as NaN differs from itself
            continue
        for array, wanted in pairs:
            assert (array.shape, array.dtype) == (wanted.shape, wanted.dtype), item.name
            assert array.tobytes() == wanted.tobytes(), item.name


@pytest.mark.parametrize("prefix", ["", "/left", "/deep/er"])
def test_run_comes_back_bit_for_bit(tmp_path: Path, prefix: str) -> None:
    run = made_up_run()
    folder = write_run(tmp_path / "bag", run, prefix)
    assert_same_run(read_run(folder), run)
    assert_same_run(read_run(folder / "bag_0.mcap"), run)


def test_arrays_are_read_only(tmp_path: Path) -> None:
    run = read_run(write_run(tmp_path / "bag", made_up_run(21)))
    with pytest.raises(ValueError, match="read-only"):
        run.joint_position[0, 0] = 1.0


def test_what_is_missing_is_nan_or_has_no_row(tmp_path: Path) -> None:
    run = made_up_run(41)
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        open_topics(recording)
        for k, stamp in enumerate(run.tick_ns):
            stamp_ns = int(stamp)
            state = joint_state(stamp_ns, JOINTS, run.joint_position[k], run.joint_velocity[k])
            recording.receive("/joint_states", TYPES.serialize(state), WALL_NS)
            if k != 7:
                message = odometry(stamp_ns, run.base_pose[k], run.base_twist[k])
                recording.receive("/base_odometry", TYPES.serialize(message), WALL_NS)
            if k != 40:
                command = joint_state(stamp_ns, JOINTS, effort=run.joint_command[k])
                recording.receive("/joint_command", TYPES.serialize(command), WALL_NS)
    read = read_run(tmp_path / "bag")
    assert read.tick_ns.tolist() == [k * TICK_NS for k in range(41) if k != 7]
    assert np.isnan(read.joint_effort).all()
    assert np.isnan(read.joint_command[-1]).all()
    assert read.joint_command[:-1].tobytes() == np.delete(run.joint_command, [7, 40], axis=0).tobytes()
    assert read.reference_position.shape == (0, 14)
    assert read.deputy_pose.shape == (0, 7)
    assert (read.phases, read.grasp_events) == ((), ())


def test_joints_are_matched_by_name_even_if_the_order_changes(tmp_path: Path) -> None:
    run = made_up_run(10)
    random = np.random.default_rng(1)
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        open_topics(recording)
        for k, stamp in enumerate(run.tick_ns):
            order = random.permutation(14) if k else np.arange(14)
            names = [JOINTS[place] for place in order]
            state = joint_state(int(stamp), names, run.joint_position[k][order], run.joint_velocity[k][order])
            message = odometry(int(stamp), run.base_pose[k], run.base_twist[k], covariance=float(k))
            recording.receive("/joint_states", TYPES.serialize(state), WALL_NS)
            recording.receive("/base_odometry", TYPES.serialize(message), WALL_NS)
    read = read_run(tmp_path / "bag")
    assert read.joint_position.tobytes() == run.joint_position.tobytes()
    assert read.joint_velocity.tobytes() == run.joint_velocity.tobytes()
    assert read.base_twist.tobytes() == run.base_twist.tobytes()


def test_no_arm_is_taken_for_another_whose_name_begins_alike(tmp_path: Path) -> None:
    """Arms come in the order of their joints; neither the name before nor what it begins with decides."""
    run = made_up_run(3)
    names = {"arm_a": "arm_joint", "arm_b": "arm"}
    joints = tuple(f"{names[name[:5]]}{name[5:]}" for name in run.joint_names)
    values = {
        name: {names[arm]: rows for arm, rows in getattr(run, name).items()}
        for name in ("target_pose", "tool_pose")
    }
    arms = tuple(names.values())
    folder = tmp_path / "bag"
    with Recording(folder, types=TYPES) as recording:
        open_topics(recording, arms=arms)
        recording.begin()
        record_run(recording, RunData(**{**vars(run), **values, "joint_names": joints, "arms": arms}))
    again = read_run(folder)
    assert again.arms == arms == ("arm_joint", "arm")
    assert joints_of(again.joint_names, "arm") == list(range(7, 14))
    assert joints_of(again.joint_names, "arm_joint") == list(range(7))


def test_repeated_and_late_messages_change_nothing(tmp_path: Path) -> None:
    run = made_up_run(5)
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        open_topics(recording)
        for k in (0, 0, 2, 1, 1, 3, 4, 4):
            stamp_ns = int(run.tick_ns[k])
            state = joint_state(stamp_ns, JOINTS, run.joint_position[k], run.joint_velocity[k])
            message = odometry(stamp_ns, run.base_pose[k], run.base_twist[k])
            recording.receive("/joint_states", TYPES.serialize(state), WALL_NS)
            recording.receive("/base_odometry", TYPES.serialize(message), WALL_NS)
    read = read_run(tmp_path / "bag")
    assert read.tick_ns.tolist() == run.tick_ns.tolist()
    assert read.joint_position.tobytes() == run.joint_position.tobytes()


def test_after_a_reset_only_the_last_run_counts(tmp_path: Path) -> None:
    first, last = made_up_run(101, seed=1), made_up_run(61, seed=2)
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        open_topics(recording)
        record_run(recording, first)
        record_run(recording, last)
    assert_same_run(read_run(tmp_path / "bag"), last)


def test_big_endian_messages_are_read(tmp_path: Path) -> None:
    run = made_up_run(3)
    store = TYPES._store
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        open_topics(recording)
        for k, stamp in enumerate(run.tick_ns):
            state = joint_state(int(stamp), JOINTS, run.joint_position[k], run.joint_velocity[k])
            message = odometry(int(stamp), run.base_pose[k], run.base_twist[k])
            for name, value in (("/joint_states", state), ("/base_odometry", message)):
                data = bytes(store.serialize_cdr(value, value.__msgtype__, little_endian=False))
                recording.receive(name, data, WALL_NS)
    read = read_run(tmp_path / "bag")
    assert read.tick_ns.tolist() == run.tick_ns.tolist()
    assert read.joint_position.tobytes() == run.joint_position.tobytes()
    assert read.base_pose.tobytes() == run.base_pose.tobytes()


def test_an_empty_recording_of_ours_is_a_run_without_rows(tmp_path: Path) -> None:
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        open_topics(recording)
    read = read_run(tmp_path / "bag")
    assert (read.joint_names, read.tick_ns.shape, read.base_pose.shape) == ((), (0,), (0, 7))


def test_several_runs_in_one_bag_need_a_namespace(tmp_path: Path) -> None:
    runs = {"/left": made_up_run(21, seed=1), "/right": made_up_run(21, seed=2)}
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        for prefix in runs:
            for topic in topics.graph_topics(()):
                if not topic.name.startswith("/"):
                    recording.add_topic(f"{prefix}/{topic.name}", topic.type)
        for prefix, run in runs.items():
            for k, stamp in enumerate(run.tick_ns):
                state = joint_state(int(stamp), JOINTS, run.joint_position[k], run.joint_velocity[k])
                message = odometry(int(stamp), run.base_pose[k], run.base_twist[k])
                recording.receive(f"{prefix}/joint_states", TYPES.serialize(state), WALL_NS)
                recording.receive(f"{prefix}/base_odometry", TYPES.serialize(message), WALL_NS)
    with pytest.raises(BagError, match="several runs, name the namespace of one: /left, /right"):
        read_run(tmp_path / "bag")
    read = read_run(tmp_path / "bag", namespace="/right")
    assert read.base_pose.tobytes() == runs["/right"].base_pose.tobytes()
    with pytest.raises(BagError, match="it has no topic /up/joint_states"):
        read_run(tmp_path / "bag", namespace="/up")


def test_arms_are_in_the_order_of_their_joints_even_if_a_name_begins_another(tmp_path: Path) -> None:
    """``arm_b_joint_1`` is a joint of ``arm_b``, not of ``arm``; a run in a namespace adds no arms."""
    pose = "geometry_msgs/msg/PoseStamped"
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        recording.add_topic("/joint_states", JOINT_STATE)
        recording.add_topic("/base_odometry", "nav_msgs/msg/Odometry")
        for name in ("/arm/tool_pose", "/arm_b/tool_pose", "/other/arm_c/tool_pose"):
            recording.add_topic(name, pose)
        names = ["arm_b_joint_1", "arm_joint_1"]
        recording.receive("/joint_states", TYPES.serialize(joint_state(0, names, [1.0, 2.0])), WALL_NS)
    assert read_run(tmp_path / "bag").arms == ("arm_b", "arm")


def test_missing_and_unusable_bags_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="there is no bag at"):
        read_run(tmp_path / "absent")
    with pytest.raises(BagError, match=r"is not a bag: no \.mcap file in it"):
        read_run(tmp_path)
    (tmp_path / "old.db3").touch()
    with pytest.raises(BagError, match=r"is not a bag: it holds old\.db3"):
        read_run(tmp_path)
    empty = tmp_path / "empty.mcap"
    empty.touch()
    with pytest.raises(BagError, match=r"empty\.mcap is empty"):
        read_run(empty)
    wrong = tmp_path / "notes.mcap"
    wrong.write_text("these are notes and not a recording")
    with pytest.raises(BagError, match="is not an MCAP file"):
        read_run(wrong)
    with pytest.raises(BagError, match=r"holds several bags, choose one: empty\.mcap, notes\.mcap"):
        read_run(tmp_path)


def test_a_truncated_bag_is_named_as_such_with_its_size(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "bag", made_up_run())
    file = folder / "bag_0.mcap"
    content = file.read_bytes()
    for size in (8, 9, 1000, len(content) - 1):
        file.write_bytes(content[:size])
        with pytest.raises(BagError, match=f"was not closed: it has {size} bytes and no end"):
            read_run(folder)


@pytest.mark.parametrize("number", [2, 10, -1])
def test_a_damaged_bag_is_refused_in_one_line(tmp_path: Path, number: int) -> None:
    folder = write_run(tmp_path / "bag", made_up_run(501))
    file = folder / "bag_0.mcap"
    chunk = chunks_of(file)[number]
    content = bytearray(file.read_bytes())
    content[chunk.end - 500 : chunk.end - 436] = bytes(64)
    file.write_bytes(content)
    with pytest.raises(BagError, match=r"bag_0\.mcap is damaged: ") as caught:
        read_run(folder)
    assert "\n" not in str(caught.value)


def test_a_foreign_bag_is_refused_and_its_topics_are_named(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", types=TYPES) as writer:
        for number in range(10):
            writer.add_topic(f"/chatter_{number}", "std_msgs/msg/String")
        writer.write("/chatter_0", TYPES.serialize(text("hello")), 0, 0)
    with pytest.raises(
        BagError, match=r"needs the topics joint_states and base_odometry, and has /chat.* 2 more"
    ):
        read_run(tmp_path / "bag")
    assert read_info(tmp_path / "bag").message_count == 1


def test_a_topic_of_another_type_is_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", types=TYPES) as writer:
        writer.add_topic("/joint_states", "sensor_msgs/msg/JointState")
        writer.add_topic("/base_odometry", "std_msgs/msg/String")
    with pytest.raises(BagError, match=r"/base_odometry has the type std_msgs/msg/String \(cdr\), expected"):
        read_run(tmp_path / "bag")
