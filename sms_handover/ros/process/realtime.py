"""What the operating system is told about a node's process: processor, priority, memory, timers."""

import ctypes
import os
from pathlib import Path

from sms_handover.errors import ConfigurationError
from sms_handover.simulation.parameters import CommonParameters

_PR_SET_TIMERSLACK = 29  # of prctl(2)
_SLACK_NS = 1  # [ns] by which the kernel may put off a wake-up; its default of 50 us is seen in every period
_MCL_CURRENT, _MCL_FUTURE = 1, 2  # of mlockall(2)
_ANY_CPU = -1


def settle(common: CommonParameters) -> None:
    """Set up this process and all its threads as the parameters ask.

    Raises ConfigurationError, in words that name the remedy, where the system does not permit it.
    """
    exact_timers()
    if common.cpu != _ANY_CPU:
        _stay_on(common.cpu)
    if common.priority:
        _run_first(common.priority)
    if common.lock_memory:
        _stay_in_memory()


def exact_timers() -> None:
    """Let sleeps of this thread end when they are due; where the system cannot, they end a little later."""
    libc = ctypes.CDLL(None, use_errno=True)
    if hasattr(libc, "prctl"):
        libc.prctl(_PR_SET_TIMERSLACK, _SLACK_NS, 0, 0, 0)


def _stay_on(cpu: int) -> None:
    """Run on one processor only."""
    try:
        for thread in _threads():
            os.sched_setaffinity(thread, {cpu})
    except OSError as error:
        allowed = ", ".join(map(str, sorted(os.sched_getaffinity(0))))
        raise ConfigurationError(
            f"parameter 'cpu' is {cpu}, allowed is {_ANY_CPU} for any or one of {allowed}: {error.strerror}"
        ) from error


def _run_first(priority: int) -> None:
    """Run before everything that has no real-time priority."""
    try:
        for thread in _threads():
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        raise ConfigurationError(
            f"parameter 'priority' is {priority}, but SCHED_FIFO is not permitted here: {error.strerror}; "
            "allow it to the user with 'rtprio' in /etc/security/limits.conf, or set priority to 0"
        ) from error


def _stay_in_memory() -> None:
    """Let no page of this process be swapped out."""
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
