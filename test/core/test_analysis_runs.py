"""Made-up runs whose metrics are known in closed form, and tests of how they fall into phases."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from math import sqrt
from typing import Any

import numpy as np
import pytest

from sms_handover.analysis.phases import phase_spans
from sms_handover.run_data import RunData
from sms_handover.types import Array, GraspAction, GraspCommand, GraspEvent, GraspStatus, TaskPhase

ARMS = ("arm_a", "arm_b")
JOINTS = tuple(f"{arm}_joint_{number}" for arm in ARMS for number in (1, 2))
PHASES = (("approach", 0.0), ("carry", 20.0), ("withdraw", 40.0))
TICK_NS = 10_000_000
REFERENCE_NS = 20_000_000
NS = 1_000_000_000

Path = Callable[[Array], Array]  # from times (R,) s to positions (R, 3) m


def still(place: Sequence[float] = (0.0, 0.0, 0.0)) -> Path:
    return lambda t: np.tile(np.array(place, dtype=np.float64), (len(t), 1))


def line(along: Callable[[Array], Array], direction: Sequence[float] = (1.0, 0.0, 0.0)) -> Path:
    unit = np.array(direction) / np.linalg.norm(direction)
    return lambda t: np.asarray(along(t))[:, np.newaxis] * unit


def second_order(length: float, damping: float, frequency: float) -> Callable[[Array], Array]:
    """Return the step response of x'' + 2 zeta w x' + w^2 x = w^2 L, from rest at zero."""
    damped = frequency * sqrt(1.0 - damping**2)

    def response(t: Array) -> Array:
        swing = np.cos(damped * t) + damping / sqrt(1.0 - damping**2) * np.sin(damped * t)
        return np.asarray(length * (1.0 - np.exp(-damping * frequency * t) * swing))

    return response


def turns(angle: Array, axis: Sequence[float] = (0.0, 0.0, 1.0)) -> Array:
    """Return the quaternions (R, 4) x y z w of turns about an axis."""
    unit = np.array(axis) / np.linalg.norm(axis)
    return np.column_stack([np.sin(angle / 2)[:, np.newaxis] * unit, np.cos(angle / 2)])


def poses(positions: Array, quaternions: Array | None = None) -> Array:
    if quaternions is None:
        quaternions = turns(np.zeros(len(positions)))
    return np.column_stack([positions, quaternions])


def grasp(
    time: float,
    action: GraspAction = GraspAction.GRASP,
    arm: str = "arm_a",
    from_arm: str = "",
    status: GraspStatus = GraspStatus.SUCCEEDED,
) -> GraspEvent:
    command = GraspCommand(action, arm, "end", from_arm)
    return GraspEvent(round(time * NS), command, status, 0.004, 0.01, 0.002, "as planned")


