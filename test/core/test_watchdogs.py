"""Inputs that stop coming are reported once with their age; without commands the torque is ramped to zero."""

import numpy as np
import pytest

from sms_handover.graph.events import (
    COMMAND_BACK,
    COMMAND_LOST,
    NO_ANSWER,
    REFERENCE_BACK,
    REFERENCE_LOST,
    TORQUE_ZERO,
    RunEvent,
    Severity,
)
from sms_handover.nodes.parts.watchdogs import AnswerWatchdog, CommandWatchdog, ReferenceWatchdog
from sms_handover.simulation.scenario import load_parameters
from sms_handover.types import JointCommand

_MS = 1_000_000  # ns
TORQUE = np.array([2.0, -1.0, 0.5])  # N m
ANSWERED_NS = 300 * _MS  # the state that the last command answers


def watch_of(hold: float, ramp: float) -> CommandWatchdog:
    values = {"plant": {"command_hold": hold, "command_ramp": ramp}}
    return CommandWatchdog(load_parameters(values).plant)


@pytest.fixture
def watch() -> CommandWatchdog:
    """A watch that holds for 100 ms and ramps over 500 ms."""
    return watch_of(0.1, 0.5)


@pytest.mark.parametrize(
    ("age_ms", "share"),
    [(0, 1.0), (1, 1.0), (100, 1.0), (101, 0.998), (350, 0.5), (599, 0.002), (600, 0.0), (9000, 0.0)],
)
def test_the_ramp_is_the_closed_form(watch: CommandWatchdog, age_ms: int, share: float) -> None:
    """1 up to the hold, then 1 - (age - hold) / ramp, then 0."""
    applied, _ = watch.poll(JointCommand(ANSWERED_NS, TORQUE), ANSWERED_NS + age_ms * _MS)
    np.testing.assert_allclose(applied.effort, share * TORQUE, rtol=1e-12)


def test_a_command_in_time_keeps_its_bits(watch: CommandWatchdog) -> None:
    command = JointCommand(ANSWERED_NS, TORQUE)
    applied, event = watch.poll(command, ANSWERED_NS + 100 * _MS)
    assert applied is command and event is None


def test_the_torque_never_grows_and_never_jumps(watch: CommandWatchdog) -> None:
    """Tick by tick from the last command on: each step is at most a tick's share of the ramp."""
    command = JointCommand(0, TORQUE)
    shares = [watch.poll(command, k * _MS)[0].effort[0] / TORQUE[0] for k in range(1000)]
    steps = -np.diff(shares)
    assert steps.min() >= 0.0
    assert steps.max() <= 1.0 / 500 + 1e-12
    assert sum(shares) == pytest.approx(101 + 249.5)  # held for 0..100 ms, then the mean of the ramp


def test_each_change_is_told_once(watch: CommandWatchdog) -> None:
    told = [watch.poll(JointCommand(0, TORQUE), k * _MS)[1] for k in range(800)]
    told.append(watch.poll(JointCommand(800 * _MS, TORQUE), 800 * _MS)[1])
    told.append(watch.poll(JointCommand(801 * _MS, TORQUE), 801 * _MS)[1])
    events = [event for event in told if event]
    assert [(e.kind, e.stamp_ns // _MS, e.severity) for e in events] == [
        (COMMAND_LOST, 101, Severity.WARNING),
        (TORQUE_ZERO, 600, Severity.ERROR),
        (COMMAND_BACK, 800, Severity.INFO),
    ]
    assert [(e.value, e.limit, e.unit) for e in events] == [
        (0.101, 0.1, "s"),
        (0.6, 0.1, "s"),
        (0.799, 0.1, "s"),  # how old the last command had become
    ]


def test_a_command_ends_the_ramp_at_once(watch: CommandWatchdog) -> None:
    watch.poll(JointCommand(0, TORQUE), 400 * _MS)
    newer = JointCommand(390 * _MS, 2.0 * TORQUE)
    applied, event = watch.poll(newer, 401 * _MS)
    assert applied is newer
    assert event is not None and event.kind == COMMAND_BACK


def test_commands_that_come_but_too_late_are_ramped_too(watch: CommandWatchdog) -> None:
    """Each one answers the state of 200 ms ago: the share stays where that age puts it."""
    for k in range(200, 210):
        applied, _ = watch.poll(JointCommand((k - 200) * _MS, TORQUE), k * _MS)
        np.testing.assert_allclose(applied.effort, 0.8 * TORQUE, rtol=1e-12)


def test_without_hold_and_ramp_a_late_command_is_none() -> None:
    """The only command applied is the one that answers this very state."""
    watch = watch_of(0.0, 0.0)
    assert watch.poll(JointCommand(5, TORQUE), 5)[0].effort.tolist() == TORQUE.tolist()
    applied, event = watch.poll(JointCommand(5, TORQUE), 5 + _MS)
    assert not np.any(applied.effort)
    assert event is not None and event.kind == TORQUE_ZERO


def test_reset_begins_with_a_command_in_time(watch: CommandWatchdog) -> None:
    watch.poll(JointCommand(0, TORQUE), 900 * _MS)
    watch.reset()
    assert watch.poll(JointCommand(0, TORQUE), 0)[1] is None


# References and answers


def reported(event: RunEvent | None) -> tuple[str, float, float] | None:
    return None if event is None else (event.kind, event.value, event.limit)


def test_a_reference_that_is_overdue_is_reported_once_and_its_return_too() -> None:
    watch = ReferenceWatchdog(120 * _MS)
    looks = [(0, 0), (0, 120), (0, 121), (0, 500), (500, 501), (500, 620)]
    assert [reported(watch.poll(last * _MS, now * _MS)) for last, now in looks] == [
        None,
        None,
        (REFERENCE_LOST, 0.121, 0.12),
        None,
        (REFERENCE_BACK, 0.5, 0.12),
        None,
    ]
    watch.poll(500 * _MS, 900 * _MS)
    watch.reset()
    assert watch.poll(0, 0) is None


def answer_watchdog(timeout: float) -> AnswerWatchdog:
    return AnswerWatchdog(load_parameters({"plant": {"answer_timeout": timeout}}).plant)


def test_a_state_without_an_answer_is_reported_when_the_time_is_over() -> None:
    watch = answer_watchdog(20.0)
    assert watch.poll(3000, "joint_command", 100.0) is None
    assert watch.poll(3000, "joint_command", 119.5) is None
    event = watch.poll(3000, "joint_command", 120.5)
    assert reported(event) == (NO_ANSWER, 20.5, 20.0)
    assert event is not None and "joint_command" in event.detail


def test_a_loop_that_goes_on_or_is_paused_is_never_late() -> None:
    watch = answer_watchdog(1.0)
    assert [watch.poll(k, "x", 0.9 * k) for k in range(5)] == [None] * 5
    assert [watch.poll(None, "x", 10.0 + k) for k in range(5)] == [None] * 5
    assert watch.poll(4, "x", 20.0) is None  # it goes on where it was: the pause does not count
    assert reported(watch.poll(4, "x", 21.0)) == (NO_ANSWER, 1.0, 1.0)


def test_a_timeout_of_zero_waits_for_ever() -> None:
    watch = answer_watchdog(0.0)
    assert [watch.poll(0, "x", 1e6 * k) for k in range(3)] == [None] * 3
