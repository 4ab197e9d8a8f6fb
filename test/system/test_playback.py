"""Bags played by one process and recorded by another: the same messages, byte for byte, none lost."""

import os
import signal
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from sms_handover.bag.qos import Durability, History, Qos, Reliability
from sms_handover.bag.time_order import messages_by_time
from sms_handover.bag.writer import BagWriter
from sms_handover.cli.exit_codes import EXIT_LOSS
from sms_handover.launcher.domain import reserved_domain
from sms_handover.messages.message_types import MessageTypes
from sms_handover.messages.stamps import stamp_ns

from ..core.terminal import Terminal
from .conftest import TICKS, Command
from .runs import running, sms_handover

pytestmark = [pytest.mark.system, pytest.mark.slow]

Recorded = dict[str, tuple[Path, object]]
ROUND_UP = 4  # [byte] to a multiple of which the wire fills up a message with zeros
S = 1_000_000_000  # ns
TEXT = "std_msgs/msg/String"


@pytest.fixture(autouse=True)
def domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A ROS domain of this test alone."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with reserved_domain(None) as number:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
        yield number


def by_topic(bag: Path) -> dict[str, list[bytes]]:
    """Return the bytes of the messages of a bag, filled up as the wire does."""
    found: dict[str, list[bytes]] = {}
    for message in messages_by_time(bag):
        filled = message.data + b"\0" * (-len(message.data) % ROUND_UP)
        found.setdefault(message.topic, []).append(filled)
    return found


def record_while_playing(
    bag: Path, cwd: Path, *options: object, code: int = 0
) -> tuple[dict[str, list[bytes]], str]:
    """Play a bag into a fresh recorder; return what was recorded, and what the player printed."""
    with running("bag", "record", "--all", "-o", "again", cwd=cwd) as recorder:
        recorder.until((cwd / "again").is_dir, "the recorder")
        done = sms_handover("bag", "play", bag, "--wait", "60", *options, cwd=cwd)
        assert done.code == code, done
        recorder.send(signal.SIGINT)
        assert recorder.end() == 0, recorder.text
    return by_topic(cwd / "again"), done.out + done.err


def test_a_run_is_played_fast_without_a_loss(recorded: Recorded, tmp_path: Path) -> None:
    bag = recorded["nmpc"][0] / "bag"
    original = by_topic(bag)
    again, _ = record_while_playing(recorded["nmpc"][0], tmp_path, "--rate", 5)
    assert {"/tf", "/tf_static"} < set(original)
    assert sum(map(len, original.values())) > 3 * TICKS
    for topic, messages in original.items():
        assert again[topic] == messages, topic
    assert set(again) - set(original) <= {"/parameter_events", "/rosout"}


