"""Too little of what a machine has: processors, memory, shared memory, descriptors, processes."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from sms_handover.bag.info import read_info

from ..ros.short_handover import short_handover
from ..system.runs import Ended, busy_cores
from .fault import Fault
from .leftovers import SHARED_MEMORY
from .outcome import NOTHING_LOST, CannotTry, Kept, require
from .promises import exit_code, ledger_loss, one_line, refused, whole
from .trial import Trial

TITLE = "Too little of the machine"

_STRETCH = 6.0  # [-] of the short handover: two seconds of simulated time
_CGROUPS = Path("/sys/fs/cgroup")  # version 1, a folder per resource


def run(trial: Trial, *arguments: object, prefix: Sequence[object] = ()) -> Ended:
    """Carry out a short run to its end."""
    schedule = trial.folder / "schedule.yaml"
    schedule.write_text(short_handover(stretch=_STRETCH), encoding="utf-8")
    return trial.sms_handover("run", "--schedule", schedule, "-o", "run", *arguments, prefix=prefix)


def same_bits(trial: Trial, ended: Ended) -> Kept:
    """Require a whole bag whose every bit is what one process computes without any of it."""
    kept = whole(trial.folder / "run" / "bag", ended)
    again = trial.sms_handover("verify", "run")
    require(again.code == 0, f"the run is not reproduced: {(again.err or again.out)[-300:]}")
    return kept


def works_or_says_why(trial: Trial, ended: Ended) -> Kept:
    """Require a whole bag, or a failure in one line and a bag that holds all that came."""
    bag = trial.folder / "run" / "bag"
    if ended.code == 0:
        return whole(bag, ended)
    if ended.code == -signal.SIGKILL:
        return Kept(ended.code, note="the system killed the launcher itself; its nodes noticed and ended")
    exit_code(ended, 1, 2)
    one_line(ended)
    if not list(bag.glob("*.mcap")):
        return Kept(ended.code, NOTHING_LOST, note=f"it ended before anything was recorded: {_reason(ended)}")
    return Kept(ended.code, ledger_loss(read_info(bag).ledger), note=_reason(ended))


def _reason(ended: Ended) -> str:
    """Return the line that tells the error, without the name of the command."""
    return ended.errors[0].partition("error: ")[2][:150]


# Processors


def loaded(trial: Trial, *arguments: object) -> Ended:
    """Run while something else keeps every core busy."""
    with busy_cores():
        return run(trial, *arguments)


def counts_what_is_late(trial: Trial, ended: Ended) -> Kept:
    """Require that a run in real time ends in order and tells how far it fell behind; the bag is whole."""
    kept = whole(trial.folder / "run" / "bag", ended)
    words = [line for line in ended.out.splitlines() if "late" in line]
    return Kept(kept.exit_code, kept.lost, note=words[-1].strip() if words else "")


# Memory, descriptors, processes


@contextmanager
def cgroup(resource: str, name: str, trial: Trial, limits: dict[str, int]) -> Iterator[tuple[str, ...]]:
    """Make a control group with limits; yield the prefix that runs a command in it."""
    group = _CGROUPS / resource / f"sms_handover_{name}_{trial.mark}"
    try:
        group.mkdir()
        for file, value in limits.items():
            (group / file).write_text(str(value), encoding="ascii")
    except OSError as error:
        raise CannotTry(f"no control group for {resource}: {error.strerror}") from error
    try:
        yield ("sh", "-c", f'echo $$ > {group}/cgroup.procs && exec "$0" "$@"')
    finally:
        trial.end_remaining()
        group.rmdir()


def little_memory(trial: Trial) -> Ended:
    """Give the whole run less memory than it needs; the system kills who asks for more."""
    limit = trial.random.randint(150, 350) * 2**20
    with cgroup("memory", "memory", trial, {"memory.limit_in_bytes": limit}) as prefix:
        return run(trial, prefix=prefix)


def little_address_space(trial: Trial) -> Ended:
    """Give each process less address space than it needs: no allocation succeeds."""
    limit = trial.random.randint(300, 900) * 2**20
    return run(trial, prefix=("prlimit", f"--as={limit}"))


def few_descriptors(trial: Trial) -> Ended:
    """Give each process few file descriptors."""
    return run(trial, prefix=("prlimit", f"--nofile={trial.random.randint(10, 40)}"))


def few_processes(trial: Trial) -> Ended:
    """Let no more than some processes and threads begin."""
    with cgroup("pids", "pids", trial, {"pids.max": trial.random.randint(4, 40)}) as prefix:
        return run(trial, prefix=prefix)


def full_shared_memory(trial: Trial) -> Ended:
    """Fill /dev/shm to the last page."""
    trial.mount(SHARED_MEMORY, size="256k")
    with (SHARED_MEMORY / "full").open("wb") as file:
        file.write(bytes(256 * 1024))
    return run(trial)


def small_shared_memory(trial: Trial) -> Ended:
    """Make /dev/shm smaller than what one process takes of it."""
    trial.mount(SHARED_MEMORY, size=f"{trial.random.randint(32, 2000)}k")
    return run(trial)


def fixed_shared_memory(trial: Trial) -> Ended:
    """Make /dev/shm read-only."""
    trial.mount(SHARED_MEMORY, read_only=True)
    return run(trial)


# The surroundings


def bare_environment(trial: Trial) -> Ended:
    """Run with next to no environment variables, as a service or a cron job does."""
    keep = ("PATH", "PYTHONPATH", "SMS_HANDOVER_FAULT")
    return run(trial, prefix=("env", "-i", *(f"{name}={os.environ[name]}" for name in keep)))


_SAME = "exit code 0; every bit as in one process, nothing is lost"
_OR_WORDS = (
    "it works, or ends with a code that tells failure and one line that names who; what came is in the bag"
)
_Inject = Callable[[Trial], Ended]


def _prefixed(*prefix: str) -> _Inject:
    """Return how a run is started behind a prefix."""
    return partial(run, prefix=prefix)


FAULTS = (
    Fault("cores-loaded", "every core is busy with something else", _SAME, loaded, same_bits),
    Fault("one-core", "all processes share one core", _SAME, _prefixed("taskset", "-c", "0"), same_bits),
    Fault("nice-19", "everything runs at nice 19", _SAME, _prefixed("nice", "-n", "19"), same_bits),
    Fault(
        "loaded-in-real-time",
        "every core is busy with something else, in real time",
        "exit code 0; late ticks and held commands are counted and said, nothing is lost",
        lambda trial: loaded(trial, "--real-time"),
        counts_what_is_late,
    ),
    Fault(
        "little-memory",
        "the run may use 150 to 350 MiB (control group): the system kills who asks for more",
        _OR_WORDS,
        little_memory,
        works_or_says_why,
        seeded=True,
    ),
    Fault(
        "little-address-space",
        "each process may map 300 to 900 MiB (RLIMIT_AS): allocations fail",
        _OR_WORDS,
        little_address_space,
        works_or_says_why,
        seeded=True,
    ),
    Fault(
        "few-descriptors",
        "each process may open 10 to 40 files (RLIMIT_NOFILE)",
        _OR_WORDS,
        few_descriptors,
        works_or_says_why,
        seeded=True,
    ),
    Fault(
        "few-processes",
        "4 to 40 processes and threads may be there (control group)",
        _OR_WORDS,
        few_processes,
        works_or_says_why,
        seeded=True,
    ),
    Fault(
        "shared-memory-full",
        "/dev/shm is full to the last page",
        "exit code 1 and one line: ROS cannot be started",
        full_shared_memory,
        lambda trial, ended: refused(ended, "/dev/shm is full", code=1),
    ),
    Fault(
        "shared-memory-small",
        "/dev/shm has 32 to 2000 KiB",
        _SAME,
        small_shared_memory,
        same_bits,
        seeded=True,
    ),
    Fault("shared-memory-fixed", "/dev/shm is read-only", _SAME, fixed_shared_memory, same_bits),
    Fault(
        "bare-environment",
        "no environment variables but PATH, as for a service",
        _SAME,
        bare_environment,
        same_bits,
    ),
)
