"""Whatever is broken in a file, the scan invents nothing, alters nothing and misses no whole chunk."""

from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from sms_handover.bag.mcap.damage import Damage
from sms_handover.bag.mcap.scan import FileScan, Located, ScannedMessage

from .bag_damage import Message, chunks_of, is_subsequence, scanned, write_file
from .bag_messages import TYPES, text

COMPRESSIONS = list(CompressionType)


@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_whole_file_gives_every_message_and_no_damage(
    tmp_path: Path, compression: CompressionType, chunked: bool
) -> None:
    file = tmp_path / "a.mcap"
    write_file(file, compression, chunked=chunked)
    scan = FileScan(file)
    found = list(scan)
    assert not [item for item in found if isinstance(item, Damage)]
    assert scan.closed
    messages = [item for item in found if isinstance(item, ScannedMessage)]
    assert [m.log_time_ns for m in messages] == sorted(
        [10 * n for n in range(60)] + [10 * n + 5 for n in range(60)]
    )
    assert [m.sequence for m in messages[::2]] == list(range(60))
    if chunked:
        chunks = chunks_of(file)
        assert len(chunks) > 8
        assert scanned(file) == [message for chunk in chunks for message in chunk.messages]


def boundaries(file: Path) -> list[int]:
    """Return where the records of a whole file begin and end."""
    places = [place for item in FileScan(file) if isinstance(item, Located) for place in item[:2]]
    return sorted({*places, 0, file.stat().st_size})


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_file_cut_anywhere_gives_its_beginning(tmp_path: Path, compression: CompressionType) -> None:
    """Cut at every record boundary, next to each, and at sixty places between."""
    file = tmp_path / "a.mcap"
    content = write_file(file, compression)
    chunks = chunks_of(file)
    whole = [message for chunk in chunks for message in chunk.messages]
    random = np.random.default_rng(1)
    places = {place + off for place in boundaries(file) for off in (-1, 0, 9)}
    places |= set(random.integers(0, len(content), 60).tolist())
    for place in sorted(places & set(range(len(content)))):
        file.write_bytes(content[:place])
        scan = FileScan(file)
        found = [Message(i.source.topic, *i[1:]) for i in scan if isinstance(i, ScannedMessage)]
        must = sum(len(chunk.messages) for chunk in chunks if chunk.end <= place)
        assert found == whole[: len(found)], place
        assert len(found) >= must, place
        assert len(found) == must + scan.from_cut_chunk, place
        assert not scan.closed


def test_messages_come_out_of_an_uncompressed_chunk_that_is_cut(tmp_path: Path) -> None:
    """All but the one that the cut goes through."""
    file = tmp_path / "a.mcap"
    content = write_file(file, CompressionType.NONE)
    chunk = chunks_of(file)[3]
    after_fifth = content.index(chunk.messages[4].data) + len(chunk.messages[4].data)
    before = sum(len(other.messages) for other in chunks_of(file)[:3])
    for place, count in ((after_fifth - 1, 4), (after_fifth, 5), (after_fifth + 8, 5), (chunk.end - 1, None)):
        file.write_bytes(content[:place])
        scan = FileScan(file)
        messages = [item for item in scan if isinstance(item, ScannedMessage)]
        expected = len(chunk.messages) - 1 if count is None else count
        assert (len(messages) - before, scan.from_cut_chunk) == (expected, expected)


