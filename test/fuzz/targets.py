"""What is fuzzed: each reader of something that others have made, as a function of bytes.

A target may raise SmsHandoverError and nothing else. Its seeds, and what once broke it, lie in
``test/data/corpus/<name>``.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from shutil import copy, rmtree

import numpy as np
from mcap.writer import CompressionType, Writer

from sms_handover.bag.files import read_messages
from sms_handover.bag.info import read_info
from sms_handover.bag.metadata import METADATA_FILE, counts_of, metadata_of
from sms_handover.bag.repair.check import check
from sms_handover.bag.repair.recover import recover
from sms_handover.bag.run.reader import read_run
from sms_handover.bag.time_order import messages_by_time
from sms_handover.configuration.package_files import config_file
from sms_handover.errors import SmsHandoverError
from sms_handover.frames import BASE, WORLD
from sms_handover.messages.message_types import MessageTypes
from sms_handover.model.robot_model import RobotModel
from sms_handover.ros.codecs.loop_messages import JointStateCodec, OdometryCodec, PoseCodec, arrival_ns
from sms_handover.ros.codecs.task_phase import PhaseCodec
from sms_handover.scene.live import LiveScene
from sms_handover.simulation.scenario import load_parameters
from sms_handover.trajectory.load import load_schedule

CORPUS = Path(__file__).resolve().parents[1] / "data" / "corpus"

_REFERENCE_NS = 20_000_000  # ns
_BASE_OF_TYPES = (
    "sensor_msgs/msg/JointState",
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseStamped",
    "sms_handover_interfaces/msg/TaskPhase",
    "sms_handover_interfaces/msg/GraspEvent",
    "diagnostic_msgs/msg/DiagnosticArray",
)


@dataclass(frozen=True)
class Target:
    """One reader: what it is in words, what runs it on bytes in a folder."""

    name: str
    reads: str
    run: Callable[[bytes, Path], None]

    @property
    def corpus(self) -> list[bytes]:
        """Return the inputs that are kept, in the order of their names."""
        return [path.read_bytes() for path in sorted((CORPUS / self.name).iterdir())]


@cache
def _robot() -> RobotModel:
    return RobotModel.load()


def _written(folder: Path, name: str, data: bytes) -> Path:
    """Write bytes into a file and return its path."""
    path = folder / name
    path.write_bytes(data)
    return path


def _schedule(data: bytes, folder: Path) -> None:
    load_schedule(_written(folder, "schedule.yaml", data), _robot(), _REFERENCE_NS)


def _parameters(data: bytes, folder: Path) -> None:
    load_parameters(files=[_written(folder, "parameters.yaml", data)])


def _robot_files(data: bytes, folder: Path) -> None:
    """Read an arm under the robot that is shipped, a robot with the arm that is shipped, and a URDF."""
    robot, arm = folder / "robot.yaml", folder / "gen3.yaml"
    if data.lstrip().startswith(b"<"):
        LiveScene(data.decode("utf-8", "replace"), np.array([0.1, 0.1, 0.3]))
        return
    is_arm = b"\njoints:" in b"\n" + data
    for file in (robot, arm):
        copy(config_file(file.name), file)
    (arm if is_arm else robot).write_bytes(data)
    RobotModel.load(robot)


@cache
def _wires() -> tuple[Callable[[bytes], object], ...]:
    names, arms = _robot().joint_names, _robot().arms
    state, odometry = JointStateCodec(names, ("position", "velocity", "effort")), OdometryCodec(WORLD, BASE)
    command, pose, phase = JointStateCodec(names, ("effort",)), PoseCodec(WORLD), PhaseCodec(arms, ("end_a",))
    checked = (state.checked, odometry.checked, command.checked, pose.checked, phase.checked, arrival_ns)
    types = MessageTypes()
    decoders = tuple(_decoder(types, name) for name in _BASE_OF_TYPES)
    return (*checked, state.read, odometry.read, pose.read_pose, phase.read, *decoders)


def _decoder(types: MessageTypes, name: str) -> Callable[[bytes], object]:
    return lambda data: types.deserialize(data, name)


def _messages(data: bytes, folder: Path) -> None:
    """Hand the bytes of a message to everything that takes some."""
    for wire in _wires():
        _refusing(lambda wire=wire: wire(data))  # type: ignore[misc]


def _bag(data: bytes, folder: Path) -> None:
    """Check, describe, read and recover a file of a bag."""
    path = _written(folder, "bag.mcap", data)
    rmtree(folder / "recovered", ignore_errors=True)
    _refusing(lambda: check(path))
    _refusing(lambda: read_info(path))
    _refusing(lambda: [None for _ in read_messages(path)])
    _refusing(lambda: [None for _ in messages_by_time(path)])
    _refusing(lambda: read_run(path))
    _refusing(lambda: recover(path, folder / "recovered"))


def _metadata(data: bytes, folder: Path) -> None:
    """Check, describe and read a bag of which metadata.yaml is not what it should be."""
    bag = folder / "bag"
    if not bag.exists():
        bag.mkdir()
        _write_bag(bag / "bag_0.mcap")
    _written(bag, METADATA_FILE, data)
    rmtree(folder / "recovered", ignore_errors=True)
    _refusing(lambda: counts_of(metadata_of(bag) or {}))
    _refusing(lambda: check(bag))
    _refusing(lambda: read_info(bag))
    _refusing(lambda: [None for _ in read_messages(bag)])
    _refusing(lambda: recover(bag, folder / "recovered"))


def _write_bag(path: Path) -> None:
    """Write a bag of one file with two messages."""
    types = MessageTypes()
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE)
        writer.start(profile="ros2")
        schema = writer.register_schema(
            "std_msgs/msg/String", "ros2msg", types.schema("std_msgs/msg/String").text.encode()
        )
        channel = writer.register_channel("/text", "cdr", schema)
        for number in range(2):
            data = types.serialize(types.make("std_msgs/msg/String", data=f"{number}"))
            writer.add_message(channel, number, data, number)
        writer.finish()


def _refusing(act: Callable[[], object]) -> None:
    """Do something that may be refused; another reader of the same bytes has its turn then."""
    with suppress(SmsHandoverError):
        act()


TARGETS = {
    target.name: target
    for target in (
        Target("schedule", "task schedules", _schedule),
        Target("parameters", "parameter files", _parameters),
        Target("robot", "description files of robot and arm, URDF from a bag or a topic", _robot_files),
        Target("messages", "CDR bytes of messages, by the wires and by the decoder of bags", _messages),
        Target("bag", "MCAP files: check, info, read, recover", _bag),
        Target("metadata", "metadata.yaml of a bag", _metadata),
    )
}
