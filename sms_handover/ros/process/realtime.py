"""Realtime settings of a node's process: processor, priority, memory, timers."""

import ctypes
import os
from contextlib import suppress
from pathlib import Path

from sms_handover.errors import ConfigurationError
from sms_handover.simulation.parameters import CommonParameters

_PR_SET_TIMERSLACK = 29  # of prctl(2)
_SLACK_NS = 1  # [ns] by which the kernel may delay a wake-up; its default of 50 us is seen in every period
_MCL_CURRENT, _MCL_FUTURE = 1, 2  # of mlockall(2)
_ANY_CPU = -1
_AUTOGROUP = Path("/proc/self/autogroup")


def settle(common: CommonParameters) -> None:
    """Apply the parameters to this process and all its threads.

    Raises ConfigurationError, which names the remedy, if the system does not permit it.
    """
    exact_timers()
    if common.cpu != _ANY_CPU:
        _stay_on(common.cpu)
    if common.priority:
        _run_first(common.priority)
    if common.lock_memory:
        _stay_in_memory()


def exact_timers() -> None:
    """Let sleeps of this thread end on time; where the system cannot, they end a little later."""
    libc = ctypes.CDLL(None, use_errno=True)
    if hasattr(libc, "prctl"):
        libc.prctl(_PR_SET_TIMERSLACK, _SLACK_NS, 0, 0, 0)


def stand_back(niceness: int) -> None:
    """Let others of the same priority go first, as nice(1) does: for all threads, as each has a niceness.

    Where Linux weighs sessions against each other (autogroup, sched(7)) a niceness counts within
    its session only; so a process that is a session of its own says it for that too.
    """
    for thread in _threads() if niceness else ():
        with suppress(OSError):  # it has ended
            os.setpriority(os.PRIO_PROCESS, thread, os.getpriority(os.PRIO_PROCESS, thread) + niceness)
    if niceness and os.getsid(0) == os.getpid():
        with suppress(OSError):  # there are no autogroups, or somebody has set one within the last 0.1 s
            _AUTOGROUP.write_text(str(niceness))


def _stay_on(cpu: int) -> None:
    try:
        for thread in _threads():
            os.sched_setaffinity(thread, {cpu})
    except OSError as error:
        allowed = ", ".join(map(str, sorted(os.sched_getaffinity(0))))
        raise ConfigurationError(
            f"parameter 'cpu' is {cpu}, allowed is {_ANY_CPU} for any or one of {allowed}: {error.strerror}"
        ) from error


def _run_first(priority: int) -> None:
    try:
        for thread in _threads():
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        raise ConfigurationError(
            f"parameter 'priority' is {priority}, but SCHED_FIFO is not permitted here: {error.strerror}; "
            "allow it to the user with 'rtprio' in /etc/security/limits.conf, or set priority to 0"
        ) from error


def _stay_in_memory() -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE):
        raise ConfigurationError(
            f"parameter 'lock_memory' is true, but it is not permitted here: "
            f"{os.strerror(ctypes.get_errno())}; allow it to the user with 'memlock' in "
            "/etc/security/limits.conf, or set lock_memory to false"
        )


def _threads() -> list[int]:
    """Return the threads of this process, those of the middleware among them."""
    return [int(entry.name) for entry in Path("/proc/self/task").iterdir()]
