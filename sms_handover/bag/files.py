"""Find the files of a bag and go through their messages in the order they were recorded."""

import shlex
import struct
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import zstandard
from mcap.exceptions import McapError

from sms_handover.bag.mcap.damage import Damage
from sms_handover.bag.mcap.resync import MAGIC
from sms_handover.bag.mcap.scan import FileScan, Found, ScannedMessage
from sms_handover.errors import BagError

_CONVERSIONS = {  # by the end of a file's name, what a user can do
    ".db3": "'rosbags-convert --src {folder} --dst NEW --dst-storage mcap' makes one of it",
    ".bag": "'rosbags-convert --src {file} --dst NEW --dst-storage mcap' makes one of it",
    ".zstd": "'zstd -d' makes one of each file",
}
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
    files = files_of(path)
    for file in files:
        _check_ends(file, path)
    return files


def files_of(path: Path) -> tuple[Path, ...]:
    """Return the MCAP files of a bag in the order of their numbers, whatever is in them.

    Raises BagError if there are none, or those of several bags.
    """
    if not path.exists():
        raise BagError(f"there is no bag at {path}")
    try:
        files = (path,) if path.is_file() else tuple(sorted(path.glob("*.mcap"), key=_name_and_number))
        others = () if files or path.is_file() else tuple(sorted(path.iterdir()))
    except OSError as error:
        raise BagError(f"cannot read {path}: {error.strerror}") from error
    if len({_name_and_number(file)[0] for file in files}) > 1:
        raise BagError(f"{path} holds several bags, choose one: {', '.join(file.name for file in files)}")
    for file in (*files, *others):
        if file.suffix in _CONVERSIONS:
            remedy = _CONVERSIONS[file.suffix].format(folder=shlex.quote(str(path)), file=file)
            raise BagError(f"{path} is not a bag: it holds {file.name}, only .mcap files are read; {remedy}")
    if not files:
        raise BagError(f"{path} is not a bag: no .mcap file in it")
    for file in files:
        if not file.is_file():  # to open a pipe would wait for whoever writes to it
            raise BagError(f"{file} is not a file")
    return files


def read_messages(path: Path, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
    """Yield the messages of a bag in recorded order, of ``topics`` or of all; checks every checksum.

    Raises BagError at the first damage.
    """
    for file in bag_files(path):
        for found in strict_scan(FileScan(file), path):
            if isinstance(found, ScannedMessage):
                source = found.source
                if topics is None or source.topic in topics:
                    yield RawMessage(source.topic, source.schema.name, *found[1:4])


def strict_scan(scan: FileScan, bag: Path) -> Iterator[Found]:
    """Yield what is in a file of a bag; raises BagError at the first damage."""
    with damage_reported(scan.file):
        for found in scan:
            if isinstance(found, Damage):
                where = f"bytes {found.begin} to {found.end}: {found.reason}"
                raise BagError(f"{scan.file} is damaged: {where}; {recover_hint(bag)}")
            yield found


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


def recover_hint(path: Path) -> str:
    """Return what a user can do about a damaged bag."""
    return f"'sms-handover bag recover {shlex.quote(str(path))}' makes a new bag of what can be read"


def _name_and_number(file: Path) -> tuple[str, int]:
    """Return the name of a bag and the number of one of its files, -1 without a number."""
    name, _, number = file.stem.rpartition("_")
    return (name, int(number)) if number.isdecimal() else (file.stem, -1)


def _check_ends(file: Path, bag: Path) -> None:
    """Raise BagError unless a file of a bag begins and ends as a complete MCAP file does."""
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
            f" full or the file was cut; {recover_hint(bag)}"
        )
