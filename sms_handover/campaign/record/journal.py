"""Journal of a campaign: a line of JSON per finished case, on disk before the next one counts.

A line has the row, what was measured beside it, and a check sum of both. A last line without its end is of a
writer that was killed and is cut off; a line that is broken otherwise is named, put aside, and done again.
"""

import fcntl
import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import NamedTuple

from sms_handover.campaign.cases.case_row import Beside, Row, row_of
from sms_handover.errors import ConfigurationError, SmsHandoverError

JOURNAL = "journal.jsonl"
_BROKEN = "broken.jsonl"
_CHECK = 16  # hexadecimal digits


class Entry(NamedTuple):
    """A line of a journal."""

    row: Row
    beside: Beside


@dataclass
class JournalFaults:
    """What is wrong with a journal: its broken lines by number, and the bytes of a last line without end."""

    broken: dict[int, bytes] = field(default_factory=dict)
    torn: int = 0

    def in_words(self, path: Path) -> tuple[str, ...]:
        """Return each fault in a line."""
        said = [f"{path}, line {number} is corrupted: its case is run again" for number in self.broken]
        return (
            (*said, f"{path}: {self.torn} bytes of an unfinished last line are cut off")
            if self.torn
            else (*said,)
        )


def entries_of(path: Path, faults: JournalFaults) -> Iterator[Entry]:
    """Yield the sound lines of a journal, none if there is no file; collect its faults.

    Raises OSError where it cannot be read.
    """
    if not path.exists():
        return
    with path.open("rb") as stream:
        for number, line in enumerate(stream, start=1):
            if not line.endswith(b"\n"):
                faults.torn = len(line)
                return
            try:
                yield _entry(line)
            except (ValueError, KeyError, TypeError):
                faults.broken[number] = line


class JournalWriter:
    """Appends to a journal that nobody else writes to."""

    def __init__(self, path: Path) -> None:
        """Lock the journal and mend it; raises ConfigurationError while somebody else writes to it."""
        self.path = path
        self._descriptors: list[int] = []
        try:
            self._descriptor = self._locked(path)
        except BlockingIOError:
            self.close()
            raise ConfigurationError(
                f"{path} is written to by another run of the campaign; wait for it, or end it first"
            ) from None
        self.faults = JournalFaults()
        self._mend()

    def _mend(self) -> None:
        """Cut off a torn last line, and put broken lines aside."""
        for _ in entries_of(self.path, self.faults):
            pass
        if self.faults.torn:
            os.ftruncate(self._descriptor, os.fstat(self._descriptor).st_size - self.faults.torn)
        if not self.faults.broken:
            return
        with self.path.with_name(_BROKEN).open("ab") as aside:
            aside.writelines(self.faults.broken.values())
        with self.path.open("rb") as stream:  # by its lines, as they were numbered: \r ends none
            sound = [line for number, line in enumerate(stream, start=1) if number not in self.faults.broken]
        unfinished = self.path.with_name(f".{self.path.name}")
        unfinished.unlink(missing_ok=True)
        self._descriptor = self._locked(unfinished)
        self._write(b"".join(sound))
        unfinished.replace(self.path)  # so that whoever is killed here leaves a whole journal

    def _locked(self, path: Path) -> int:
        """Open and lock a file until the journal is closed; raises BlockingIOError if somebody else has."""
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        self._descriptors.append(descriptor)
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return descriptor

    def add(self, *entries: Entry) -> None:
        """Append lines and wait until they are on disk; raises SmsHandoverError where they cannot be."""
        self._write(b"".join(_line(*entry) for entry in entries))

    def _write(self, data: bytes) -> None:
        """Write bytes whole or not at all."""
        size = os.fstat(self._descriptor).st_size
        try:
            left = memoryview(data)
            while left:
                left = left[os.write(self._descriptor, left) :]
            os.fsync(self._descriptor)
        except OSError as error:
            os.ftruncate(self._descriptor, size)
            raise SmsHandoverError(
                f"{self.path} cannot be written: {error.strerror}; make room, then the same command goes on"
            ) from error

    def close(self) -> None:
        """Let go of the journal."""
        for descriptor in self._descriptors:
            os.close(descriptor)


def _line(row: Row, beside: Beside) -> bytes:
    """Return a line of a journal."""
    measured = json.dumps(asdict(beside), sort_keys=True)
    return f'{{"row":{row.text},"beside":{measured},"check":"{_check(row.text, measured)}"}}\n'.encode()


def _entry(line: bytes) -> Entry:
    """Return what a line says; raises ValueError, KeyError or TypeError if it is broken."""
    values = json.loads(line)
    row, beside = row_of(values["row"]), Beside(**values["beside"])
    measured = json.dumps(asdict(beside), sort_keys=True)
    if values["check"] != _check(row.text, measured):
        raise ValueError("its check sum does not fit")
    return Entry(row, beside)


def _check(*texts: str) -> str:
    """Return the check sum of texts."""
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:_CHECK]
