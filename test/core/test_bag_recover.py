"""What is recovered is a whole bag for every reader, and what is lost is told."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from sms_handover.bag.info import read_info
from sms_handover.bag.ledger import Ledger
from sms_handover.bag.recording import Recording
from sms_handover.bag.repair.check import check
from sms_handover.bag.repair.recover import recover
from sms_handover.bag.repair.recovery import Recovery
from sms_handover.bag.run.reader import read_run
from sms_handover.errors import BagError
from sms_handover.run_data import RunData

from .bag_damage import chunks_of, scanned, write_file
from .bag_messages import TICK_NS, TYPES, made_up_run, open_topics, published_counts, record_run
from .test_bag_reader import assert_same_run

STATES = "/joint_states"


def write_bag(folder: Path, run: RunData) -> Path:
    """Write a bag of a run as the recorder does; return its file."""
    with Recording(folder, types=TYPES) as recording:
        open_topics(recording)
        recording.begin()
        recording.describe(urdf="<robot/>", provenance={"seed": "7"})
        record_run(recording, run)
        report = published_counts("plant", {STATES: len(run.tick_ns)})
        recording.receive("/run/published", TYPES.serialize(report), 0)
    return folder / f"{folder.name}_0.mcap"


def ledger_of(path: Path) -> Ledger:
    ledger = read_info(path).ledger
    assert ledger is not None
    return ledger


def test_a_whole_bag_comes_back_bit_for_bit(tmp_path: Path) -> None:
    run = made_up_run()
    file = write_bag(tmp_path / "bag", run)
    before = file.read_bytes()
    result = recover(tmp_path / "bag", tmp_path / "new")
    assert result.clean and result.closed and result.lost_bytes == 0
    assert_same_run(read_run(tmp_path / "new"), run)
    assert scanned(tmp_path / "new" / "new_0.mcap") == scanned(file)
    old, new = read_info(tmp_path / "bag"), read_info(tmp_path / "new")
    assert new.attachments == old.attachments
    assert new.ledger == old.ledger == result.ledger
    assert new.topics == old.topics
    assert set(new.records) == {*old.records, "sms_handover.recovery"}
    assert new.provenance == {"seed": "7"}
    assert file.read_bytes() == before
    with (tmp_path / "new" / "new_0.mcap").open("rb") as stream:
        names = [record.name for record in make_reader(stream).iter_metadata()]
    assert names.count("sms_handover.ledger") == names.count("sms_handover.recovery") == 1
    assert check(tmp_path / "new").complete == check(tmp_path / "bag").complete


def test_a_recorder_that_was_killed_leaves_what_it_had_flushed(tmp_path: Path) -> None:
    """Nothing is closed: no index, no metadata.yaml, no ledger."""
    program = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from core.bag_messages import *
recording = Recording(Path(sys.argv[1]), types=TYPES)
open_topics(recording)
recording.begin()
record_run(recording, made_up_run(501))
os.kill(os.getpid(), signal.SIGKILL)
"""
    command = [sys.executable, "-c", program, str(tmp_path / "bag"), str(Path(__file__).parents[1])]
    done = subprocess.run(command, check=False)
    assert done.returncode == -9
    with pytest.raises(BagError, match=r"was not closed.*sms-handover bag recover"):
        read_run(tmp_path / "bag")
    result = recover(tmp_path / "bag", tmp_path / "new")
    assert not result.closed
    run, whole = read_run(tmp_path / "new"), made_up_run(501)
    ticks = len(run.tick_ns)
    assert ticks > 501 - 20 - 1
    assert run.joint_position.tobytes() == whole.joint_position[:ticks].tobytes()
    states = next(topic for topic in ledger_of(tmp_path / "new").topics if topic.name == STATES)
    assert (states.period_ns, states.missing) == (TICK_NS, 0)
    assert states.received in (ticks, ticks + 1)  # the last state may lack its odometry
    assert not check(tmp_path / "new").complete  # the run was not finished


def test_a_lost_chunk_shows_in_counts_ledger_and_time(tmp_path: Path) -> None:
    run = made_up_run(401)
    file = write_bag(tmp_path / "bag", run)
    chunk = chunks_of(file)[7]
    content = bytearray(file.read_bytes())
    content[chunk.end - 100] ^= 1
    file.write_bytes(content)
    result = recover(tmp_path / "bag", tmp_path / "new")
    (damage,) = result.losses
    assert not result.clean
    assert result.lost_bytes == damage.size == chunk.end - chunk.begin
    lost = {topic.name: topic.lost for topic in result.topics if topic.lost}
    assert sum(lost.values()) == len(chunk.messages)
    states = sum(message.topic == STATES for message in chunk.messages)
    assert lost[STATES] == states
    account = next(topic for topic in ledger_of(tmp_path / "new").topics if topic.name == STATES)
    assert (account.received, account.missing, account.published, account.lost) == (
        401 - states,
        states,
        401,
        states,
    )
    times = [message.log_time_ns for message in chunk.messages]
    assert max(times) - min(times) <= result.largest_loss_ns <= max(times) - min(times) + 2 * TICK_NS
    record = read_info(tmp_path / "new").records["sms_handover.recovery"]
    assert str(chunk.begin) in record["damage"]


