"""Journal of a campaign: a line of JSON per finished case, on disk before the next one counts.

A line has the row, what was measured beside it, the digest of its campaign, and a check sum of all. A last
line without its end is of a writer that was killed and is cut off; a line that is broken otherwise is named,
put aside, and done again. A sound line of another campaign is an error.
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
from sms_handover.campaign.record.durable_file import (
    sync_folder,
    unfinished_name,
    unwritable,
    write_durably,
)
from sms_handover.errors import ConfigurationError

JOURNAL = "journal.jsonl"
_BROKEN = "broken.jsonl"
_DIGITS = 16  # hexadecimal ones, of a check sum and of what names a campaign
_NO_ENTRY = (ValueError, KeyError, TypeError, ArithmeticError, RecursionError)  # of a line that is broken


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
        """Return each fault in a line, for whoever only reads the journal."""
        said = [
            f"{path}, line {number} is corrupted and left out: 'campaign run' runs its case again"
            for number in self.broken
        ]
        torn = f"{path}: the last line has no end, as while it is written, and is left out"
        return (*said, torn) if self.torn else (*said,)

    def mended_in_words(self, path: Path) -> tuple[str, ...]:
        """Return what was done about each fault in a line."""
        said = [f"{path}, line {number} is corrupted: its case is run again" for number in self.broken]
        torn = f"{path}: {self.torn} bytes of an unfinished last line are cut off"
        return (*said, torn) if self.torn else (*said,)


def entries_of(path: Path, campaign: str, faults: JournalFaults) -> Iterator[Entry]:
    """Yield the sound lines of the journal of a campaign, given by its digest; collect the faults.

    There are none if there is no file. Raises ConfigurationError where it cannot be read, and on a sound line
    of another campaign, or of before lines named theirs.
    """
    if not path.exists():
        return
    try:
        stream = path.open("rb")
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be read: {error.strerror}") from error
    with stream:
        for number, line in enumerate(stream, start=1):
            if not line.endswith(b"\n"):
                faults.torn = len(line)
                return
            try:
                entry, its_campaign = _entry(line)
            except _NO_ENTRY:
                faults.broken[number] = line
                continue
            if its_campaign != campaign[:_DIGITS]:
                whose = f"campaign {its_campaign}" if its_campaign else "an earlier edition, which named none"
                raise ConfigurationError(
                    f"{path}, line {number} is of {whose}, not of campaign {campaign[:_DIGITS]}, which is in "
                    "this folder: put its own journal back, or choose another folder"
                )
            yield entry


class JournalWriter:
    """Appends to a journal that nobody else writes to."""

    def __init__(self, path: Path, campaign: str) -> None:
        """Lock the journal of a campaign, given by its digest, and mend it.

        Raises ConfigurationError while somebody else writes to it or if it is of another campaign,
        SmsHandoverError where it cannot be written.
        """
        self.path, self._campaign = path, campaign
        self.faults = JournalFaults()
        self._descriptors: list[int] = []
        try:
            self._descriptor = self._locked(path)
            self._mend()
        except BaseException as error:
            self.close()
            if isinstance(error, BlockingIOError):
                raise ConfigurationError(
                    f"{path} is written to by another run of the campaign; wait for it, or end it first"
                ) from None
            if isinstance(error, OSError):
                raise unwritable(Path(error.filename or path), error) from error
            raise

    def _mend(self) -> None:
        """Cut off a torn last line, and put broken lines aside; the journal is whole at any time."""
        for _ in entries_of(self.path, self._campaign, self.faults):
            pass
        if self.faults.torn:
            os.ftruncate(self._descriptor, os.fstat(self._descriptor).st_size - self.faults.torn)
        if not self.faults.broken:
            return
        aside = self.path.with_name(_BROKEN)
        there = _lines(aside) if aside.exists() else []
        new = [line for line in self.faults.broken.values() if line not in there]
        write_durably({aside: b"".join([*there, *new])})
        lines = enumerate(_lines(self.path), start=1)
        sound = [line for number, line in lines if number not in self.faults.broken]
        unfinished = unfinished_name(self.path)
        unfinished.unlink(missing_ok=True)
        self._descriptor = self._locked(unfinished)
        self._write(b"".join(sound))
        unfinished.replace(self.path)
        sync_folder(self.path.parent)

    def _locked(self, path: Path) -> int:
        """Open and lock a file until the journal is closed; raises BlockingIOError if somebody else has."""
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        self._descriptors.append(descriptor)
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if not os.path.samestat(os.fstat(descriptor), path.stat()):  # mended by another run meanwhile
            raise BlockingIOError
        sync_folder(path.parent)
        return descriptor

    def add(self, *entries: Entry) -> None:
        """Append lines and wait until they are on disk; raises SmsHandoverError where they cannot be."""
        self._write(b"".join(_line(*entry, self._campaign) for entry in entries))

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
            raise unwritable(self.path, error) from error

    def close(self) -> None:
        """Let go of the journal."""
        for descriptor in self._descriptors:
            os.close(descriptor)


def _lines(path: Path) -> list[bytes]:
    """Return the lines of a file, as they are numbered: a carriage return ends none."""
    with path.open("rb") as stream:
        return list(stream)


def _line(row: Row, beside: Beside, campaign: str) -> bytes:
    """Return a line of the journal of a campaign."""
    measured, name = json.dumps(asdict(beside), sort_keys=True), campaign[:_DIGITS]
    check = _check(row.text, measured, name)
    return f'{{"row":{row.text},"beside":{measured},"campaign":"{name}","check":"{check}"}}\n'.encode()


def _entry(line: bytes) -> tuple[Entry, str]:
    """Return what a line says and its campaign, '' where it names none; raises one of _NO_ENTRY if broken."""
    values = json.loads(line)
    row, beside = row_of(values["row"]), Beside(**values["beside"])
    measured = json.dumps(asdict(beside), sort_keys=True)
    named = (str(values["campaign"]),) if "campaign" in values else ()
    if values["check"] != _check(row.text, measured, *named):
        raise ValueError("its check sum does not fit")
    return Entry(row, beside), "".join(named)


def _check(*texts: str) -> str:
    """Return the check sum of texts."""
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:_DIGITS]
