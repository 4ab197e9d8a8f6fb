"""Without commands the plant holds the last one, ramps it to zero, and tells each change."""

import numpy as np
import pytest

from sms_handover.graph.events import COMMAND_BACK, COMMAND_LOST, TORQUE_ZERO, Severity
from sms_handover.nodes.parts.command_watch import CommandWatch
from sms_handover.simulation.scenario import load_parameters
from sms_handover.types import JointCommand

_MS = 1_000_000  # ns
TORQUE = np.array([2.0, -1.0, 0.5])  # N m
ANSWERED_NS = 300 * _MS  # the state that the last command answers


def watch_of(hold: float, ramp: float) -> CommandWatch:
    values = {"plant": {"command_hold": hold, "command_ramp": ramp}}
    return CommandWatch(load_parameters(values).plant)


@pytest.fixture
def watch() -> CommandWatch:
    """A watch that holds for 100 ms and ramps over 500 ms."""
    return watch_of(0.1, 0.5)


@pytest.mark.parametrize(
    ("age_ms", "share"),
    [(0, 1.0), (1, 1.0), (100, 1.0), (101, 0.998), (350, 0.5), (599, 0.002), (600, 0.0), (9000, 0.0)],
)
def test_the_ramp_is_the_closed_form(watch: CommandWatch, age_ms: int, share: float) -> None:
    """1 up to the hold, then 1 - (age - hold) / ramp, then 0."""
    applied, _ = watch.look(JointCommand(ANSWERED_NS, TORQUE), ANSWERED_NS + age_ms * _MS)
    np.testing.assert_allclose(applied.effort, share * TORQUE, rtol=1e-12)


def test_a_command_in_time_keeps_its_bits(watch: CommandWatch) -> None:
    command = JointCommand(ANSWERED_NS, TORQUE)
    applied, event = watch.look(command, ANSWERED_NS + 100 * _MS)
    assert applied is command and event is None


def test_the_torque_never_grows_and_never_jumps(watch: CommandWatch) -> None:
    """Tick by tick from the last command on: each step is at most a tick's share of the ramp."""
    command = JointCommand(0, TORQUE)
    shares = [watch.look(command, k * _MS)[0].effort[0] / TORQUE[0] for k in range(1000)]
    steps = -np.diff(shares)
    assert steps.min() >= 0.0
    assert steps.max() <= 1.0 / 500 + 1e-12
    assert sum(shares) == pytest.approx(101 + 249.5)  # held for 0..100 ms, then the mean of the ramp


def test_each_change_is_told_once(watch: CommandWatch) -> None:
    told = [watch.look(JointCommand(0, TORQUE), k * _MS)[1] for k in range(800)]
    told.append(watch.look(JointCommand(800 * _MS, TORQUE), 800 * _MS)[1])
    told.append(watch.look(JointCommand(801 * _MS, TORQUE), 801 * _MS)[1])
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


def test_a_command_ends_the_ramp_at_once(watch: CommandWatch) -> None:
    watch.look(JointCommand(0, TORQUE), 400 * _MS)
    newer = JointCommand(390 * _MS, 2.0 * TORQUE)
    applied, event = watch.look(newer, 401 * _MS)
    assert applied is newer
    assert event is not None and event.kind == COMMAND_BACK


def test_commands_that_come_but_too_late_are_ramped_too(watch: CommandWatch) -> None:
    """Each one answers the state of 200 ms ago: the share stays where that age puts it."""
    for k in range(200, 210):
        applied, _ = watch.look(JointCommand((k - 200) * _MS, TORQUE), k * _MS)
        np.testing.assert_allclose(applied.effort, 0.8 * TORQUE, rtol=1e-12)


def test_without_hold_and_ramp_a_late_command_is_none() -> None:
    """The only command applied is the one that answers this very state."""
    watch = watch_of(0.0, 0.0)
    assert watch.look(JointCommand(5, TORQUE), 5)[0].effort.tolist() == TORQUE.tolist()
    applied, event = watch.look(JointCommand(5, TORQUE), 5 + _MS)
    assert not np.any(applied.effort)
    assert event is not None and event.kind == TORQUE_ZERO


def test_reset_begins_with_a_command_in_time(watch: CommandWatch) -> None:
    watch.look(JointCommand(0, TORQUE), 900 * _MS)
    watch.reset()
    assert watch.look(JointCommand(0, TORQUE), 0)[1] is None
