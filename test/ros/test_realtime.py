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
threading.Thread(target=event.wait, daemon=True).start()
settle(load_scenario(values={{"common": {values}}}).parameters.common)
threads = [int(name) for name in os.listdir("/proc/self/task")]
print(len(threads) > 1, {{cpu for thread in threads for cpu in os.sched_getaffinity(thread)}})
"""

_STAND_BACK = """
import os, threading
from sms_handover.ros.process.realtime import stand_back
event = threading.Event()
threading.Thread(target=event.wait, daemon=True).start()
begin = os.getpriority(os.PRIO_PROCESS, 0)
stand_back(2)
threads = [int(name) for name in os.listdir("/proc/self/task")]
print(len(threads) > 1, {os.getpriority(os.PRIO_PROCESS, thread) - begin for thread in threads})
print(open("/proc/self/autogroup").read() if os.path.exists("/proc/self/autogroup") else "", end="")
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

    def shown(own_session: bool) -> tuple[str, str]:
        command = [sys.executable, "-c", _STAND_BACK]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, start_new_session=own_session)
        threads, _, group = done.stdout.decode().partition("\n")
        return threads, group

    threads, group = shown(own_session=True)
    assert threads == "True {2}"
    assert not group or group.endswith(" nice 2\n")  # empty where Linux does not weigh sessions
    here = Path("/proc/self/autogroup")
    before = here.read_text() if here.exists() else ""  # empty where the session is that of no setsid(2)
    assert shown(own_session=False) == ("True {2}", before)
    assert not here.exists() or here.read_text() == before


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
