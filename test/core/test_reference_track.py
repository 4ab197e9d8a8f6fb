"""Between references the desired motion is carried forward, exactly where the motion is simple."""

import numpy as np
import pytest

from sms_handover.control.reference_track import ReferenceTrack
from sms_handover.types import Array, JointReference
from sms_handover.units import ns_to_seconds

_EPS = np.finfo(float).eps
_PERIOD_NS = 20_000_000
_POSITION, _VELOCITY, _ACCELERATION = (np.array(row) for row in ([1.0, -2.0], [0.5, 0.3], [-0.2, 0.7]))


def _true(time: float) -> tuple[Array, Array]:
    """Return position and velocity of a motion of constant acceleration."""
    return (
        _POSITION + _VELOCITY * time + 0.5 * _ACCELERATION * time**2,
        _VELOCITY + _ACCELERATION * time,
    )


def _reference(stamp_ns: int) -> JointReference:
    """Return the reference of that motion."""
    return JointReference(stamp_ns, *_true(ns_to_seconds(stamp_ns)))


def test_before_the_first_reference_there_is_nothing() -> None:
    """The track is not ready, and asking it is a mistake of the caller."""
    track = ReferenceTrack()
    assert not track.ready
    with pytest.raises(RuntimeError, match="no reference has come yet"):
        track.at(0)


def test_a_standing_target_stays() -> None:
    """A reference at rest is desired at rest, at any time after it."""
    track = ReferenceTrack()
    track.update(JointReference(0, _POSITION, np.zeros(2)))
    desired = track.at(15_000_000)
    np.testing.assert_array_equal(desired[0], _POSITION)
    assert not np.any(desired[1]) and not np.any(desired[2])


def test_a_motion_of_constant_acceleration_is_followed_exactly() -> None:
    """From the second reference on, position, velocity and acceleration are the true ones between two."""
    track = ReferenceTrack()
    track.update(_reference(0))
    track.update(_reference(_PERIOD_NS))
    for stamp_ns in range(_PERIOD_NS, 2 * _PERIOD_NS, 1_000_000):
        position, velocity = _true(ns_to_seconds(stamp_ns))
        desired = track.at(stamp_ns)
        # the acceleration is a difference of numbers below 1 over 20 ms
        bound = 4 * _EPS / 0.02
        np.testing.assert_allclose(desired[2], _ACCELERATION, atol=bound)
        np.testing.assert_allclose(desired[1], velocity, atol=4 * _EPS)
        np.testing.assert_allclose(desired[0], position, atol=8 * _EPS)


def test_the_first_reference_has_no_acceleration() -> None:
    """One velocity says nothing about its change."""
    track = ReferenceTrack()
    track.update(_reference(0))
    desired = track.at(10_000_000)
    assert not np.any(desired[2])
    np.testing.assert_allclose(desired[0], _POSITION + 0.01 * _VELOCITY, atol=4 * _EPS)
    np.testing.assert_array_equal(desired[1], _VELOCITY)


def test_no_difference_is_taken_across_a_new_phase() -> None:
    """Where the desired velocity jumps, its difference quotient is no acceleration."""
    track = ReferenceTrack()
    track.update(JointReference(0, np.zeros(2), np.array([9.0, 9.0])))
    track.restart()
    track.update(_reference(_PERIOD_NS))
    assert not np.any(track.at(_PERIOD_NS)[2])
    track.update(_reference(2 * _PERIOD_NS))
    np.testing.assert_allclose(track.at(2 * _PERIOD_NS)[2], _ACCELERATION, atol=4 * _EPS / 0.02)


def test_reset_forgets_every_reference() -> None:
    """A new run begins without the last one's references, so stamps may begin again at zero."""
    track = ReferenceTrack()
    track.update(_reference(5 * _PERIOD_NS))
    track.reset()
    assert not track.ready
    track.update(_reference(0))
    assert not np.any(track.at(0)[2])


def test_a_reference_that_is_too_old_stands_still_where_it_led() -> None:
    """It is carried on as ever up to the limit; beyond it the position is that of the limit, for ever."""
    longest_ns = 6 * _PERIOD_NS
    track, free = ReferenceTrack(longest_ns), ReferenceTrack()
    for one in (track, free):
        one.update(_reference(0))
        one.update(_reference(_PERIOD_NS))
    at_limit = _PERIOD_NS + longest_ns
    for stamp_ns in (_PERIOD_NS, 3 * _PERIOD_NS, at_limit):
        np.testing.assert_array_equal(track.at(stamp_ns), free.at(stamp_ns))
    for later_ns in (at_limit + 1, 10 * at_limit):
        position, velocity, acceleration = track.at(later_ns)
        np.testing.assert_array_equal(position, free.at(at_limit)[0])
        assert not np.any(velocity) and not np.any(acceleration)
    track.update(_reference(10 * at_limit))
    np.testing.assert_array_equal(track.at(10 * at_limit)[1], _true(ns_to_seconds(10 * at_limit))[1])