def test_messages_come_out_of_a_long_zstd_chunk_that_is_cut(tmp_path: Path) -> None:
    """Zstandard gives back whole blocks of 128 KiB."""
    file = tmp_path / "a.mcap"
    random = np.random.default_rng(2)
    with file.open("wb") as stream:
        writer = Writer(stream, chunk_size=2**22)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channel = writer.register_channel("/text", "cdr", schema)
        for number in range(1000):
            writer.add_message(channel, number, TYPES.serialize(text(random.bytes(500).hex())), 0)
        writer.finish()
    content = file.read_bytes()
    whole = scanned(file)
    file.write_bytes(content[: len(content) // 2])
    scan = FileScan(file)
    found = [Message(i.source.topic, *i[1:]) for i in scan if isinstance(i, ScannedMessage)]
    assert found == whole[: len(found)]
    assert 250 < len(found) == scan.from_cut_chunk < 1000


def damaged(content: bytes, place: int, kind: str, random: np.random.Generator) -> tuple[bytes, int]:
    """Return damaged content and where the damage ends in the content as it was."""
    size = int(random.integers(1, 65))
    end = min(place + size, len(content))
    middle = {
        "zeroed": bytes(end - place),
        "random": random.bytes(end - place),
        "flipped": bytes([content[place] ^ (1 << int(random.integers(8)))]),
        "deleted": b"",
        "inserted": random.bytes(size),
    }[kind]
    end = {"flipped": place + 1, "inserted": place}.get(kind, end)
    return content[:place] + middle + content[end:], end


@pytest.mark.parametrize("kind", ["zeroed", "random", "flipped", "deleted", "inserted"])
@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.ZSTD])
def test_damage_anywhere_costs_no_chunk_but_the_one_it_hits(
    tmp_path: Path, compression: CompressionType, kind: str
) -> None:
    """In heads, chunk heads, chunk bodies, indexes, summary and footer: at every boundary and between."""
    file = tmp_path / "a.mcap"
    content = write_file(file, compression)
    chunks = chunks_of(file)
    whole = [message for chunk in chunks for message in chunk.messages]
    random = np.random.default_rng(3)
    places = set(boundaries(file)[:-1])
    places |= {chunk.begin + off for chunk in chunks[:2] for off in (1, 9, 17, 25, 33, 37, 41, 45)}
    places |= set(random.integers(0, len(content), 40).tolist())
    for place in sorted(places):
        broken, end = damaged(content, place, kind, random)
        if broken == content:
            continue
        file.write_bytes(broken)
        found = scanned(file)
        assert is_subsequence(found, whole), (place, end)
        untouched = [
            m for chunk in chunks if chunk.end <= place or chunk.begin >= end for m in chunk.messages
        ]
        if kind == "inserted":
            untouched = [
                m for chunk in chunks if chunk.end <= place or chunk.begin >= place for m in chunk.messages
            ]
        missing = [message.log_time_ns for message in untouched if message not in found]
        assert not missing, (place, end)


def test_damage_is_told_with_place_time_and_messages(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    content = bytearray(write_file(file))
    chunk = chunks_of(file)[4]
    content[chunk.end - 20] ^= 1
    file.write_bytes(content)
    (damage,) = (item for item in FileScan(file) if isinstance(item, Damage))
    assert (damage.begin, damage.end, damage.of_index) == (chunk.begin, chunk.end, False)
    assert (damage.start_ns, damage.end_ns) == (
        min(m.log_time_ns for m in chunk.messages),
        max(m.log_time_ns for m in chunk.messages),
    )
    assert sum(damage.messages.values()) == len(chunk.messages)
    assert damage.messages["/text"] == sum(m.topic == "/text" for m in chunk.messages)
    assert "chunk" in str(damage) and str(chunk.begin) in str(damage)


def test_definitions_come_from_the_end_if_the_first_chunk_is_lost(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    content = bytearray(write_file(file))
    first, *others = chunks_of(file)
    content[first.begin + 60] ^= 255
    file.write_bytes(content)
    assert scanned(file) == [message for chunk in others for message in chunk.messages]


def test_messages_that_nothing_describes_are_counted_and_not_guessed(tmp_path: Path) -> None:
    """With the first chunk and the end lost, nothing says what the channels are."""
    file = tmp_path / "a.mcap"
    content = bytearray(write_file(file))
    first, *others = chunks_of(file)
    content[first.begin + 60] ^= 255
    file.write_bytes(content[: others[-1].end])
    assert scanned(file) == []
    told = [item for item in FileScan(file) if isinstance(item, Damage) and "not defined" in item.reason]
    assert sum(sum(item.messages.values()) for item in told) == sum(len(chunk.messages) for chunk in others)


def test_a_damaged_attachment_is_left_out(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    content = bytearray(write_file(file))
    content[content.index(b"attached") + 3] ^= 1
    file.write_bytes(content)
    (damage,) = (item for item in FileScan(file) if isinstance(item, Damage))
    assert "checksum of the attachment" in damage.reason
    assert len(scanned(file)) == 120


@pytest.mark.parametrize("content", [b"", b"x", b"\x89MCAP0\r\n", b"notes\n" * 1000, bytes(5000)])
def test_what_is_no_bag_has_no_messages(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "a.mcap"
    file.write_bytes(content)
    scan = FileScan(file)
    assert all(isinstance(item, Damage) for item in scan)
    assert not scan.closed


def test_a_damaged_index_is_told_as_such(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    content = bytearray(write_file(file))
    content[-20] ^= 1
    content[-60] = 0xEE
    file.write_bytes(content)
    assert len(scanned(file)) == 120
    assert all(item.of_index for item in FileScan(file) if isinstance(item, Damage))


def test_messages_in_a_chunk_that_has_lost_its_head_are_not_taken(tmp_path: Path) -> None:
    """They look like messages outside of chunks, but no checksum says that they are as they were."""
    file = tmp_path / "a.mcap"
    content = bytearray(write_file(file, CompressionType.NONE))
    first, *others = chunks_of(file)
    content[first.begin : first.begin + 9] = bytes(9)
    content[content.index(b"number 2") + 7] ^= 1
    file.write_bytes(content)
    assert scanned(file) == [message for chunk in others for message in chunk.messages]
