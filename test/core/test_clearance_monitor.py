"""The clearance monitor of a run as it goes on: it sees what a recording shows, and may fail a task."""

from dataclasses import replace
from itertools import pairwise
from unittest.mock import patch

import pinocchio as pin
import pytest

from sms_handover.analysis.clearance import TaskTexts, run_clearance
from sms_handover.clearance.contacts import CONTACT_DEPTH
from sms_handover.clearance.monitor import PeriodClearance
from sms_handover.errors import CollisionError
from sms_handover.graph.events import COLLISION, RunEvent, Severity
from sms_handover.run_data import RunData
from sms_handover.simulation.dry_run import dry_run
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.recorder import RunRecorder
from sms_handover.simulation.scenario import Scenario, load_parameters
from sms_handover.types import Collision

from .conftest import SCHEDULE, MakeScenario
from .loop_rest import bytes_of

# The deputy is in the way of the arm from the start: the gripper is 4 mm in it, and goes on into it.
DEEP = SCHEDULE.replace("xyz: [1.25, 0.0, 0.75]", "xyz: [1.21, 0.05, 0.73]")
ONLINE = {"clearance": "online"}
ABORT = {"on_collision": "abort"}


def run(scenario: Scenario) -> tuple[RunData, list[PeriodClearance]]:
    """Return a run with the clearance of its periods."""
    loop = Loop(scenario)
    recorder, periods = RunRecorder(scenario.truth.robot.joint_names, scenario.truth.robot.arms, 1), []
    while not loop.finished:
        tick = loop.advance()
        recorder.add(tick)
        if tick.period and tick.period.clearance:
            periods.append(tick.period.clearance)
    return recorder.data(), periods


def collisions_in(data: RunData) -> list[RunEvent]:
    return [event for event in data.run_events if event.kind == COLLISION]


@pytest.fixture
def online(make_scenario: MakeScenario) -> Scenario:
    return make_scenario(DEEP, common=ONLINE, controller={"law": "pid"})


def test_it_sees_what_the_recorded_run_shows(online: Scenario) -> None:
    """The same groups; in each the least of the periods, unless ticks between two of them come nearer."""
    data, periods = run(online)
    after = run_clearance(data, TaskTexts(online.truth.robot.urdf, online.truth.schedule.text))
    least: dict[str, float] = {}
    for item in (item for period in periods for item in period.groups):
        least[item.group] = min(item.distance, least.get(item.group, item.distance))
    assert least.keys() == {group.group for group in after.groups}
    at_periods = [group for group in after.groups if group.stamp_ns in data.reference_ns]
    assert len(at_periods) > 5
    for group in after.groups:
        between = 0.0 if group in at_periods else 0.01  # m
        assert 0.0 <= least[group.group] - group.least <= between
    assert {c.group for p in periods for c in p.collisions} <= {group.group for group in after.collisions}
    assert any(group.collides for group in at_periods)


def test_measuring_changes_no_bit(online: Scenario, make_scenario: MakeScenario) -> None:
    data, _ = run(online)
    without, periods = run(make_scenario(DEEP, controller={"law": "pid"}))
    assert not periods and collisions_in(data) and not collisions_in(without)
    assert data.joint_position.tobytes() == without.joint_position.tobytes()


def test_the_worst_is_first_and_nearest_points_are_its(online: Scenario) -> None:
    _, periods = run(online)
    for period in periods[::10]:
        margins = [item.margin for item in period.groups]
        assert margins == sorted(margins)
        for item in period.groups:
            first, second = item.nearest.points_in_world
            assert (second - first) @ item.nearest.normal_in_world == pytest.approx(item.distance, abs=1e-5)


