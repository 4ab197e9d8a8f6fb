"""Numbers that a message may not hold are found wherever they stand; good ones pass, the largest too."""

import numpy as np
import pytest

from sms_handover.errors import MessageError, Reason
from sms_handover.ros.codecs.validation import check_finite, check_unit


@pytest.mark.parametrize("bad", [np.nan, -np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("at", range(14))
def test_one_bad_number_is_found_wherever_it_stands(bad: float, at: int) -> None:
    values = np.linspace(-1.0, 1.0, 14)
    values[at] = bad
    with pytest.raises(MessageError, match="the effort is not finite") as caught:
        check_finite(values, "the effort")
    assert caught.value.reason is Reason.NOT_FINITE


def test_bad_numbers_do_not_cancel() -> None:
    with pytest.raises(MessageError):
        check_finite(np.array([np.inf, -np.inf]), "x")


@pytest.mark.filterwarnings("ignore:overflow encountered in dot")
@pytest.mark.parametrize("value", [0.0, -0.0, 5e-324, 1e200, -1.7976931348623157e308])
def test_every_finite_number_passes(value: float) -> None:
    """Also those whose square is beyond every float."""
    check_finite(np.full(14, value), "x")
    check_finite(np.frombuffer(b"abc" + np.full(3, value).tobytes(), "<f8", 3, 3), "x")  # not aligned


def test_a_rotation_has_unit_length() -> None:
    random = np.random.default_rng(0)
    for _ in range(100):
        quaternion = random.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        check_unit(quaternion, "x")
        check_unit(quaternion.astype(np.float32).astype(np.float64), "x")
        for scale in (0.0, 0.99, 1.00001, 2.0, np.nan):
            with pytest.raises(MessageError) as caught:
                check_unit(scale * quaternion, "a pose")
            assert caught.value.reason is Reason.NOT_UNIT
