"""Samples of the resources of processes: memory, file descriptors, threads, shared memory."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sms_handover.types import Array

_SHARED_MEMORY = "/dev/shm/"
_KIB_PER_MIB = 1024


@dataclass(frozen=True)
class Sample:
    """One process at one moment; memory in MiB.

    ``own`` is what it has allocated (anonymous pages), the only number that other processes, which
    load the same libraries, do not change. ``rss`` and ``pss`` are as the system counts.
    """

    time_s: float  # [s] simulated
    own: float
    pss: float
    rss: float
    descriptors: int
    threads: int
    shared: float  # [MiB] of the files in /dev/shm that it has mapped


def sample(pid: int, time_s: float) -> Sample | None:
    """Return what a process holds, None if it is gone."""
    folder = Path(f"/proc/{pid}")
    try:
        memory = _fields(folder / "smaps_rollup")
        return Sample(
            time_s,
            own=memory["Anonymous"] / _KIB_PER_MIB,
            pss=memory["Pss"] / _KIB_PER_MIB,
            rss=memory["Rss"] / _KIB_PER_MIB,
            descriptors=sum(1 for _ in (folder / "fd").iterdir()),
            threads=sum(1 for _ in (folder / "task").iterdir()),
            shared=_shared(folder / "maps"),
        )
    except (OSError, KeyError):
        return None


def growth(samples: Sequence[Sample], warm_up_s: float) -> float:
    """Return by how much its own memory grows in MiB per simulated minute, after the warm-up.

    It is the median of the slopes between any two samples (Theil and Sen), which single peaks and
    the teeth of a saw do not move.
    """
    late = [item for item in samples if item.time_s >= warm_up_s]
    time: Array = np.array([item.time_s / 60.0 for item in late])  # [min]
    size: Array = np.array([item.own for item in late])
    first, second = np.triu_indices(len(late), 1)
    steps = time[second] - time[first]
    apart = steps > 0.0
    if not apart.any():
        raise ValueError(f"{len(late)} samples after {warm_up_s:g} s of warm-up are too few for a slope")
    return float(np.median((size[second] - size[first])[apart] / steps[apart]))


def _fields(file: Path) -> dict[str, int]:
    """Return the numbers of a file of /proc in KiB, by name; several of a name add up."""
    found: dict[str, int] = {}
    for line in file.read_text(encoding="ascii", errors="replace").splitlines():
        name, _, rest = line.partition(":")
        with suppress(ValueError, IndexError):
            found[name] = found.get(name, 0) + int(rest.split()[0])
    return found


def _shared(maps: Path) -> float:
    """Return the size of the files in /dev/shm that a process has mapped [MiB]."""
    lines = maps.read_text(encoding="utf-8", errors="replace").splitlines()
    files = {line.split(maxsplit=5)[5] for line in lines if _SHARED_MEMORY in line}
    size = 0
    for file in files:
        with suppress(OSError):
            size += Path(file).stat().st_size
    return size / _KIB_PER_MIB**2
