"""Wall times from a bag whose messages arrive when the test says."""

from math import isnan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sms_handover.analysis.comparison import compare
from sms_handover.analysis.loop_timing import loop_timing
from sms_handover.analysis.summary import summary
from sms_handover.analysis.table import render
from sms_handover.bag.recording import Recording
from sms_handover.bag.run.loop_record import LoopRecord, read_loop
from sms_handover.bag.run.reader import read_run
from sms_handover.errors import BagError
from sms_handover.graph import topics
from sms_handover.run_data import RunData

from .bag_messages import (
    OURS,
    TICK_NS,
    TYPES,
    WALL_NS,
    header,
    joint_state,
    made_up_run,
    odometry,
    open_topics,
    record_run,
)

MS = 1_000_000  # [ns]


def report(stamp_ns: int, ticks: int, mean: float, std: float, most: float, late: int = 0) -> Any:
    return TYPES.make(
        f"{OURS}/LoopTiming",
        header=header(stamp_ns),
        ticks=ticks,
        late_ticks=late,
        held_commands=2 * late,
        period_mean=mean,
        period_std=std,
        period_max=most,
        real_time_factor=1.0,
        period_error_p99=0.0,
        execution_mean=0.0,
        execution_max=0.0,
        latency_bin=0.0,
        latency_counts=np.zeros(0, np.uint32),
        latency_max=0.0,
    )


def states(recording: Recording, run: RunData, walls_ns: list[int]) -> None:
    """Hand over the states of a run, each at its wall time."""
    for k, wall_ns in enumerate(walls_ns):
        stamp_ns = int(run.tick_ns[k])
        state = joint_state(stamp_ns, run.joint_names, run.joint_position[k])
        recording.receive("/joint_states", TYPES.serialize(state), WALL_NS + wall_ns)
        pose = odometry(stamp_ns, run.base_pose[k], run.base_twist[k])
        recording.receive("/base_odometry", TYPES.serialize(pose), WALL_NS + wall_ns + MS // 3)


def recorded(folder: Path, walls_ns: list[int], reports: tuple[Any, ...] = ()) -> LoopRecord:
    """Return the loop of a bag of states that arrived then."""
    with Recording(folder, types=TYPES) as recording:
        open_topics(recording)
        states(recording, made_up_run(len(walls_ns)), walls_ns)
        for message in reports:
            recording.receive(f"/{topics.LOOP_TIMING}", TYPES.serialize(message), WALL_NS)
    return read_loop(folder)


def test_wall_times_are_since_the_first_state(tmp_path: Path) -> None:
    record = recorded(tmp_path / "bag", [5 * MS, 7 * MS, 8 * MS, 20 * MS])
    assert record.wall == pytest.approx([0.0, 0.002, 0.003, 0.015], abs=1e-12)
    assert record.tick_ns.tolist() == [0, TICK_NS, 2 * TICK_NS, 3 * TICK_NS]
    with pytest.raises(ValueError, match="read-only"):
        record.wall[0] = 1.0


def test_a_steady_loop_at_half_of_real_time(tmp_path: Path) -> None:
    found = loop_timing(recorded(tmp_path / "bag", [2 * MS * k for k in range(101)]))
    assert found.wall_duration == pytest.approx(0.2)
    assert found.real_time_factor == pytest.approx(0.5)
    assert found.largest_lag == pytest.approx(0.1)
    assert found.period_median == found.period_tail == pytest.approx(0.002)


def test_a_loop_faster_than_real_time_never_lags_but_after_a_stop(tmp_path: Path) -> None:
    walls = [MS * k // 2 + (40 * MS if k > 60 else 0) for k in range(101)]
    found = loop_timing(recorded(tmp_path / "bag", walls))
    assert found.largest_lag == pytest.approx(0.0305 + 0.040 - 0.061)  # at the first tick after the stop
    assert found.real_time_factor == pytest.approx(0.1 / 0.09)
    assert found.period_median == pytest.approx(0.0005)
    assert found.period_tail < 0.01


def test_reports_of_unequal_length_are_pooled_by_their_ticks(tmp_path: Path) -> None:
    """100 periods of 1 ms and 300 of 3 ms, told in two reports, have the mean and spread of all 400."""
    reports = (
        report(10 * MS, 100, 0.001, 0.0, 0.001, late=1),
        report(90 * MS, 400, 0.003, 0.0, 0.004, late=3),
    )
    found = loop_timing(recorded(tmp_path / "bag", [MS * k for k in range(101)], reports))
    periods = np.array([0.001] * 100 + [0.003] * 300)
    assert found.period_mean == pytest.approx(periods.mean())
    assert found.period_std == pytest.approx(periods.std())
    assert found.period_max == 0.004
    assert (found.late_ticks, found.held_commands) == (3.0, 6.0)


def test_spread_within_reports_counts_too() -> None:
    record = LoopRecord(
        np.array([0, TICK_NS]),
        np.array([0.0, 0.001]),
        np.array([0]),
        *(np.array([value]) for value in (10.0, 0.0, 0.0, 0.002, 0.0005, 0.003)),
    )
    assert loop_timing(record).period_std == pytest.approx(0.0005)


def test_a_bag_without_reports_has_only_what_the_recorder_saw(tmp_path: Path) -> None:
    found = loop_timing(recorded(tmp_path / "bag", [MS * k for k in range(21)]))
    assert isnan(found.period_mean) and isnan(found.late_ticks)
    assert found.real_time_factor == pytest.approx(1.0)


def test_a_bag_of_one_state_is_no_error(tmp_path: Path) -> None:
    found = loop_timing(recorded(tmp_path / "bag", [0]))
    assert isnan(found.wall_duration) and isnan(found.real_time_factor)


def test_after_a_reset_only_the_last_run_counts(tmp_path: Path) -> None:
    run = made_up_run(21)
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        open_topics(recording)
        states(recording, run, [MS * k for k in range(21)])
        states(recording, run, [1000 * MS + 4 * MS * k for k in range(11)])
    record = read_loop(tmp_path / "bag")
    assert record.wall == pytest.approx([0.004 * k for k in range(11)], abs=1e-9)


def test_a_comparison_tells_of_the_wall_clock_where_it_is_known(tmp_path: Path) -> None:
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        open_topics(recording)
        record_run(recording, made_up_run(21))
    run, loop = read_run(tmp_path / "bag"), read_loop(tmp_path / "bag")
    comparison = compare({"one": run, "other": run}, loops={"one": loop})
    found = summary(comparison)["runs"]
    assert found["one"]["loop"]["wall_duration"] == 0.0  # all messages of this bag came at once
    assert found["other"]["loop"] is None
    assert "real-time factor [-]" in render(comparison)
    assert "real-time factor [-]" not in render(compare({"other": run}))


def test_a_bag_of_something_else_is_told(tmp_path: Path) -> None:
    with Recording(tmp_path / "bag", types=TYPES):
        pass
    with pytest.raises(BagError, match="holds no run of sms_handover"):
        read_loop(tmp_path / "bag")
