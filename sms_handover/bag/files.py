"""Find the files of a bag and go through their messages in the order they were recorded."""

import struct
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import zstandard
from mcap.exceptions import McapError
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader

from sms_handover.errors import BagError

MAGIC = b"\x89MCAP0\r\n"  # the first and the last bytes of a complete file

_DAMAGE = (McapError, zstandard.ZstdError, struct.error, ValueError, KeyError, RuntimeError, MemoryError)


class RawMessage(NamedTuple):
    """One message as it lies in a bag; ``data`` is CDR with its header."""

    topic: str
    type: str
    data: bytes
    log_time_ns: int
    publish_time_ns: int


def bag_files(path: Path) -> tuple[Path, ...]:
    """Return the MCAP files of a bag, given its folder or a file; raises BagError if one is unusable.

    A bag that rosbag2 has split has several, ``<name>_0.mcap``, ``<name>_1.mcap`` and so on.
    """
    if not path.exists():
        raise BagError(f"there is no bag at {path}")
    files = (path,) if path.is_file() else tuple(sorted(path.glob("*.mcap"), key=_name_and_number))
    if len({_name_and_number(file)[0] for file in files}) > 1:
        raise BagError(f"{path} holds several bags, choose one: {', '.join(file.name for file in files)}")
    if not files:
        other = next((file.name for file in sorted(path.iterdir()) if file.suffix in {".db3", ".zstd"}), None)
        reason = (
            f"it holds {other}, only uncompressed .mcap files are read" if other else "no .mcap file in it"
        )
        raise BagError(f"{path} is not a bag: {reason}")
    for file in files:
        _check_ends(file)
    return files


def read_messages(path: Path, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
    """Yield the messages of a bag in recorded order, of ``topics`` or of all; checks every checksum."""
    for file in bag_files(path):
        yield from _file_messages(file, topics)


@contextmanager
def damage_reported(file: Path) -> Iterator[None]:
    """Turn whatever reading a broken file raises into a BagError that names the file."""
    try:
        yield
    except OSError as error:
        raise BagError(f"cannot read {file}: {error.strerror}") from error
    except _DAMAGE as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BagError(f"{file} is damaged: {reason}") from error


def _file_messages(file: Path, topics: Collection[str] | None) -> Iterator[RawMessage]:
    """Yield the messages of one file."""
    schemas: dict[int, str] = {0: ""}
    channels: dict[int, tuple[str, str]] = {}
    with damage_reported(file), file.open("rb") as stream:
        size = file.stat().st_size
        for record in StreamReader(stream, validate_crcs=True, record_size_limit=size).records:
            if isinstance(record, Message):
                channel = channels.get(record.channel_id)
                if channel is not None:
                    yield RawMessage(*channel, record.data, record.log_time, record.publish_time)
            elif isinstance(record, Schema):
                schemas[record.id] = record.name
            elif isinstance(record, Channel) and (topics is None or record.topic in topics):
                channels[record.id] = (record.topic, schemas[record.schema_id])


def _name_and_number(file: Path) -> tuple[str, int]:
    """Return the name of a bag and the number of one of its files, -1 without a number."""
    name, _, number = file.stem.rpartition("_")
    return (name, int(number)) if number.isdecimal() else (file.stem, -1)


def _check_ends(file: Path) -> None:
    """Raise BagError unless a file begins and ends as a complete MCAP file does."""
    with damage_reported(file), file.open("rb") as stream:
        size = file.stat().st_size
        head = stream.read(len(MAGIC))
        stream.seek(max(0, size - len(MAGIC)))
        tail = stream.read()
    if size == 0:
        raise BagError(f"{file} is empty")
    if head != MAGIC:
        raise BagError(f"{file} is not an MCAP file")
    if tail != MAGIC or size == len(MAGIC):
        raise BagError(
            f"{file} was not closed: it has {size} bytes and no end, so the recorder was killed, the disk was"
            " full or the file was cut; what was recorded so far has to be recovered first"
        )
