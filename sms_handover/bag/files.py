"""Files of a bag, and its messages in the order in which they were recorded."""

import shlex
import struct
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import zstandard
from mcap.exceptions import McapError

from sms_handover.bag.mcap.compression import COMPRESSED_FILE, inflate_file
from sms_handover.bag.mcap.damage import Damage
from sms_handover.bag.mcap.resync import MAGIC
from sms_handover.bag.mcap.scan import FileScan, Found, ScannedMessage
from sms_handover.bag.metadata import files_in_metadata
from sms_handover.errors import BagError

_CONVERSIONS = {  # by suffix
    ".db3": "'rosbags-convert --src {folder} --dst NEW --dst-storage mcap' makes one of it",
    ".bag": "'rosbags-convert --src {file} --dst NEW --dst-storage mcap' makes one of it",
}
_DAMAGE = (McapError, zstandard.ZstdError, struct.error, ValueError, KeyError, RuntimeError, MemoryError)


Progress = Callable[[int, int], None]  # bytes read, bytes in all


class RawMessage(NamedTuple):
    """One message of a bag; ``data`` is CDR with its header."""

    topic: str
    type: str
    data: bytes
    log_time_ns: int
    publish_time_ns: int


@dataclass(frozen=True)
class BagFiles:
    """The files of a bag in their order; ``missing`` are names of files that ``metadata.yaml`` lists too.

    ``unlisted`` are MCAP files beside them that it does not list; those are not read unless their
    names continue those of the bag. ``counts`` are the numbers of messages that it states, by topic.
    """

    path: Path
    files: tuple[Path, ...]
    missing: tuple[str, ...] = ()
    unlisted: tuple[str, ...] = ()
    counts: Mapping[str, int] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Return the size of all files in bytes."""
        return sum(file.stat().st_size for file in self.files)

    @contextmanager
    def opened(self) -> Iterator[tuple[Path, ...]]:
        """Hold the files; a file compressed as a whole is decompressed into a temporary folder meanwhile."""
        with ExitStack() as stack:
            files = []
            for file in self.files:
                if file.suffix in COMPRESSED_FILE:
                    folder = Path(stack.enter_context(TemporaryDirectory()))
                    with damage_reported(file):
                        files.append(inflate_file(file, folder))
                else:
                    files.append(file)
            yield tuple(files)

    def scans(self, progress: Progress | None = None) -> Iterator[FileScan]:
        """Yield a scan of each file, whatever its content; valid until the next one is asked for."""
        with self.opened() as files, damage_reported(self.path):
            total, before = sum(file.stat().st_size for file in files), 0
            for file in files:
                report = None if progress is None else partial(_report, progress, before, total)
                scan = FileScan(file, report=report)
                before += scan.size
                yield scan


def files_of(path: Path) -> BagFiles:
    """Return the files of a bag, given its folder or a file, whatever their content.

    They are those in ``metadata.yaml``, or without it all MCAP files in the order of their numbers.
    Raises BagError if there are none, or those of several bags.
    """
    if not path.exists():
        raise BagError(f"there is no bag at {path}")
    try:
        bag = _files_of(path)
    except OSError as error:
        raise BagError(f"cannot read {path}: {error.strerror}") from error
    for file in bag.files:
        if not file.is_file():  # opening a pipe would wait for its writer
            raise BagError(f"{file} is not a file")
    return bag


def whole_files(path: Path) -> BagFiles:
    """Return the files of a bag; raises BagError if one is missing or was not closed."""
    bag = files_of(path)
    if bag.missing:
        raise BagError(
            f"{', '.join(bag.missing)} of {path} is not there, metadata.yaml lists it; {recover_hint(path)}"
        )
    for file in bag.files:
        if file.suffix not in COMPRESSED_FILE:
            check_ends(file, path)
    return bag


def scans_of(path: Path) -> Iterator[FileScan]:
    """Yield a scan of each file of a bag, which must be whole; valid until the next one is asked for."""
    for scan in whole_files(path).scans():
        check_ends(scan.file, path)
        yield scan


def read_messages(path: Path, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
    """Yield the messages of a bag in recorded order, of ``topics`` or of all; checks every checksum.

    Raises BagError at the first damage.
    """
    for scan in scans_of(path):
        for found in strict_scan(scan, path):
            if isinstance(found, ScannedMessage):
                source = found.source
                if topics is None or source.topic in topics:
                    yield RawMessage(source.topic, source.schema.name, *found[1:4])


def strict_scan(scan: FileScan, bag: Path) -> Iterator[Found]:
    """Yield the content of a file of a bag; raises BagError at the first damage."""
    with damage_reported(scan.file):
        for found in scan:
            if isinstance(found, Damage):
                raise damage_error(found, bag)
            yield found


def damage_error(damage: Damage, bag: Path) -> BagError:
    """Return the error for damage in a file of a bag."""
    where = f"bytes {damage.begin} to {damage.end}: {damage.reason}"
    return BagError(f"{damage.file} is damaged: {where}; {recover_hint(bag)}")


@contextmanager
def damage_reported(file: Path) -> Iterator[None]:
    """Raise BagError with the name of the file for whatever reading a broken file raises."""
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


def _files_of(path: Path) -> BagFiles:
    """Return the files of a bag by ``metadata.yaml``, or by their names."""
    if path.is_file():
        _reject_others(path, (path,))
        return BagFiles(path, (path,))
    there = [file for file in path.iterdir() if _is_mcap(file)]
    listed = files_in_metadata(path)
    if listed.files:
        stems = {_name_and_number(file)[0] for file in listed.files}
        others = sorted((file for file in there if file not in listed.files), key=_name_and_number)
        continued = [file for file in others if _name_and_number(file)[0] in stems]
        files = (*listed.files, *continued)
        _reject_others(path, files)
        return BagFiles(path, files, listed.missing, tuple(file.name for file in others), listed.counts)
    files = tuple(sorted(there, key=_name_and_number))
    if len({_name_and_number(file)[0] for file in files}) > 1:
        raise BagError(f"{path} holds several bags, choose one: {', '.join(file.name for file in files)}")
    if not files:
        _reject_others(path, sorted(path.iterdir()))
        raise BagError(f"{path} is not a bag: no .mcap file in it")
    renamed = len(files) >= len(listed.missing)
    return BagFiles(path, files, () if renamed else listed.missing, counts=listed.counts)


def _is_mcap(file: Path) -> bool:
    return file.suffix == ".mcap" or (file.suffix in COMPRESSED_FILE and file.stem.endswith(".mcap"))


def _reject_others(path: Path, files: Sequence[Path]) -> None:
    """Raise BagError with the remedy if a file is a bag of another kind."""
    for file in files:
        suffix = Path(file.stem).suffix if file.suffix in COMPRESSED_FILE else file.suffix
        if suffix in _CONVERSIONS:
            remedy = _CONVERSIONS[suffix].format(folder=shlex.quote(str(path)), file=file)
            raise BagError(f"{path} is not a bag: it holds {file.name}, only .mcap files are read; {remedy}")


def _name_and_number(file: Path) -> tuple[str, int]:
    """Return the name of a bag and the number of one of its files, -1 without a number."""
    stem = file.name.split(".mcap")[0]
    name, _, number = stem.rpartition("_")
    return (name, int(number)) if number.isdecimal() else (stem, -1)


def check_ends(file: Path, bag: Path) -> None:
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


def _report(progress: Progress, before: int, total: int, place: int) -> None:
    progress(before + place, total)
