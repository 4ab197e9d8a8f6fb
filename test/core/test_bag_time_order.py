"""Messages by time: against the MCAP library's own order, and against sorting everything."""

from collections.abc import Sequence
from pathlib import Path
from random import Random

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from sms_handover.bag.files import RawMessage, read_messages
from sms_handover.bag.mcap.chunks import records_of
from sms_handover.bag.mcap.records import ChunkHead
from sms_handover.bag.time_order import TimeSpan, messages_by_time
from sms_handover.errors import BagError

TOPICS = ("/a", "/b", "/c")


def write(
    path: Path,
    times: Sequence[int],
    *,
    chunking: bool = True,
    index: bool = True,
    compression: CompressionType = CompressionType.ZSTD,
) -> None:
    """Write messages at times, in that order, topic by topic in turn, in small chunks."""
    with path.open("wb") as stream:
        writer = Writer(
            stream,
            chunk_size=400,
            compression=compression,
            use_chunking=chunking,
            index_types=IndexType.ALL if index else IndexType.NONE,
        )
        writer.start(profile="ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channels = [writer.register_channel(topic, "cdr", schema) for topic in TOPICS]
        for number, time_ns in enumerate(times):
            content = f"message {number}".encode()
            writer.add_message(channels[number % len(channels)], time_ns, content, time_ns + 1)
        writer.finish()


def shuffled(seed: int, count: int = 500, spread: int = 60) -> list[int]:
    """Return times that grow on the whole, and often equal or go back."""
    random = Random(seed)
    return [max(0, 5 * n + random.randrange(-spread, spread)) // 4 for n in range(count)]


EQUAL_ACROSS_CHUNKS = [50] * 12 + [30] * 3 + [50] * 12  # a chunk that begins earlier lies behind


@pytest.mark.parametrize("times", [*(shuffled(seed) for seed in range(5)), EQUAL_ACROSS_CHUNKS])
def test_the_order_is_that_of_the_mcap_library(tmp_path: Path, times: list[int]) -> None:
    file = tmp_path / "bag_0.mcap"
    write(file, times)
    with file.open("rb") as stream:
        expected = [
            (channel.topic, message.log_time, message.publish_time, message.data)
            for _, channel, message in make_reader(stream).iter_messages()
        ]
    found = [(m.topic, m.log_time_ns, m.publish_time_ns, m.data) for m in messages_by_time(tmp_path)]
    assert found == expected
    assert {m.type for m in messages_by_time(file)} == {"std_msgs/msg/String"}


def by_time(messages: Sequence[RawMessage]) -> list[RawMessage]:
    """Sort everything; equal times stay as recorded."""
    return sorted(messages, key=lambda message: message.log_time_ns)


@pytest.mark.parametrize(("chunking", "index"), [(True, True), (True, False), (False, True), (False, False)])
@pytest.mark.parametrize("topics", [None, ("/b",), ()])
def test_topics_and_times_are_chosen_with_and_without_an_index(
    tmp_path: Path, chunking: bool, index: bool, topics: tuple[str, ...] | None
) -> None:
    file = tmp_path / "bag_0.mcap"
    write(file, shuffled(7), chunking=chunking, index=index)
    everything = by_time(list(read_messages(file, topics)))
    assert list(messages_by_time(file, topics)) == everything
    for start, end in ((0, 10**9), (100, 300), (300, 300), (10**8, 10**9)):
        wanted = [m for m in everything if start <= m.log_time_ns <= end]
        assert list(messages_by_time(file, topics, TimeSpan(start, end))) == wanted


def test_a_split_bag_whose_files_overlap_is_one(tmp_path: Path) -> None:
    write(tmp_path / "run_0.mcap", range(0, 200))
    write(tmp_path / "run_1.mcap", range(150, 400))
    times = [m.log_time_ns for m in messages_by_time(tmp_path)]
    assert times == sorted([*range(0, 200), *range(150, 400)])


def test_only_chunks_that_overlap_are_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After the first message of a bag in order, no more than a few chunks have been read."""
    write(tmp_path / "bag_0.mcap", range(5000))
    read: list[object] = []

    def counted(head: ChunkHead, body: bytes) -> bytes:
        read.append(head)
        return records_of(head, body)

    monkeypatch.setattr("sms_handover.bag.mcap.scan.records_of", counted)
    messages = messages_by_time(tmp_path)
    next(messages)
    assert len(read) == 1
    for _ in range(100):
        next(messages)
    assert 1 < len(read) < 30
    messages = messages_by_time(tmp_path, None, TimeSpan(4990))
    read.clear()
    assert next(messages).log_time_ns == 4990
    assert len(read) == 1


def test_without_an_index_the_window_puts_in_order_what_it_can(tmp_path: Path) -> None:
    """A message that is later than the window is long comes late, and is not lost."""
    times = [*range(10, 10_510), 5, *range(10_510, 11_000)]
    write(tmp_path / "bag_0.mcap", times, chunking=False)
    found = [m.log_time_ns for m in messages_by_time(tmp_path)]
    assert sorted(found) == sorted(times)
    assert found.index(5) > 0
    found.remove(5)
    assert found == sorted(found)


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE])
def test_a_damaged_chunk_is_told(tmp_path: Path, compression: CompressionType) -> None:
    """Without compression only the checksum tells."""
    file = tmp_path / "bag_0.mcap"
    write(file, range(1000), compression=compression)
    data = bytearray(file.read_bytes())
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[10]
    data[chunk.chunk_start_offset + chunk.chunk_length - 20] ^= 0xFF
    file.write_bytes(bytes(data))
    before = []
    with pytest.raises(BagError, match=r"bag_0\.mcap is damaged"):
        for message in messages_by_time(file):
            before.append(message.log_time_ns)
    assert before == list(range(len(before))) and len(before) > 10


def test_what_is_no_bag_is_told_at_once(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="there is no bag"):
        messages_by_time(tmp_path / "nowhere")
