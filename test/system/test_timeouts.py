"""A launcher waits for its nodes, says for whom, and not for ever; its own absence does not count."""

import os
import signal
import sys
from pathlib import Path

import pytest

from sms_handover.errors import GraphError
from sms_handover.launcher.processes import Death, NodeProcesses
from sms_handover.launcher.timeouts import ActiveTime, SuspensionMonitor, WaitNotice


def test_time_in_which_nobody_looked_does_not_count() -> None:
    now = [100.0]
    time = ActiveTime(lambda: now[0])
    for _ in range(10):
        now[0] += 0.25
        time.update()
    assert time.seconds == 2.5
    now[0] += 3600.0  # suspended by Ctrl-Z for an hour
    time.update()
    assert 2.5 < time.seconds <= 3.5


def test_what_a_run_waits_for_is_told_after_a_while_and_when_it_changes() -> None:
    delay = WaitNotice()
    reasons = ["plant is waiting for a"] * 25 + ["ik is waiting for b"] * 15
    told = {second: lines for second, why in enumerate(reasons) if (lines := delay.poll(float(second), why))}
    assert told == {
        10: ["the run has not begun after 10 s: plant is waiting for a"],
        25: ["the run has not begun after 25 s: ik is waiting for b"],
    }


def test_a_suspended_node_is_reported_once_and_then_given_up() -> None:
    suspended = SuspensionMonitor()
    for second in range(20):
        lines = suspended.poll({"ik": 4711}, 7.0 + second)
        assert ("kill -CONT 4711" in "".join(lines)) == (second == 6)
    with pytest.raises(GraphError, match="'ik' has been suspended for 20 s"):
        suspended.poll({"ik": 4711}, 27.5)


def test_a_node_that_goes_on_is_forgiven() -> None:
    suspended = SuspensionMonitor()
    for second in range(100):
        suspended.poll({"ik": 4711} if second % 10 else {}, float(second))


def test_a_process_is_seen_suspended_as_long_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrapper = tmp_path / "sleep"
    wrapper.write_text("#!/bin/sh\nexec sleep 60\n", encoding="ascii")
    wrapper.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(wrapper))
    with NodeProcesses(tmp_path, {}) as processes:
        processes.start("plant", ())
        pid = processes.ids["plant"]
        assert processes.suspended() == {}
        os.kill(pid, signal.SIGSTOP)
        os.waitid(os.P_PID, pid, os.WSTOPPED | os.WNOWAIT)
        assert processes.suspended() == processes.suspended() == {"plant": pid}
        os.kill(pid, signal.SIGCONT)
        os.waitid(os.P_PID, pid, os.WCONTINUED | os.WNOWAIT)
        assert processes.suspended() == {}
        os.kill(pid, signal.SIGSTOP)
        processes.end()  # it is woken, or it would be killed 20 s later
        assert processes.exit_code("plant") == -signal.SIGTERM
        assert processes.suspended() == {}


@pytest.mark.parametrize(
    ("code", "how"),
    [
        (2, "ended with exit code 2"),
        (-9, "was killed by signal 9 (SIGKILL)"),
        (-64, "was killed by signal 64 (SIGRTMAX)"),
        (-40, "was killed by signal 40 (a real-time signal)"),
    ],
)
def test_how_a_process_died_is_told_in_words(code: int, how: str) -> None:
    assert Death("ik", code, "").how == how