def make_run(
    *,
    end: float = 60.0,
    phases: Sequence[tuple[str, float]] = PHASES,
    tool: Mapping[str, Path] | None = None,
    target: Mapping[str, Path] | None = None,
    events: Sequence[GraspEvent] = (),
    **arrays: Any,
) -> RunData:
    """Return a run that stands still but for what is given; ``arrays`` replace fields of RunData."""
    tick_ns = np.arange(0, round(end * NS) + 1, TICK_NS, dtype=np.int64)
    reference_ns = np.arange(0, round(end * NS) + 1, REFERENCE_NS, dtype=np.int64)
    t = reference_ns / NS
    ticks, periods, n = len(tick_ns), len(reference_ns), len(JOINTS)
    starts = [start for _, start in phases]
    index = np.searchsorted(starts, t, "right") - 1
    values: dict[str, Any] = {
        "joint_names": JOINTS,
        "arms": ARMS,
        "tick_ns": tick_ns,
        "joint_position": np.zeros((ticks, n)),
        "joint_velocity": np.zeros((ticks, n)),
        "joint_effort": np.zeros((ticks, n)),
        "joint_command": np.zeros((ticks, n)),
        "base_pose": poses(np.zeros((ticks, 3))),
        "base_twist": np.zeros((ticks, 6)),
        "reference_ns": reference_ns,
        "reference_position": np.zeros((periods, n)),
        "reference_velocity": np.zeros((periods, n)),
        "target_pose": {arm: poses((target or {}).get(arm, still())(t)) for arm in ARMS},
        "tool_pose": {arm: poses((tool or {}).get(arm, still())(t)) for arm in ARMS},
        "deputy_pose": poses(np.zeros((periods, 3))),
        "deputy_twist": np.zeros((periods, 6)),
        "linear_momentum": np.zeros((periods, 3)),
        "angular_momentum": np.zeros((periods, 3)),
        "kinetic_energy": np.zeros(periods),
        "work": np.zeros(periods),
        "external_work": np.zeros(periods),
        "elastic_energy": np.zeros(periods),
        "panel_position": np.zeros((periods, 0)),
        "panel_velocity": np.zeros((periods, 0)),
        "linear_impulse": np.zeros((periods, 3)),
        "angular_impulse": np.zeros((periods, 3)),
        "lost": np.zeros(periods),
        "ik_status": np.zeros(periods, dtype=np.int64),
        "phases": tuple(
            TaskPhase(int(stamp), int(place), phases[place][0])
            for stamp, place in zip(reference_ns, index, strict=True)
            if place >= 0
        ),
        "grasp_events": tuple(events),
    }
    return RunData(**{**values, **arrays})


def changed(run: RunData, **arrays: Any) -> RunData:
    """Return a run with other arrays in some fields."""
    return RunData(**{**{item.name: getattr(run, item.name) for item in fields(run)}, **arrays})


def test_phases_span_from_start_to_start_and_the_last_to_the_end() -> None:
    spans = phase_spans(make_run())
    assert [(s.index, s.name, s.start_ns // NS, s.end_ns // NS) for s in spans] == [
        (0, "approach", 0, 20),
        (1, "carry", 20, 40),
        (2, "withdraw", 40, 60),
    ]
    assert [s.duration for s in spans] == [20.0, 20.0, 20.0]


def test_rows_belong_to_the_phase_whose_targets_they_have() -> None:
    run = make_run()
    rows = [run.reference_ns[span.rows] for span in phase_spans(run)]
    assert np.array_equal(np.concatenate(rows), run.reference_ns)
    assert rows[0][-1] == 20 * NS - REFERENCE_NS
    assert rows[1][0] == 20 * NS
    assert rows[2][-1] == 60 * NS


def test_states_share_their_ends_and_efforts_do_not() -> None:
    run = make_run()
    first, second, _ = phase_spans(run)
    assert run.tick_ns[first.states][-1] == run.tick_ns[second.states][0] == 20 * NS
    assert run.tick_ns[first.efforts][-1] == 20 * NS
    assert run.tick_ns[second.efforts][0] == 20 * NS + TICK_NS
    assert run.tick_ns[first.efforts][0] == TICK_NS


def test_phases_given_on_change_only_are_the_same() -> None:
    run = make_run()
    on_change = tuple(TaskPhase(round(start * NS), i, name) for i, (name, start) in enumerate(PHASES))
    assert phase_spans(changed(run, phases=on_change)) == phase_spans(run)


def test_a_run_without_phases_has_none() -> None:
    assert phase_spans(make_run(phases=(("late", 100.0),))) == ()


def test_rows_before_the_first_phase_belong_to_none() -> None:
    run = make_run(phases=(("late", 30.0),))
    (span,) = phase_spans(run)
    assert run.reference_ns[span.rows][0] == run.tick_ns[span.states][0] == 30 * NS


@pytest.mark.parametrize("end", [0.0, 20.0, 20.02])
def test_a_run_that_ends_early_has_short_phases(end: float) -> None:
    spans = phase_spans(make_run(end=end))
    assert spans[-1].duration == pytest.approx(end % 20.0)
    assert spans[-1].rows.stop > spans[-1].rows.start
