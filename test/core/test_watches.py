"""References and answers that stop coming are told once, with for how long."""

from sms_handover.graph.events import NO_ANSWER, REFERENCE_BACK, REFERENCE_LOST, RunEvent
from sms_handover.nodes.parts.answer_watch import AnswerWatch
from sms_handover.nodes.parts.reference_watch import ReferenceWatch
from sms_handover.simulation.scenario import load_parameters

_MS = 1_000_000  # ns


def told(event: RunEvent | None) -> tuple[str, float, float] | None:
    return None if event is None else (event.kind, event.value, event.limit)


def test_a_reference_that_is_overdue_is_told_once_and_its_return_too() -> None:
    watch = ReferenceWatch(120 * _MS)
    looks = [(0, 0), (0, 120), (0, 121), (0, 500), (500, 501), (500, 620)]
    assert [told(watch.look(last * _MS, now * _MS)) for last, now in looks] == [
        None,
        None,
        (REFERENCE_LOST, 0.121, 0.12),
        None,
        (REFERENCE_BACK, 0.5, 0.12),
        None,
    ]
    watch.look(500 * _MS, 900 * _MS)
    watch.reset()
    assert watch.look(0, 0) is None


def answer_watch(timeout: float) -> AnswerWatch:
    return AnswerWatch(load_parameters({"plant": {"answer_timeout": timeout}}).plant)


def test_a_state_without_an_answer_is_told_when_the_time_is_over() -> None:
    watch = answer_watch(20.0)
    assert watch.look(3000, "joint_command", 100.0) is None
    assert watch.look(3000, "joint_command", 119.5) is None
    event = watch.look(3000, "joint_command", 120.5)
    assert told(event) == (NO_ANSWER, 20.5, 20.0)
    assert event is not None and "joint_command" in event.detail


def test_a_loop_that_goes_on_or_is_paused_is_never_late() -> None:
    watch = answer_watch(1.0)
    assert [watch.look(k, "x", 0.9 * k) for k in range(5)] == [None] * 5
    assert [watch.look(None, "x", 10.0 + k) for k in range(5)] == [None] * 5
    assert watch.look(4, "x", 20.0) is None  # it goes on where it was: the pause does not count
    assert told(watch.look(4, "x", 21.0)) == (NO_ANSWER, 1.0, 1.0)


def test_a_timeout_of_zero_waits_for_ever() -> None:
    watch = answer_watch(0.0)
    assert [watch.look(0, "x", 1e6 * k) for k in range(3)] == [None] * 3
