"""Range checks of numbers that a user gives; each error names value, unit and what is allowed."""

from math import inf, isfinite
from reprlib import repr as shortened

from sms_handover.errors import ConfigurationError


def check_number(
    value: object,
    what: str,
    unit: str = "",
    *,
    minimum: float = -inf,
    maximum: float = inf,
    above: float = -inf,
    whole: bool = False,
    error: type[ConfigurationError] = ConfigurationError,
) -> float:
    """Return a finite number in its range, as a float unless it must be ``whole``.

    Raises ``error``, e.g. ``mass is -1.0 kg, must be > 0 kg``.
    """
    if isinstance(value, bool) or not isinstance(value, int if whole else int | float):
        kind = "a whole number" if whole else "a number"
        raise error(f"{what} is {shortened(value)}, must be {kind}{_after(' in ', unit)}")
    number, suffix = _as_float(value), _after(" ", unit)
    if not isfinite(number):
        raise error(f"{what} is {number}{suffix}, must be finite")
    if not (minimum <= value <= maximum and value > above):
        bounds = ((">", above), (">=", minimum), ("<=", maximum))
        allowed = " and ".join(f"{sign} {bound:.15g}" for sign, bound in bounds if isfinite(bound))
        raise error(f"{what} is {value}{suffix}, must be {allowed}{suffix}")
    return value if whole else number


def check_vector(
    values: object,
    size: int,
    what: str,
    unit: str = "",
    *,
    above: float = -inf,
    error: type[ConfigurationError] = ConfigurationError,
) -> tuple[float, ...]:
    """Return ``size`` finite numbers above a bound; raises ``error``."""
    if not isinstance(values, list | tuple) or len(values) != size:
        raise error(f"{what} is {shortened(values)}, must be {size} numbers{_after(' in ', unit)}")
    return tuple(
        check_number(item, f"{what}[{index}]", unit, above=above, error=error)
        for index, item in enumerate(values)
    )


def _as_float(value: float) -> float:
    """Return a number as a float; a whole number beyond every float is infinite."""
    try:
        return float(value)
    except OverflowError:
        return inf


def _after(words: str, unit: str) -> str:
    """Return a unit behind some words, or nothing if there is no unit."""
    return f"{words}{unit}" if unit else ""
