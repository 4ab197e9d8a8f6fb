"""A run tick by tick: what belongs to one stamp comes together, whatever the order in the file."""

from pathlib import Path

import pytest

from sms_handover.bag.qos import Qos
from sms_handover.bag.run.ticks import RecordedTick, recorded_ticks
from sms_handover.bag.writer import BagWriter
from sms_handover.errors import BagError

NAMES = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/base_odometry": "nav_msgs/msg/Odometry",
    "/joint_command": "sensor_msgs/msg/JointState",
    "/task/phase": "sms_handover_interfaces/msg/TaskPhase",
}


def write(folder: Path, messages: list[tuple[str, int]], without: str = "") -> Path:
    """Write messages, each with its topic and time as content."""
    with BagWriter(folder) as writer:
        for name, kind in NAMES.items():
            if name != without:
                writer.add_topic(name, kind, (Qos(),))
        for name, time_ns in messages:
            writer.write(name, f"{name} {time_ns}".encode(), time_ns, 0)
    return folder


def test_what_belongs_together_comes_together(tmp_path: Path) -> None:
    times = {name: [3, 1, 2] for name in NAMES}
    times["/task/phase"] = [1]
    bag = write(tmp_path / "bag", [(name, time) for name in NAMES for time in times[name]])

    def tick(time: int) -> RecordedTick:
        found = [f"{name} {time}".encode() if time in times[name] else None for name in NAMES]
        return RecordedTick(time, *found)

    assert list(recorded_ticks(bag)) == [tick(1), tick(2), tick(3)]


def test_what_was_not_recorded_is_none(tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", [("/joint_states", 1), ("/joint_command", 2)])
    assert list(recorded_ticks(bag)) == [
        RecordedTick(1, b"/joint_states 1", None, None, None),
        RecordedTick(2, None, None, b"/joint_command 2", None),
    ]


def test_a_reset_is_refused(tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", [("/joint_states", 1), ("/joint_states", 2), ("/joint_states", 1)])
    with pytest.raises(BagError, match="two messages on /joint_states at 1 ns: the simulation was reset"):
        list(recorded_ticks(bag))


@pytest.mark.parametrize("name", NAMES)
def test_a_bag_that_holds_no_run_is_refused_at_once(tmp_path: Path, name: str) -> None:
    with pytest.raises(BagError, match=f"has no topic {name}"):
        recorded_ticks(write(tmp_path / "bag", [], without=name))
