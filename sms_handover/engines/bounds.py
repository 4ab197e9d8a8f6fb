"""Bounds on the differences of two engines, stated per shipped scenario."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Bounds:
    """The largest difference over a run that rounding may make: of joints, base, tools and momenta.

    ``docs/second_engine.md`` has what was measured beside them. They leave a factor of ten or more for other
    processors and versions. 0.1 % more mass of one link is beyond them by more than a factor of a thousand.
    """

    joints: float  # rad
    base_position: float  # m
    base_attitude: float  # rad
    tool_position: float  # m
    tool_attitude: float  # rad
    linear_momentum: float  # kg m/s
    angular_momentum: float  # kg m^2/s


# Targets that jump accelerate the wrists most: rounding there, magnified by the condition of the mass matrix,
# is integrated twice over a minute.
_STEPS = Bounds(1e-7, 1e-11, 1e-10, 1e-8, 1e-8, 1e-12, 1e-12)
_SMOOTH = Bounds(1e-9, 1e-12, 1e-11, 1e-10, 1e-9, 1e-12, 1e-12)
# What the hand carries multiplies the condition of the mass matrix, and momentum is that of kilogrammes.
_CARRYING = Bounds(1e-7, 1e-10, 1e-9, 1e-8, 1e-7, 1e-11, 1e-11)

BOUNDS: Mapping[str, Bounds] = MappingProxyType(
    {
        "paper": _STEPS,
        "colliding": _STEPS,
        "smooth": _SMOOTH,
        "one_arm": _SMOOTH,
        "three_arms": _SMOOTH,
        "six_joints": _SMOOTH,
        "planar": _SMOOTH,
        "massive": _CARRYING,
    }
)


def scenario_of_bounds(name: str, *, carries: bool) -> str:
    """Return whose bounds hold for a run of a scenario.

    Its own; those of ``massive`` if the deputy has mass, those of ``paper`` if it is not shipped.
    """
    if carries:
        return "massive"
    return name if name in BOUNDS else "paper"