def test_loss_at_the_end_is_known_where_the_end_of_the_file_tells(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    content = bytearray(write_file(file))
    *_, before, last = chunks_of(file)
    content[last.begin + 60 : last.end] = bytes(last.end - last.begin - 60)
    file.write_bytes(content)
    result = recover(file, tmp_path / "new")
    newest = max(message.log_time_ns for message in before.messages)
    assert result.largest_loss_ns == max(m.log_time_ns for m in last.messages) - newest
    file.write_bytes(content[: last.end - 1])  # its end is gone too
    assert result.ends_known
    cut = recover(file, tmp_path / "cut")
    assert not cut.ends_known  # nobody knows how far it went


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunked", [True, False])
def test_bags_of_others_come_back_too(tmp_path: Path, compression: CompressionType, chunked: bool) -> None:
    file = tmp_path / "a.mcap"
    content = write_file(file, compression, chunked=chunked, crcs=False)
    whole = scanned(file)
    file.write_bytes(content[: len(content) * 2 // 3])
    result = recover(file, tmp_path / "new")
    new = tmp_path / "new" / "new_0.mcap"
    assert scanned(new) == whole[: result.message_count]
    assert 10 < result.message_count < 120
    info = read_info(tmp_path / "new")
    assert info.attachments == {"notes.txt": b"attached" * 20}
    assert info.records["notes"] == {"by": "other"}
    assert info.ledger is None
    assert set(info.topics) == {"/text", "/joints", "/none"}
    assert not check(tmp_path / "new").complete  # it says itself that something is lost
    with Reader(tmp_path / "new") as reader:
        assert reader.message_count == result.message_count
    with new.open("rb") as stream:
        assert sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages()) == result.message_count


@pytest.mark.parametrize("mode", [CompressionMode.NONE, CompressionMode.STORAGE])
def test_a_cut_bag_of_rosbags(tmp_path: Path, mode: CompressionMode) -> None:
    """It has no checksums, and says its quality of service in numbers or words."""
    store = get_typestore(Stores.ROS2_JAZZY)
    writer = RosbagsWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/odd/Topic_1", "std_msgs/msg/UInt8MultiArray", typestore=store)
        for number in range(3000):
            writer.write(connection, 10**18 + number, os.urandom(1000))
    file = tmp_path / "bag" / "bag.mcap"
    whole = scanned(file)
    file.write_bytes(file.read_bytes()[:2_000_000])
    result = recover(tmp_path / "bag", tmp_path / "new")
    assert scanned(tmp_path / "new" / "new_0.mcap") == whole[: result.message_count]
    assert result.message_count > 1000
    (topic,) = result.topics
    assert topic.recorded == 3000  # by metadata.yaml
    with Reader(tmp_path / "new") as reader:
        assert reader.message_count == result.message_count


def test_a_split_bag_becomes_one_file_even_if_one_of_it_is_broken(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    for number in range(3):
        write_file(bag / f"bag_{number}.mcap")
    whole = scanned(bag / "bag_0.mcap")
    content = (bag / "bag_1.mcap").read_bytes()
    (bag / "bag_1.mcap").write_bytes(content[: len(content) // 2])
    half = scanned(bag / "bag_1.mcap")
    progress: list[tuple[int, int]] = []
    result = recover(bag, tmp_path / "new", lambda done, size: progress.append((done, size)))
    assert scanned(tmp_path / "new" / "new_0.mcap") == [*whole, *half, *whole]
    assert len(read_info(tmp_path / "new").attachments) == 1
    assert [topic.name for topic in result.topics] == ["/text", "/joints", "/none"]
    assert progress == sorted(progress)
    assert progress[-1][1] == result.size
    assert progress[-1][0] == result.size - len(b"\x89MCAP0\r\n")


@pytest.mark.parametrize("content", [b"", b"notes\n" * 500, b"\x89MCAP0\r\n", bytes(3000)])
def test_what_holds_nothing_is_refused_and_leaves_nothing(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(BagError, match=r"nothing can be recovered from .*a\.mcap"):
        recover(tmp_path / "a.mcap", tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    write_file(tmp_path / "a.mcap")
    (tmp_path / "new").mkdir()
    with pytest.raises(BagError, match="exists already"):
        recover(tmp_path / "a.mcap", tmp_path / "new")
    assert list((tmp_path / "new").iterdir()) == []


FULL_DISK = """
import resource, sys
from pathlib import Path
from sms_handover.bag.repair.recover import recover
from sms_handover.errors import BagError
resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))
try:
    recover(Path(sys.argv[1]), Path(sys.argv[2]))
except BagError as error:
    print(error)
"""


def test_a_full_disk_leaves_nothing_half_done(tmp_path: Path) -> None:
    write_file(tmp_path / "a.mcap", CompressionType.NONE)
    command = [sys.executable, "-c", FULL_DISK, str(tmp_path / "a.mcap"), str(tmp_path / "new")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "cannot write the recording" in done.stdout and "File too large" in done.stdout
    assert not (tmp_path / "new").exists()
    assert (tmp_path / "a.mcap").exists()


def test_a_bag_of_a_full_disk_is_recovered(tmp_path: Path) -> None:
    """The recorder has ended in the middle of a chunk."""
    file = write_bag(tmp_path / "bag", made_up_run(201))
    chunk = chunks_of(file)[6]
    file.write_bytes(file.read_bytes()[: chunk.end - 50])
    (tmp_path / "bag" / "metadata.yaml").unlink()
    result: Recovery = recover(tmp_path / "bag", tmp_path / "new")
    assert "bytes of it are missing" in result.losses[0].reason
    run = read_run(tmp_path / "new")
    assert run.joint_position.tobytes() == made_up_run(201).joint_position[: len(run.tick_ns)].tobytes()