def foreign_bag(folder: Path) -> Mapping[str, list[bytes]]:
    """Write a bag as a robot of somebody else might have: wall time, sensors, a type that is not here."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg("float64[] levels\n", "tank_msgs/msg/Tanks"))
    make = store.types
    begin = 1_700_000_000 * S
    written: dict[str, list[bytes]] = {"/imu": [], "/note": [], "/tanks": []}
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        kinds = {"/imu": "sensor_msgs/msg/Imu", "/note": TEXT, "/tanks": "tank_msgs/msg/Tanks"}
        topics = {name: writer.add_connection(name, kind, typestore=store) for name, kind in kinds.items()}
        for number in range(400):
            stamp = begin + number * 2_500_000
            header = make["std_msgs/msg/Header"](
                make["builtin_interfaces/msg/Time"](stamp // S, stamp % S), "imu_link"
            )
            vector = make["geometry_msgs/msg/Vector3"](float(number), 0.5, -0.5)
            turn = make["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
            nine = np.arange(9.0)
            messages = {
                "/imu": make["sensor_msgs/msg/Imu"](header, turn, nine, vector, nine, vector, nine),
                "/note": make[TEXT]("x" * (number % 9)),
                "/tanks": make["tank_msgs/msg/Tanks"](np.arange(3.0)),
            }
            for name, message in messages.items():
                data = bytes(store.serialize_cdr(message, kinds[name]))
                writer.write(topics[name], stamp, data)
                written[name].append(data + b"\0" * (-len(data) % ROUND_UP))
    return written


def test_a_bag_of_another_robot_is_played(tmp_path: Path) -> None:
    written = foreign_bag(tmp_path / "robot")
    again, told = record_while_playing(tmp_path / "robot", tmp_path, "-m", "note:=/remark", code=EXIT_LOSS)
    assert "not played: /tanks: message type tank_msgs/msg/Tanks is not installed" in told
    assert again["/imu"] == written["/imu"]
    assert again["/remark"] == written["/note"]
    assert "/tanks" not in again and "/note" not in again


def test_if_nothing_can_be_played_the_exit_code_says_so(tmp_path: Path) -> None:
    foreign_bag(tmp_path / "robot")
    done = sms_handover("bag", "play", "robot", "--topics", "/tanks", cwd=tmp_path)
    assert done.code == 2
    assert done.errors == [f"player: error: no topic of {Path('robot')} can be played"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["nowhere"], "there is no bag at nowhere"),
        (["robot", "--rate", "0"], "must be > 0"),
        (["robot", "-m", "imu"], "'imu' is not of the form OLD:=NEW"),
        (["robot", "-e", "("], "regular expression '(' is not readable"),
        (["robot", "--domain-id", "500"], "domain id is 500, must be 0 to 101"),
        (["robot", "--storage", "sqlite3"], "invalid choice: 'sqlite3'"),
    ],
)
def test_wrong_input_is_one_line(tmp_path: Path, arguments: list[str], told: str, called: Command) -> None:
    foreign_bag(tmp_path / "robot")
    done = called("bag", "play", *arguments, cwd=tmp_path)
    assert (done.code, len(done.errors)) == (2, 1), done
    assert told in done.errors[0]
    assert "Traceback" not in done.err


def test_record_asks_what_to_record(tmp_path: Path, called: Command) -> None:
    for arguments in ([], ["--all", "--topics", "/a"]):
        done = called("bag", "record", *arguments, cwd=tmp_path)
        assert (done.code, len(done.errors)) == (2, 1), done


def test_record_ends_by_itself_and_takes_what_was_asked_for(tmp_path: Path) -> None:
    foreign_bag(tmp_path / "robot")
    with running("bag", "play", "robot", "--loop", cwd=tmp_path) as player:
        player.until(lambda: "rate 1.00" in player.text, "the player")
        words = ("--topics", "imu", "-o", "again", "--duration", "8", "--max-bag-duration", "3")
        done = sms_handover("bag", "record", *words, cwd=tmp_path)
        assert done.code == 0, done
        assert player.process.poll() is None
    assert list(by_topic(tmp_path / "again")) == ["/imu"]
    assert len([*(tmp_path / "again").glob("*.mcap")]) in (2, 3), "a new file every 3 s"
    nothing = ("--regex", "^/nothing", "-o", "none", "--duration", "1")
    done = sms_handover("bag", "record", *nothing, cwd=tmp_path)
    assert done.code == 1


def test_an_interrupt_ends_the_player_at_once(tmp_path: Path) -> None:
    foreign_bag(tmp_path / "robot")
    with running("bag", "play", "robot", "--start-paused", cwd=tmp_path) as player:
        player.until(lambda: "paused" in player.text, "the player")
        player.send(signal.SIGINT)
        assert player.end() == 130


def test_keys_control_the_player_and_the_terminal_is_put_back(tmp_path: Path) -> None:
    foreign_bag(tmp_path / "robot")
    arguments = ["bag", "play", str(tmp_path / "robot"), "--start-paused", "--topics", "/imu"]
    program = f"import sys\nfrom sms_handover.cli.main import main\nsys.exit(main({arguments!r}))"
    with Terminal(program, TERM="xterm") as terminal:
        terminal.until_text("space: pause, resume")
        terminal.until_text("paused  0 messages")
        assert not terminal.echoes
        terminal.press(b"\x1b[C")
        terminal.until_text("paused  1 messages")
        terminal.press(b"\x1b[C\x1b[C")
        terminal.until_text("paused  3 messages")
        terminal.press(b"\x1b[A")
        terminal.until_text("rate 1.10")
        terminal.press(b"\x1b[B\x1b[B")
        terminal.until_text("rate 0.91")
        terminal.press(b" ")
        assert terminal.end() == 0
        assert "400 messages sent" in terminal.text
        assert terminal.settings == terminal.found


# Recorded commands into a live plant


def test_the_plant_does_again_what_it_did(recorded: Recorded, tmp_path: Path) -> None:
    """Under either law, one run after the other."""
    runs = [recorded[law][0] for law in ("nmpc", "pid")]
    done = sms_handover("verify", *runs, "--with", "plant", cwd=tmp_path)
    assert done.code == 0, done
    told = [line for line in done.out.splitlines() if "wall time" not in line]
    assert told == [
        part for run in runs for part in (f"{run}:", f"the same bit for bit as recorded: {TICKS} states")
    ]


def with_other_commands(bag: Path, folder: Path, changes: Mapping[int, Callable[[float], float]]) -> None:
    """Copy a run with one effort changed in the commands of some ticks."""
    types = MessageTypes()
    by_stamp = {tick * 1_000_000: change for tick, change in changes.items()}
    with BagWriter(folder) as writer, (bag / "bag_0.mcap").open("rb") as stream:
        reader = make_reader(stream)
        for attachment in reader.iter_attachments():
            writer.attach(attachment.name, attachment.media_type, attachment.data)
        latched = Qos(Reliability.RELIABLE, Durability.VOLATILE, History.KEEP_ALL)
        known = set()
        for message in messages_by_time(bag):
            if message.topic not in known:
                known.add(message.topic)
                writer.add_topic(message.topic, message.type, (latched,))
            data = message.data
            if message.topic == "/joint_command" and stamp_ns(data) in by_stamp:
                command = types.deserialize(data, message.type)
                effort = np.array(command.effort)
                effort[3] = by_stamp[stamp_ns(data)](effort[3])
                command.effort = effort
                data = types.serialize(command)
            writer.write(message.topic, data, message.log_time_ns, message.publish_time_ns)


def test_other_commands_are_found_to_a_bit_and_seen_in_joints_and_base(
    recorded: Recorded, tmp_path: Path
) -> None:
    """The effort of tick 700 acts up to tick 701, there by its last bit.

    Later it is 1e-6 N m more for a tick: impulse over inertia times the time left is far below 1e-3 rad.
    """
    changes = {700: lambda effort: float(np.nextafter(effort, np.inf)), 710: lambda effort: effort + 1e-6}
    with_other_commands(recorded["pid"][0] / "bag", tmp_path / "other", changes)
    done = sms_handover("verify", "--with", "plant", "other", cwd=tmp_path)
    assert done.code == 1, done
    assert "first different bit at 0.701 s" in done.out
    lines = [line.split() for line in done.out.splitlines() if line.startswith("  ")]
    figures = {words[0] + words[1]: float(words[2]) for words in lines}
    assert 1e-10 < figures["jointposition"] < 1e-3
    assert 0.0 < figures["baseposition"] < 1e-3
    assert 0.0 < figures["baseorientation"] < 1e-3


def test_a_dead_plant_is_told(recorded: Recorded, tmp_path: Path) -> None:
    with running("verify", "--with", "plant", recorded["nmpc"][0], cwd=tmp_path) as run:
        run.until_all_nodes(("plant",))
        os.kill(run.nodes["plant"], signal.SIGKILL)
        assert run.end() == 1
        assert "error: the plant was killed by signal 9 (SIGKILL)" in run.text