def test_a_collision_is_reported_once_and_the_task_goes_on(online: Scenario) -> None:
    data, periods = run(online)
    events = collisions_in(data)
    assert {event.severity for event in events} == {Severity.WARNING} and not data.phases[-1].failed
    first = next(period for period in periods if period.collisions)
    (event, *_), (collision, *_) = events, first.collisions
    assert event.detail == str(collision) and event.stamp_ns == first.stamp_ns + 20_000_000  # ns
    assert (event.value, event.limit, event.unit) == (collision.distance, collision.allowed, "m")
    begins = [
        {c.group for c in now.collisions} - {c.group for c in before.collisions}
        for before, now in pairwise(periods[:-1])
    ]
    assert len(events) == len(periods[0].collisions) + sum(map(len, begins))


def test_abort_fails_the_phase_one_period_later(make_scenario: MakeScenario) -> None:
    """As a missed grasp does; the joints are held, and the run ends after the hold."""
    scenario = make_scenario(DEEP, common=ABORT, controller={"law": "pid"}, trajectory={"failure_hold": 0.1})
    data, periods = run(scenario)
    first = next(period for period in periods if period.collisions)
    (event,) = collisions_in(data)
    assert event.severity is Severity.ERROR and event.detail == f"{first.collisions[0]}; the joints are held"
    failed = [phase.stamp_ns for phase in data.phases if phase.failed]
    assert failed[0] == first.stamp_ns + 20_000_000  # ns
    assert data.tick_ns[-1] == failed[0] + 100_000_000  # ns


def test_the_depth_of_a_contact_is_a_parameter(make_scenario: MakeScenario) -> None:
    """Deep enough, the gripper may be where it is."""
    deep = make_scenario(
        DEEP, common={**ABORT, "contact_depth": 0.2, "duration": 0.3}, controller={"law": "pid"}
    )
    data, _ = run(deep)
    assert not collisions_in(data)
    after = run_clearance(data, TaskTexts(deep.truth.robot.urdf, deep.truth.schedule.text, 0.2))
    assert not after.collisions and any(group.allowed == -0.2 for group in after.groups)
    assert load_parameters().common.contact_depth == CONTACT_DEPTH


def test_a_run_goes_on_from_a_snapshot_with_what_was_declared(online: Scenario) -> None:
    loop = Loop(online)
    while loop.state.stamp_ns < 415_000_000:  # ns, after the grasp
        loop.advance()
    snapshot = loop.snapshot()
    rest = [bytes_of(loop.advance()) for _ in range(300)]
    after = loop.snapshot()
    other = Loop(online)
    other.restore(snapshot)
    assert [bytes_of(other.advance()) for _ in range(300)] == rest
    assert other.snapshot().clearance == after.clearance
    assert other.snapshot().trajectory.progress.collisions == after.trajectory.progress.collisions


def test_a_dry_run_foretells_the_collisions_of_the_run(online: Scenario, make_scenario: MakeScenario) -> None:
    """Whatever the scenario itself says of clearance: between which bodies, when and how deep."""
    _, periods = run(online)
    foretold = dry_run(make_scenario(DEEP, controller={"law": "pid"}))
    assert foretold.collisions == tuple(c for period in periods for c in period.collisions)
    worst = foretold.worst
    assert worst is not None and worst.distance - worst.allowed == min(
        c.distance - c.allowed for c in foretold.collisions
    )
    with pytest.raises(CollisionError, match=r"collide from \d.\d\d s on, at worst arm_a_gripper and deputy"):
        foretold.require_clear()
    clear = replace(foretold, collisions=())
    clear.require_clear()
    assert str(clear) == "" and clear.worst is None


def test_a_period_takes_one_call(online: Scenario) -> None:
    """Of Pinocchio's loop over all pairs, whatever collides."""
    loop = Loop(online)
    with patch.object(pin, "computeDistances", side_effect=pin.computeDistances) as counted:
        for _ in range(10):
            loop.advance_period()
    assert counted.call_count == 10


def test_collisions_are_told_in_one_line() -> None:
    told = str(Collision(1_500_000_000, "arm_a - arm_b", ("arm_a_link_7", "arm_b_link_7"), -0.0123, 0.0))
    assert told == "arm_a_link_7 and arm_b_link_7 overlap by 12.30 mm at 1.50 s"
