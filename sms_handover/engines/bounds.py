"""Bounds on the differences of two engines, stated per shipped scenario."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Bounds:
    """The largest difference over a run that rounding may make: of joints, base, tools and momenta.

    ``docs/second_engine.md`` has what was measured beside them. They leave a factor of ten or more for other
    processors and versions. In two seconds of ``smooth``, 0.1 % more mass of any link is beyond them a
    thousandfold.
    """

    joints: float  # rad
    base_position: float  # m
    base_attitude: float  # rad
    tool_position: float  # m
    tool_attitude: float  # rad
    linear_momentum: float  # kg m/s
    angular_momentum: float  # kg m^2/s
    impulse: float = 1e-11  # N s, N m s, of a grasp


# Targets that jump accelerate the wrists most: rounding there, magnified by the condition of the mass matrix,
# is integrated twice over a minute.
_STEPS = Bounds(1e-7, 1e-11, 1e-10, 1e-8, 1e-8, 1e-12, 1e-12)
_SMOOTH = Bounds(1e-9, 1e-12, 1e-11, 1e-10, 1e-9, 1e-12, 1e-12)
# What the hand carries multiplies the condition of the mass matrix, and momentum is that of kilogrammes.
_CARRYING = Bounds(1e-7, 1e-10, 1e-9, 1e-8, 1e-7, 1e-11, 1e-11)
# Arms that follow a tumbling deputy, or go a long way through a narrow place, are unstable in open loop for
# seconds, in which rounding grows tenfold every other second.
_TUMBLING = Bounds(1e-4, 1e-7, 1e-6, 1e-5, 1e-4, 1e-11, 1e-11, 1e-7)
_TIGHT = Bounds(1e-6, 1e-9, 1e-8, 1e-6, 1e-6, 1e-12, 1e-12)

BOUNDS: Mapping[str, Bounds] = MappingProxyType(
    {
        "paper": _STEPS,
        "colliding": _STEPS,
        "smooth": _SMOOTH,
        "one_arm": _SMOOTH,
        "three_arms": _SMOOTH,
        "six_joints": _SMOOTH,
        "planar": _SMOOTH,
        "tight": _TIGHT,
        "massive": _CARRYING,
        "tumbling": _TUMBLING,
    }
)

_WITH_MASS = frozenset({"massive", "tumbling"})


def scenario_of_bounds(name: str, *, carries: bool) -> str:
    """Return whose bounds hold for a run of a scenario.

    Its own, of those with a deputy of its kind. Another has those of ``massive`` if the deputy has mass, and
    those of ``paper`` if not.
    """
    own = _WITH_MASS if carries else BOUNDS.keys() - _WITH_MASS
    return name if name in own else "massive" if carries else "paper"
