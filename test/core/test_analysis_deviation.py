"""Deviations of states with known answers, and where the largest was."""

import numpy as np
import pytest

from sms_handover.analysis.deviation import LargestDeviation, state_deviation
from sms_handover.types import RobotState

JOINTS = 14


def state(
    stamp_ns: int = 0,
    position: tuple[float, float, float] = (0.0, 0.0, 0.0),
    turn: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0),
    joints: dict[int, float] | None = None,
    effort: float = 0.0,
) -> RobotState:
    angles = np.zeros(JOINTS)
    for place, angle in (joints or {}).items():
        angles[place] = angle
    q = np.concatenate([position, turn, angles])
    return RobotState(stamp_ns, q, np.zeros(6 + JOINTS), np.full(JOINTS, effort))


def about(axis: tuple[float, float, float], angle: float) -> tuple[float, float, float, float]:
    """Return the quaternion x y z w of a turn about a unit axis."""
    x, y, z = np.array(axis) * np.sin(angle / 2)
    return float(x), float(y), float(z), float(np.cos(angle / 2))


def test_equal_states_deviate_by_nothing() -> None:
    turn = about((0.6, 0.0, 0.8), 1.1)
    found = state_deviation(state(turn=turn), state(turn=turn))
    assert (found.joint_angle, found.base_position, found.base_angle, found.same_bits) == (
        0.0,
        0.0,
        0.0,
        True,
    )


def test_each_part_has_its_own_figure() -> None:
    found = state_deviation(
        state(position=(1.0, 2.0, 3.0)), state(5, position=(1.0, 5.0, 7.0), joints={3: -0.2, 7: 0.1})
    )
    assert (found.stamp_ns, found.joint, found.joint_angle) == (5, 3, 0.2)
    assert (found.base_position, found.base_angle, found.same_bits) == (5.0, 0.0, False)


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 1.0, 3.0])
def test_the_base_angle_is_that_of_the_turn_between(angle: float) -> None:
    """Composed with any first orientation, and of either sign of the quaternion."""
    axis = (0.36, 0.48, -0.8)
    first = about((0.0, 0.6, 0.8), 0.7)
    x, y, z, w = first
    product = np.array([[w, -z, y, x], [z, w, -x, y], [-y, x, w, z], [-x, -y, -z, w]]) @ about(axis, angle)
    for sign in (1.0, -1.0):
        found = state_deviation(state(turn=first), state(turn=tuple(sign * product)))
        assert found.base_angle == pytest.approx(angle, rel=1e-6)


def test_bits_count_that_no_figure_shows() -> None:
    found = state_deviation(state(), state(effort=1e-300))
    assert (found.joint_angle, found.base_position, found.base_angle) == (0.0, 0.0, 0.0)
    assert not found.same_bits


def test_the_largest_of_a_course_and_where() -> None:
    largest = LargestDeviation()
    largest.add_same()
    course = [
        (state(1), state(1)),
        (state(2), state(2, effort=1.0)),
        (state(3), state(3, joints={2: 0.5})),
        (state(4), state(4, joints={1: 0.1}, position=(3.0, 0.0, 0.0))),
        (state(5), state(5, turn=about((0.0, 0.0, 1.0), 0.3), position=(1.0, 0.0, 0.0))),
    ]
    for one, other in course:
        largest.add(state_deviation(one, other))
    assert largest.compared == 6
    assert largest.first is not None and largest.first.stamp_ns == 2
    assert largest.joint is not None and (largest.joint.stamp_ns, largest.joint.joint) == (3, 2)
    assert largest.base_position is not None and largest.base_position.stamp_ns == 4
    assert largest.base_angle is not None and largest.base_angle.stamp_ns == 5


def test_nothing_differs_in_equal_courses() -> None:
    largest = LargestDeviation()
    for _ in range(3):
        largest.add(state_deviation(state(), state()))
    assert (largest.compared, largest.first, largest.joint) == (3, None, None)
