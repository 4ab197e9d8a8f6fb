"""Processes of campaigns that end badly: whatever they have started ends with them, and nothing is left."""

import json
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from sms_handover.campaign.cases.case_process import CaseProcess
from sms_handover.campaign.cases.case_row import Row, Status, Task
from sms_handover.campaign.definition.campaign_file import Limits
from sms_handover.campaign.definition.frozen import Frozen
from sms_handover.errors import SmsHandoverError

from .campaigns import STUB

TASK = Task(0, "smooth", "nmpc")
FROZEN = Frozen({"campaign.yaml": "name: tiny"})
READY = """read -r campaign; echo '{"ready": 0}'; read -r task; """
PATIENCE_S = 60.0


def shell(script: str, *words: str) -> tuple[str, ...]:
    """Return a process for cases that does something bad when it gets its first task."""
    return ("/bin/sh", "-c", READY + script, "sh", *words)


def ended(pid_file: Path) -> bool:
    """Whether the process that wrote its id to a file has ended."""
    pid = int(pid_file.read_text())
    return not psutil.pid_exists(pid) or psutil.Process(pid).status() == psutil.STATUS_ZOMBIE


@pytest.mark.parametrize("group", ["its", "another"])
def test_what_a_case_has_started_ends_with_it(group: str, tmp_path: Path) -> None:
    """It keeps the output open, so that the end of the case is not that of its output."""
    pid = tmp_path / "pid"
    source = (
        f"import os, time; os.setpgid(0, {'os.getpgrp()' if group == 'its' else '0'}); "
        f"open({str(pid)!r}, 'w').write(str(os.getpid())); time.sleep({PATIENCE_S})"
    )
    script = f'"$@" & until [ -s "{pid}" ]; do sleep 0.02; done; kill -9 $$'
    limits, program = Limits(wall_time=PATIENCE_S / 2, retries=0), (sys.executable, "-S", "-c", source)
    row = CaseProcess(FROZEN, 1, 3, limits, shell(script, *program)).run(TASK).row
    assert (row.status, row.cause) == (Status.DIED, "its process ended by signal SIGKILL")
    assert ended(pid)


@pytest.mark.parametrize(("shared", "status"), [(False, Status.LIMIT), (True, Status.DIED)])
def test_memory_is_that_of_all_that_a_case_has_started(shared: bool, status: Status, tmp_path: Path) -> None:
    """Pages that forks share count once."""
    pid = tmp_path / "pid"
    source = (
        "import os, time\n"
        f"data = b'x' * 60_000_000 if {shared} else b''\n"
        "for _ in range(2):\n"
        "    if not os.fork():\n"
        f"        open({str(pid)!r}, 'w').write(str(os.getpid()))\n"
        f"        data = data or b'x' * 60_000_000\n"
        f"        time.sleep({PATIENCE_S})\n"
        "time.sleep(0.5)\n"
    )
    limits = Limits(wall_time=PATIENCE_S, memory=100.0, retries=0)
    program = shell('"$@"', sys.executable, "-S", "-c", source)
    row = CaseProcess(FROZEN, 1, 3, limits, program).run(TASK).row
    assert row.status is status and ended(pid)


def test_a_process_that_python_cannot_end_ends_with_its_driver(tmp_path: Path) -> None:
    """It is in a library that holds the lock of Python's interpreter; its folder goes too."""
    pid, scratch = tmp_path / "pid", tmp_path / "scratch"
    scratch.mkdir()
    holds = (
        "import ctypes, os, sys; sys.stdin.readline(); print('{\"ready\": 0}', flush=True); "
        f"sys.stdin.readline(); open({str(pid)!r}, 'w').write(str(os.getpid())); ctypes.PyDLL(None).pause()"
    )
    drives = (
        "import sys, tempfile\n"
        "from sms_handover.campaign.cases.case_process import CaseProcess, Limits, Frozen, Task\n"
        f"tempfile.tempdir = {str(scratch)!r}\n"
        f"program = (sys.executable, '-S', '-c', {holds!r})\n"
        "CaseProcess(Frozen({}), 1, 3, Limits(), program).run(Task(0, 'smooth', 'nmpc'))\n"
    )
    driver = subprocess.Popen([sys.executable, "-c", drives])
    latest = time.monotonic() + PATIENCE_S
    while not (pid.exists() and pid.read_text()) and time.monotonic() < latest:
        time.sleep(0.02)
    assert len(list(scratch.iterdir())) == 1 and not ended(pid)
    driver.kill()
    driver.wait()
    while not (ended(pid) and not list(scratch.iterdir())) and time.monotonic() < latest:
        time.sleep(0.02)
    assert ended(pid) and not list(scratch.iterdir())


def test_a_process_that_does_not_end_when_asked_is_killed_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """An interrupt waits for it, and has five seconds."""
    waited: list[float] = []
    wait = subprocess.Popen.wait

    def waiting(child: "subprocess.Popen[bytes]", timeout: float | None = None) -> int:
        waited.append(timeout or 0.0)
        return wait(child, timeout)

    row = Row(TASK, 0, {}, Status.ERROR, "", {}, "")
    answer = json.dumps({"row": row.text, "beside": {"cpu": 0.0, "wall": 0.0, "host": ""}})
    process = CaseProcess(FROZEN, 1, 3, Limits(), shell(f'echo "$1"; exec sleep {PATIENCE_S}', answer))
    assert process.run(TASK).row.status is Status.ERROR
    monkeypatch.setattr(subprocess.Popen, "wait", waiting)
    begin = time.monotonic()
    process.close()
    assert max(waited) <= 1.0 and time.monotonic() - begin < PATIENCE_S / 2


@pytest.mark.parametrize("guard", [True, False])
def test_a_program_that_is_not_there_leaves_nothing(
    guard: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor does a process whose guard cannot be started."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    program = STUB if guard else ("/nowhere/python",)
    if guard:

        def without(*_: object) -> None:
            raise FileNotFoundError("[Errno 2] No such file or directory: '/bin/sh'")

        monkeypatch.setattr("sms_handover.campaign.cases.case_process.CaseGuard", without)
    with pytest.raises(SmsHandoverError, match=r"a process for cases cannot start: .*No such file"):
        CaseProcess(FROZEN, 1, 3, Limits(), program).run(TASK)
    assert not list(tmp_path.iterdir())
