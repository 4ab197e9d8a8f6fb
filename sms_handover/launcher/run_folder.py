"""The output folder of a run: what it holds, and who writes to it."""

import fcntl
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sms_handover.errors import ConfigurationError

BAG, LOGS = "bag", "log"
_LATER_RUN = re.compile(rf"{BAG}_(\d+)")  # of a simulation that was reset


def bags_of(path: Path) -> tuple[Path, ...]:
    """Return the bags in the output folder of a run, or ``path`` itself if it is a bag.

    There is one bag, or one per run in their order if the simulation was reset.
    """
    if not (path / BAG).is_dir():
        return (path,)
    later = {int(match[1]): bag for bag in path.iterdir() if (match := _LATER_RUN.fullmatch(bag.name))}
    return (path / BAG, *(later[number] for number in sorted(later)))


def is_bag_of_run(name: str) -> bool:
    """Whether a bag of this name is one in the output folder of a run."""
    return name == BAG or _LATER_RUN.fullmatch(name) is not None


def bag_of(path: Path) -> Path:
    """Return the bag in the output folder of a run, or ``path`` itself if it is a bag.

    Raises ConfigurationError if there are those of several runs.
    """
    bags = bags_of(path)
    if len(bags) > 1:
        names = ", ".join(map(str, bags))
        raise ConfigurationError(f"{path} has the bags of {len(bags)} runs; name one of {names}")
    return bags[0]


@contextmanager
def locked_logs(output: Path) -> Iterator[int]:
    """Lock an output folder; yield the file descriptor of the lock.

    Every process of a run has it open, so that the folder is free when the last process has ended.
    Raises ConfigurationError while another run holds it.
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
