"""A recording split into files loses nothing at the seams, and each of its files stands alone."""

from pathlib import Path

import pytest
import yaml
from rosbags.rosbag2 import Reader

from sms_handover.bag.files import read_messages
from sms_handover.bag.info import read_info
from sms_handover.bag.recording import Recording
from sms_handover.bag.repair.check import check
from sms_handover.bag.repair.findings import Severity
from sms_handover.bag.repair.recover import recover
from sms_handover.bag.split import Split
from sms_handover.bag.writer import FLUSH_PERIOD_NS, BagWriter
from sms_handover.errors import BagError

from .bag_messages import JOINT_STATE, JOINTS, TICK_NS, TYPES, WALL_NS, joint_state

STATES = "/joint_states"
TICKS = 1000
LENGTH_NS = 200 * TICK_NS


def state_bytes(tick: int) -> bytes:
    return TYPES.serialize(joint_state(tick * TICK_NS, JOINTS, [float(tick)] * 14))


def record(folder: Path, split: Split, ticks: int = TICKS) -> list[bytes]:
    """Record states with all that a bag of ours has, and return their bytes."""
    messages = [state_bytes(tick) for tick in range(ticks)]
    with Recording(folder, types=TYPES, split=split) as recording:
        recording.add_topic(STATES, JOINT_STATE, period_ns=TICK_NS)
        recording.describe(urdf="<robot/>", schedule="phases: []\n", provenance={"seed": "1"})
        recording.begin()
        for data in messages:
            recording.receive(STATES, data, WALL_NS)
    return messages


def files(folder: Path) -> list[Path]:
    """Return the files of a bag in the order of their numbers."""
    return sorted(folder.glob("*.mcap"), key=lambda path: int(path.stem.rpartition("_")[2]))


def test_nothing_is_lost_at_a_seam_and_others_read_the_bag_as_one(tmp_path: Path) -> None:
    messages = record(tmp_path / "bag", Split(duration_ns=LENGTH_NS))
    assert [path.name for path in files(tmp_path / "bag")] == [f"bag_{n}.mcap" for n in range(5)]
    assert [message.data for message in read_messages(tmp_path / "bag")] == messages
    with Reader(tmp_path / "bag") as reader:
        assert [bytes(data) for _, _, data in reader.messages()] == messages
        assert reader.message_count == TICKS
    result = check(tmp_path / "bag")
    assert result.complete, result.findings
    info = read_info(tmp_path / "bag")
    assert info.message_count == TICKS
    assert info.ledger is not None and info.ledger.complete
    assert info.ledger.topics[0].received == TICKS


def test_each_file_stands_alone(tmp_path: Path) -> None:
    """One file is all that somebody may have been sent: it has topics, attachments and records."""
    record(tmp_path / "bag", Split(duration_ns=LENGTH_NS))
    for path in files(tmp_path / "bag"):
        info = read_info(path)
        assert (info.urdf_text, info.schedule_text) == ("<robot/>", "phases: []\n")
        assert info.provenance == {"seed": "1"}
        assert info.topics[STATES].type_hash.startswith("RIHS01_")
        assert info.duration_ns <= LENGTH_NS + FLUSH_PERIOD_NS
        damaged = [f.text for f in check(path).findings if f.severity is Severity.DAMAGED]
        assert damaged == []


def test_metadata_tells_of_every_file(tmp_path: Path) -> None:
    record(tmp_path / "bag", Split(duration_ns=LENGTH_NS))
    body = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    there = files(tmp_path / "bag")
    assert body["relative_file_paths"] == [path.name for path in there]
    for entry, path in zip(body["files"], there, strict=True):
        info = read_info(path)
        assert entry["path"] == path.name
        assert entry["message_count"] == info.message_count
        assert entry["starting_time"]["nanoseconds_since_epoch"] == info.start_ns
        assert entry["duration"]["nanoseconds"] == info.duration_ns
    assert body["message_count"] == sum(entry["message_count"] for entry in body["files"]) == TICKS
    assert body["duration"]["nanoseconds"] == (TICKS - 1) * TICK_NS


def test_a_limit_of_size_is_passed_by_one_flush_at_most(tmp_path: Path) -> None:
    messages = record(tmp_path / "bag", Split(size=15_000))
    sizes = [path.stat().st_size for path in files(tmp_path / "bag")]
    assert len(sizes) > 2
    flushed = 20 * (len(messages[0]) + 60)  # bytes of a flush: uncompressed messages with their heads
    end = 6_000  # bytes of the summary of so small a file
    assert all(15_000 <= size < 15_000 + flushed + end for size in sizes[:-1]), sizes
    assert [message.data for message in read_messages(tmp_path / "bag")] == messages


def test_without_a_limit_there_is_one_file(tmp_path: Path) -> None:
    record(tmp_path / "bag", Split())
    assert len(files(tmp_path / "bag")) == 1


def test_a_split_bag_is_recovered_into_one_file_with_every_message(tmp_path: Path) -> None:
    messages = record(tmp_path / "bag", Split(duration_ns=LENGTH_NS))
    last = files(tmp_path / "bag")[-1]
    last.write_bytes(last.read_bytes()[:-1000])  # the recorder was killed in the last file
    recover(tmp_path / "bag", tmp_path / "new")
    assert len(files(tmp_path / "new")) == 1
    assert [message.data for message in read_messages(tmp_path / "new")] == messages
    ledger = read_info(tmp_path / "new").ledger
    assert ledger is not None and ledger.topics[0].missing == 0


def test_a_file_in_the_middle_that_is_gone_is_missed(tmp_path: Path) -> None:
    record(tmp_path / "bag", Split(duration_ns=LENGTH_NS))
    (tmp_path / "bag" / "bag_2.mcap").unlink()
    texts = [finding.text for finding in check(tmp_path / "bag").findings]
    assert any("bag_2.mcap is not there" in text for text in texts)
    assert any(STATES in text and "stamps are missing" in text for text in texts)


def test_the_next_file_goes_where_the_folder_has_been_moved(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", types=TYPES, split=Split(duration_ns=LENGTH_NS)) as writer:
        writer.add_topic(STATES, JOINT_STATE)
        for tick in range(TICKS):
            writer.write(STATES, state_bytes(tick), tick * TICK_NS, 0)
            if tick == 100:
                (tmp_path / "bag").rename(tmp_path / "moved")
    assert len(files(tmp_path / "moved")) == 5
    assert read_info(tmp_path / "moved").message_count == TICKS


def test_a_next_file_that_cannot_be_made_leaves_the_ones_before_it_whole(tmp_path: Path) -> None:
    """It ends the recording in one line, as a full disk does; nothing that is there is written over."""
    writer = BagWriter(tmp_path / "bag", types=TYPES, split=Split(duration_ns=LENGTH_NS))
    (tmp_path / "bag" / "bag_1.mcap").write_text("mine")
    writer.add_topic(STATES, JOINT_STATE)
    with pytest.raises(BagError, match=r"cannot write the recording .*bag_1.mcap: File exists"):
        for tick in range(TICKS):
            writer.write(STATES, state_bytes(tick), tick * TICK_NS, 0)
    with pytest.raises(BagError, match="File exists"):
        writer.close()
    assert (tmp_path / "bag" / "bag_1.mcap").read_text() == "mine"
    assert read_info(tmp_path / "bag" / "bag_0.mcap").duration_ns >= LENGTH_NS
