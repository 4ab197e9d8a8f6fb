from itertools import pairwise

import numpy as np
import pytest

from sms_handover.analysis.decimation import FEWEST_POINTS, decimate
from sms_handover.errors import ConfigurationError
from sms_handover.types import Array

SIZES = (1000, 1001, 1003, 4096)
POINTS = (FEWEST_POINTS, 8, 11, 100, 501)


def series(size: int, seed: int, holes: int = 0) -> tuple[Array, Array]:
    """Return a random walk over uneven times, with holes of NaN of random lengths."""
    random = np.random.default_rng(seed)
    time = np.cumsum(random.uniform(0.1, 2.0, size))
    values = np.cumsum(random.standard_normal(size))
    for begin in random.integers(0, size, holes):
        values[begin : begin + int(random.integers(1, size // 10))] = np.nan
    return time, values


def places(time: Array, kept: Array) -> list[int]:
    """Return where the kept times are in the whole series; times are all different."""
    found = [int(place) for place in np.searchsorted(time, kept)]
    assert np.array_equal(time[found], kept)
    return found


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("points", POINTS)
@pytest.mark.parametrize("holes", [0, 1, 7])
def test_what_is_kept_is_the_series_at_increasing_times_and_not_more_than_asked(
    size: int, points: int, holes: int
) -> None:
    time, values = series(size, seed=points, holes=holes)
    kept_time, kept = decimate(time, values, points)
    found = places(time, kept_time)
    assert len(kept) == len(kept_time) <= points
    assert np.array_equal(values[found], kept, equal_nan=True)
    assert all(a < b for a, b in pairwise(found))
    assert (found[0], found[-1]) == (0, size - 1)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("points", POINTS)
@pytest.mark.parametrize("holes", [0, 7])
def test_the_envelope_is_that_of_the_whole_series(size: int, points: int, holes: int) -> None:
    time, values = series(size, seed=points + 1, holes=holes)
    kept_time, kept = decimate(time, values, points)
    found = np.array(places(time, kept_time))
    buckets = (points - 2) // (5 if np.any(np.isnan(values)) else 2)
    for k in range(buckets):  # the k-th of equal shares of the samples between the ends
        begin, end = (1 + (size - 2) * edge // buckets for edge in (k, k + 1))
        part, thinned = values[begin:end], kept[(found >= begin) & (found < end)]
        if np.all(np.isnan(part)):
            assert np.all(np.isnan(thinned))
        else:
            assert (np.nanmin(thinned), np.nanmax(thinned)) == (np.nanmin(part), np.nanmax(part))


@pytest.mark.parametrize("points", POINTS)
@pytest.mark.parametrize("holes", [1, 3, 30])
def test_no_line_bridges_a_gap(points: int, holes: int) -> None:
    time, values = series(2000, seed=holes, holes=holes)
    assert np.any(np.isnan(values))
    kept_time, kept = decimate(time, values, points)
    for (a, left), (b, right) in pairwise(zip(places(time, kept_time), kept, strict=True)):
        if not np.isnan(left) and not np.isnan(right):
            assert not np.any(np.isnan(values[a:b]))


@pytest.mark.parametrize("points", POINTS)
def test_a_single_missing_sample_between_every_two_is_not_bridged(points: int) -> None:
    values = np.arange(500.0)
    values[1::2] = np.nan
    _, kept = decimate(np.arange(500.0), values, points)
    finite = ~np.isnan(kept)
    assert not np.any(finite[1:] & finite[:-1])


def test_a_spike_of_one_sample_stays() -> None:
    values = np.zeros(100_000)
    values[54_321], values[54_322] = 7.0, -3.0
    _, kept = decimate(np.arange(100_000.0), values, 200)
    assert (kept.max(), kept.min()) == (7.0, -3.0)


def test_infinite_values_are_extremes_not_gaps() -> None:
    values = np.zeros(100)
    values[40], values[60], values[70] = np.inf, -np.inf, np.nan
    _, kept = decimate(np.arange(100.0), values, 7)
    assert np.inf in kept
    assert -np.inf in kept


def test_a_short_series_is_returned_whole() -> None:
    time, values = series(50, seed=3)
    kept_time, kept = decimate(time, values, 50)
    assert np.array_equal(kept_time, time)
    assert np.array_equal(kept, values)
    assert [len(part) for part in decimate(time[:0], values[:0], 50)] == [0, 0]


def test_a_series_of_nan_has_its_ends_and_nothing_but_nan() -> None:
    time, kept = decimate(np.arange(100.0), np.full(100, np.nan), 20)
    assert (time[0], time[-1]) == (0.0, 99.0)
    assert np.all(np.isnan(kept))


def test_wrong_input_is_told() -> None:
    with pytest.raises(ConfigurationError, match="points is 6, it must be >= 7"):
        decimate(np.arange(10.0), np.arange(10.0), 6)
    with pytest.raises(ConfigurationError, match=r"time \(10,\) and values \(9,\)"):
        decimate(np.arange(10.0), np.arange(9.0), 8)
    with pytest.raises(ConfigurationError, match=r"values \(10, 2\)"):
        decimate(np.arange(10.0), np.zeros((10, 2)), 8)
