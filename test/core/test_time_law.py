"""The time laws: where a motion is, how fast, and that it begins and ends at rest."""

import numpy as np
import pytest

from sms_handover.trajectory.time_law import TIME_LAWS, Progress, quintic, step

_EPS = np.finfo(float).eps
_DURATION = 15.0  # [s]


def test_step_is_done_at_once() -> None:
    """The target jumps: all of the way, at no rate, at any time."""
    for elapsed in (0.0, 1.0, 100.0):
        assert step(elapsed, _DURATION) == Progress(1.0, 0.0)


def test_quintic_goes_from_rest_to_rest() -> None:
    """Fraction 0 and 1 and half way in the middle, no rate at the ends, and it stands still outside."""
    assert quintic(0.0, _DURATION) == Progress(0.0, 0.0)
    assert quintic(_DURATION, _DURATION) == Progress(1.0, 0.0)
    assert quintic(-1.0, _DURATION) == Progress(0.0, 0.0)
    assert quintic(99.0, _DURATION) == Progress(1.0, 0.0)
    middle = quintic(_DURATION / 2.0, _DURATION)
    assert middle.fraction == pytest.approx(0.5, abs=4 * _EPS)
    assert middle.rate == pytest.approx(15.0 / 8.0 / _DURATION, rel=4 * _EPS)  # its largest rate


def test_quintic_has_no_acceleration_at_its_ends() -> None:
    """The fraction grows with the third power of the time from an end, as 10 x^3."""
    for x in (1e-3, 1e-4):
        near = quintic(x * _DURATION, _DURATION).fraction
        assert near == pytest.approx(10.0 * x**3, rel=1.6 * x)  # the next term is 15/10 x
        left = 1.0 - quintic((1.0 - x) * _DURATION, _DURATION).fraction
        assert left == pytest.approx(near, abs=32 * _EPS)


def test_quintic_rate_is_the_derivative_of_its_fraction() -> None:
    """By central differences, whose error is h^2 / 6 times a third derivative of at most 60 / T^3."""
    h = 1e-4 * _DURATION
    bound = h**2 / 6.0 * 60.0 / _DURATION**3 + 8 * _EPS / h
    for elapsed in np.linspace(0.01, 0.99, 50) * _DURATION:
        difference = quintic(elapsed + h, _DURATION).fraction - quintic(elapsed - h, _DURATION).fraction
        assert quintic(elapsed, _DURATION).rate == pytest.approx(difference / (2.0 * h), abs=bound)


def test_quintic_never_goes_back() -> None:
    """The fraction grows all the way, and the rate is nowhere negative."""
    progress = [quintic(time, _DURATION) for time in np.linspace(0.0, _DURATION, 301)]
    assert np.all(np.diff([p.fraction for p in progress]) > 0.0)
    assert min(p.rate for p in progress) >= 0.0


def test_the_laws_a_user_can_choose() -> None:
    """By their names."""
    assert dict(TIME_LAWS) == {"step": step, "quintic": quintic}
