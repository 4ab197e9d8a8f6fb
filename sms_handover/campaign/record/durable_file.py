"""Durable files: written whole or not at all, and on disk before whoever counts on them goes on."""

import os
from collections.abc import Mapping
from contextlib import suppress
from errno import EDQUOT, ENOSPC, ENOTDIR
from pathlib import Path

from sms_handover.errors import SmsHandoverError


def write_durably(files: Mapping[Path, bytes | memoryview]) -> None:
    """Write files, each whole or not at all; when this returns, they and their names are on disk.

    A file that is there keeps its content until the new one is whole. Nobody else may write to it meanwhile.
    Raises SmsHandoverError where one cannot be written.
    """
    for path, data in files.items():
        unfinished = unfinished_name(path)
        try:
            make_folder(path.parent)
            try:
                with unfinished.open("wb") as stream:
                    stream.write(data)
                    stream.flush()
                    os.fsync(stream.fileno())
                unfinished.replace(path)
            finally:
                unfinished.unlink(missing_ok=True)
        except OSError as error:
            raise unwritable(path, error) from error
    for folder in dict.fromkeys(path.parent for path in files):
        sync_folder(folder)


def unfinished_name(path: Path) -> Path:
    """Return where a file is until it is whole; what was killed may leave it there, to be replaced."""
    return path.with_name(f".{path.name}")


def make_folder(path: Path) -> None:
    """Make a folder with its parents unless it is there, and their names durable; raises OSError."""
    if not path.is_dir():
        if path.exists():
            raise NotADirectoryError(ENOTDIR, f"{path} is no folder")
        make_folder(path.parent)
        path.mkdir(exist_ok=True)
        sync_folder(path.parent)


def sync_folder(path: Path) -> None:
    """Wait until the names in a folder are on disk."""
    with suppress(OSError):  # not every file system can sync a folder
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def unwritable(path: Path, error: OSError) -> SmsHandoverError:
    """Return the error of a file that cannot be written, with what to do about it."""
    remedy = "make room, then the same command goes on" if error.errno in (ENOSPC, EDQUOT) else ""
    return SmsHandoverError(
        f"{path} cannot be written: {error.strerror}; {remedy or 'once it can, the same command goes on'}"
    )
