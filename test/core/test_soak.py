"""What the soak takes for growth, and the schedule that it runs."""

import os
import random
from pathlib import Path

import pytest

from benchmarks.process_samples import Sample, growth, sample
from benchmarks.soak import ALLOWED, Soak
from benchmarks.soak_schedule import write_schedule
from sms_handover.simulation.check import check_scenario
from sms_handover.simulation.scenario import load_scenario
from sms_handover.units import NS_PER_S

MINUTES = 30.0
PERIOD_S = 5.0  # [s] between samples
SEED = 5


def samples(own: list[float], descriptors: list[int] | None = None) -> list[Sample]:
    """Return a sample each period with these sizes [MiB]."""
    counts = descriptors or [18] * len(own)
    return [
        Sample(PERIOD_S * k, own=size, pss=size, rss=2 * size, descriptors=count, threads=15, shared=3.8)
        for k, (size, count) in enumerate(zip(own, counts, strict=True))
    ]


def soaked(taken: list[Sample], *, lost: int = 0, code: int = 0, findings: tuple[str, ...] = ()) -> Soak:
    return Soak(MINUTES, MINUTES, 1.0, code, {"plant": taken}, 30, 1, 1, lost, 0, findings)


def sizes(per_minute: float, saw: float = 0.0, noise: float = 0.0) -> list[float]:
    """Return 100 MiB that grow, with the teeth of a saw each minute, noise, and a start that is higher."""
    draw = random.Random(SEED)
    found = []
    for k in range(round(60 * MINUTES / PERIOD_S)):
        minute = k * PERIOD_S / 60.0
        warm = 30.0 if minute < 1.0 else 0.0
        found.append(100.0 + warm + per_minute * minute + saw * (minute % 1.0) + noise * draw.random())
    return found


def test_the_growth_of_a_line_is_its_slope_whatever_lies_on_it() -> None:
    assert growth(samples(sizes(0.5)), 360.0) == pytest.approx(0.5)
    assert growth(samples(sizes(0.5, saw=10.0, noise=1.0)), 360.0) == pytest.approx(0.5, abs=0.05)
    peak = sizes(0.0)
    peak[200:220] = [500.0] * 20
    assert growth(samples(peak), 360.0) == 0.0


def test_too_few_samples_are_no_slope() -> None:
    with pytest.raises(ValueError, match="too few"):
        growth(samples(sizes(0.0))[:10], 360.0)


def test_a_leak_is_not_flat_and_a_saw_is() -> None:
    assert soaked(samples(sizes(0.0, saw=10.0, noise=1.0))).flat
    assert soaked(samples(sizes(0.9 * ALLOWED * 100.0))).flat
    assert not soaked(samples(sizes(1.5 * ALLOWED * 100.0))).flat


def test_a_descriptor_that_is_not_given_back_is_not_flat() -> None:
    own = sizes(0.0)
    back = [18 + k % 2 for k in range(len(own))]
    assert soaked(samples(own, back)).flat
    kept = [18 + k // 100 for k in range(len(own))]
    assert not soaked(samples(own, kept)).flat


def test_whole_is_only_a_run_that_came_to_its_end_with_everything() -> None:
    taken = samples(sizes(0.0))
    assert soaked(taken).whole
    for less in (soaked(taken, lost=1), soaked(taken, code=3), soaked(taken, findings=("a gap",))):
        assert not less.whole


def test_a_sample_of_this_process_sees_what_it_opens() -> None:
    before = sample(os.getpid(), 0.0)
    with Path(os.devnull).open():
        after = sample(os.getpid(), 1.0)
    assert before is not None and after is not None
    assert after.descriptors == before.descriptors + 1
    assert 0.0 < after.own <= after.rss
    assert sample(2**22 + 1, 0.0) is None  # beyond the largest id that Linux gives


def test_the_schedule_is_as_long_as_wanted_and_can_be_carried_out(tmp_path: Path) -> None:
    path = write_schedule(tmp_path / "long.yaml", 60.0 * MINUTES)
    schedule = load_scenario("colliding", {"common": {"schedule": str(path)}}).truth.schedule
    assert schedule.end_ns == 60 * MINUTES * NS_PER_S
    assert sum(bool(phase.commands) for phase in schedule.phases) == 2 * MINUTES
    short = write_schedule(tmp_path / "short.yaml", 120.0)  # the phases repeat after that
    check_scenario(
        load_scenario("colliding", {"common.schedule": str(short), "trajectory.time_law": "quintic"})
    )
