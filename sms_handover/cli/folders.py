"""What the output folder of a run holds, and who writes to it."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sms_handover.errors import ConfigurationError

BAG, LOGS = "bag", "log"


def bag_of(path: Path) -> Path:
    """Return the bag in the output folder of a run, or ``path`` itself if it is a bag."""
    return path / BAG if (path / BAG).is_dir() else path


@contextmanager
def locked_logs(output: Path) -> Iterator[int]:
    """Hold the lock of an output folder; yield the file descriptor that holds it.

    Every process of a run has it open, so that the folder is free when the last of them has ended.
    Raises ConfigurationError while a run has it.
    """
    descriptor = os.open(output / LOGS, os.O_RDONLY | os.O_DIRECTORY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ConfigurationError(
                f"a run still writes to output folder {output}; choose another, or end that run first"
            ) from None
        yield descriptor
    finally:
        os.close(descriptor)
