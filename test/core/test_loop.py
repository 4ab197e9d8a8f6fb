"""The loop as an object: what it shows, and that a run goes on from a snapshot as if nothing had happened."""

import json
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sms_handover.errors import ConfigurationError, ControllerError
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.scenario import Overrides, Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.snapshot import Snapshot, load_snapshot, plain, save_snapshot, structured
from sms_handover.types import Array, GraspStatus

from .loop_rest import digest_of_rest, digests_of_rests
from .retried_handover import EARLIEST_END, LAWS, MISSED, TICKS, retried_handover

ENFORCED: Overrides = {
    "plant": {"joint_limits": "enforce"},
    "robot": {"arms.arm_a.limits": {"joint_6": {"position": [-1.41, 0.0], "velocity": 0.1}}},
}
AT_STOP = 200  # a tick at which joint 6 of arm A is at its stop, where limits are enforced


@pytest.fixture
def overrides(tmp_path: Path) -> Overrides:
    """A handover with a retry."""
    return retried_handover(tmp_path)


@pytest.mark.parametrize("law", LAWS)
def test_a_run_goes_on_from_any_snapshot_in_a_fresh_process(
    overrides: Overrides, law: str, tmp_path: Path
) -> None:
    """The rest is that of the uninterrupted run bit for bit: states, efforts, references, deputy, events.

    Among the ticks are those at which a grasp has been commanded, but its event is not yet known. Under PID
    joint 6 is at its stop at 200 ms, and an excess of its rate goes on at 401 ms. ``make verify`` takes a
    hundred ticks.
    """
    random = np.random.default_rng(14)
    ticks = {AT_STOP, *MISSED, *random.choice(EARLIEST_END, size=3, replace=False).tolist()}
    given = {**overrides, "controller": LAWS[law], **(ENFORCED if law == "pid" else {})}
    digests = digests_of_rests(given, ticks, tmp_path)
    assert len({uninterrupted for uninterrupted, _ in digests}) == len(ticks)
    assert all(uninterrupted == restored for uninterrupted, restored in digests)


def test_the_loop_shows_what_simulate_records(overrides: Overrides) -> None:
    """Tick by tick or period by period, and the same again after a reset."""
    scenario = load_scenario("colliding", {**overrides, "controller": LAWS["nmpc"]})
    run, loop = simulate(scenario), Loop(scenario)
    assert len(run.tick_ns) == TICKS
    for _ in range(2):
        loop.reset()
        rows = 0
        while not loop.finished:
            ticks = loop.advance_period().observations
            period = ticks[0].period
            assert period is not None and not any(tick.period for tick in ticks[1:])
            for tick in ticks:
                assert tick.stamp_ns == run.tick_ns[rows]
                assert tick.state.joint_position.tobytes() == run.joint_position[rows].tobytes()
                assert tick.effort.tobytes() == run.joint_command[rows].tobytes()
                assert tick.reference is period.reference and tick.phase is period.phase
                rows += 1
        assert rows == TICKS
    assert [event.status for event in run.grasp_events][:2] == [GraspStatus.MISSED, GraspStatus.SUCCEEDED]
    with pytest.raises(ConfigurationError, match="the run ended at 1820000000 ns: reset or restore"):
        loop.advance()


def test_a_branch_departs_where_it_is_taken(overrides: Overrides) -> None:
    """Under other gains or another law the states up to there are shared, and the efforts after it differ."""
    trunk = Loop(load_scenario("colliding", {**overrides, "controller": LAWS["nmpc"]}))
    while trunk.state.stamp_ns < 505_000_000:
        trunk.advance()
    snapshot, answer = trunk.snapshot(), trunk.advance()
    for law in ({"rolling_period": 0.4}, {"law": "pid"}):
        branch = Loop(load_scenario("colliding", {**overrides, "controller": law}))
        branch.restore(snapshot)
        tick = branch.advance()
        assert (tick.stamp_ns, tick.q.tobytes()) == (answer.stamp_ns, answer.q.tobytes())
        assert np.any(tick.effort) and tick.effort.tobytes() != answer.effort.tobytes()
        digest_of_rest(branch)
        assert np.all(np.isfinite(branch.state.q))


class Springs:
    """A controller of a user, without a state to tell."""

    def reset(self) -> None:
        """Do nothing."""

    def guide(self, guidance: object) -> None:
        """Do nothing."""

    def effort(self, stamp_ns: int, q: Array, v: Array) -> Array:
        """Pull every joint to zero."""
        return -0.1 * q[7:]


def test_what_a_snapshot_needs_is_asked_for(scenario: Scenario, overrides: Overrides, tmp_path: Path) -> None:
    """The state of a controller, the robot and the schedule; a file that is none is named."""
    with pytest.raises(ControllerError, match="Springs has no state to keep: give it 'state' and 'restore'"):
        Loop(scenario, Springs()).snapshot()
    snapshot = Loop(scenario).snapshot()
    with pytest.raises(ConfigurationError, match="the snapshot has 3 phases, must have the 4"):
        Loop(load_scenario("colliding", overrides)).restore(snapshot)
    smaller = replace(snapshot.plant, q=np.zeros(14), v=np.zeros(13), joint_effort=np.zeros(7))
    with pytest.raises(ConfigurationError, match="the snapshot has 7 joints and hinges, must have 14"):
        Loop(scenario).restore(replace(snapshot, plant=smaller))
    file = tmp_path / "snapshot.json"
    save_snapshot(snapshot, file)
    with pytest.raises(ConfigurationError, match=r"snapshot\.json exists; choose another file"):
        save_snapshot(snapshot, file)
    for text in ("[]", "{}", "none"):
        file.write_text(text, encoding="utf-8")
        with pytest.raises(ConfigurationError, match=r"snapshot\.json is no snapshot of this version"):
            load_snapshot(file)


def test_a_snapshot_can_be_pickled(overrides: Overrides) -> None:
    """For a pool of processes; the rest from a copy is the same."""
    loop = Loop(load_scenario("colliding", {**overrides, "controller": LAWS["pid"]}))
    while loop.state.stamp_ns < 1_700_000_000:
        loop.advance()
    snapshot = pickle.loads(pickle.dumps(loop.snapshot()))
    expected = digest_of_rest(loop)
    loop.restore(snapshot)
    assert digest_of_rest(loop) == expected


def test_the_seed_is_kept(scenario: Scenario) -> None:
    loop = Loop(scenario)
    loop.reset(seed=7)
    snapshot = loop.snapshot()
    loop.reset()
    assert loop.seed == 0
    loop.restore(structured(Snapshot, plain(snapshot)))
    assert loop.seed == 7


def test_a_state_that_is_restored_is_the_state(overrides: Overrides) -> None:
    """A snapshot of what was restored is the same file, and restoring leaves nothing of the run before."""
    loop = Loop(
        load_scenario("colliding", {"common": overrides["common"], "controller.rolling_period": 0.02})
    )
    for _ in range(30):
        loop.advance_period()
    snapshot = loop.snapshot()
    assert any(snapshot.plant.saturated_ticks)
    digest_of_rest(loop)
    loop.restore(snapshot)
    assert json.dumps(plain(loop.snapshot())) == json.dumps(plain(snapshot))


def test_a_run_of_an_external_controller_is_not_begun() -> None:
    with pytest.raises(ConfigurationError, match="the controller is external: give simulate"):
        Loop(
            load_scenario(
                "colliding", {"common": {"external": ["controller"], "peers": ["plant", "controller"]}}
            )
        )
