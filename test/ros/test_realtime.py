"""A process is set up as asked, or the refusal names the parameter, the value and the remedy."""

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import pytest

from sms_handover.errors import ConfigurationError
from sms_handover.ros.process.realtime import settle
from sms_handover.simulation.parameters import CommonParameters
from sms_handover.simulation.scenario import load_scenario

_SHOW = """
import os, threading
from sms_handover.ros.process.realtime import settle
from sms_handover.simulation.scenario import load_scenario
event = threading.Event()
threading.Thread(target=event.wait).start()
settle(load_scenario(values={{"common": {values}}}).parameters.common)
threads = [int(name) for name in os.listdir("/proc/self/task")]
print(len(threads) > 1, {{cpu for thread in threads for cpu in os.sched_getaffinity(thread)}})
event.set()
"""

_STAND_BACK = """
import os, threading
from sms_handover.ros.process.realtime import stand_back
event = threading.Event()
threading.Thread(target=event.wait).start()
begin = os.getpriority(os.PRIO_PROCESS, 0)
stand_back(2)
threads = [int(name) for name in os.listdir("/proc/self/task")]
group = "/proc/self/autogroup"
nice = int(open(group).read().split()[-1]) if os.path.exists(group) else 2
print(len(threads) > 1, {os.getpriority(os.PRIO_PROCESS, thread) - begin for thread in threads}, nice)
event.set()
"""


def common(**values: object) -> CommonParameters:
    return load_scenario(values={"common": values}).parameters.common


def test_every_thread_stays_on_the_processor() -> None:
    cpu = max(os.sched_getaffinity(0))
    code = _SHOW.format(values={"cpu": cpu})
    shown = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert shown.split(maxsplit=1) == ["True", f"{{{cpu}}}\n"]


def test_every_thread_stands_back() -> None:
    """Behind other sessions too if it is one of its own; who shares its session does not stand back."""
    command = [sys.executable, "-c", _STAND_BACK]
    shown = subprocess.run(command, check=True, capture_output=True, text=True, start_new_session=True)
    assert shown.stdout == "True {2} 2\n"
    before = Path("/proc/self/autogroup").read_text() if Path("/proc/self/autogroup").exists() else ""
    shown = subprocess.run(command, check=True, capture_output=True, text=True)
    assert shown.stdout.startswith("True {2}")
    assert not before or Path("/proc/self/autogroup").read_text() == before


def test_nothing_is_asked_for_by_default() -> None:
    before = (os.sched_getaffinity(0), os.sched_getscheduler(0))
    settle(common())
    assert (os.sched_getaffinity(0), os.sched_getscheduler(0)) == before


def test_a_processor_that_is_not_there_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"'cpu' is 4095, allowed is -1 for any or one of \d"):
        settle(common(cpu=4095))


def test_a_priority_that_is_not_permitted_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with pytest.raises(ConfigurationError, match=r"'priority' is 50.*Operation not permitted.*limits.conf"):
        settle(common(priority=50))


def test_memory_that_may_not_be_locked_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    class Libc:
        """Permits nothing."""

        def mlockall(self, flags: int) -> int:
            return -1

    monkeypatch.setattr(ctypes, "CDLL", lambda *arguments, **options: Libc())
    with pytest.raises(ConfigurationError, match=r"'lock_memory' is true.*limits.conf"):
        settle(common(lock_memory=True))
