"""Registry of the control laws: those of this package, and those that other packages offer by entry point.

An entry point of the group ``sms_handover.control_laws`` has the name of a law and refers to a
:class:`~sms_handover.control.law.Law`.
"""

from collections.abc import Mapping
from importlib.metadata import EntryPoint, entry_points
from types import MappingProxyType
from typing import Any

from sms_handover.control.law import Law
from sms_handover.control.mpc.law import MPC
from sms_handover.control.nmpc import NMPC
from sms_handover.control.pid import PID
from sms_handover.errors import ConfigurationError, UnknownNameError

GROUP = "sms_handover.control_laws"
SHIPPED: Mapping[str, Law[Any]] = MappingProxyType({law.name: law for law in (NMPC, PID, MPC)})


def law_names() -> tuple[str, ...]:
    """Return the names of all laws, ours first; nothing of other packages is imported."""
    return (*SHIPPED, *sorted({point.name for point in entry_points(group=GROUP)} - set(SHIPPED)))


def require_law(name: str, where: str = "") -> None:
    """Raise UnknownNameError unless there is a law of this name."""
    if name not in SHIPPED and name not in law_names():
        raise UnknownNameError("control law", name, law_names(), where)


def law_named(name: str, where: str = "") -> Law[Any]:
    """Return the law of a name; other packages are looked at only where it is not one of ours.

    Raises UnknownNameError if there is none, ConfigurationError if there are two or it cannot be loaded.
    """
    require_law(name, where)
    if name in SHIPPED:
        return SHIPPED[name]
    points = [*{point.value: point for point in entry_points(group=GROUP, name=name)}.values()]
    if len(points) > 1:
        raise ConfigurationError(
            f"control law {name!r} is offered by {', '.join(map(_package, points))}: uninstall all but one"
        )
    return _loaded(points[0])


def package_of(name: str) -> str:
    """Return the name of the package that offers a law; raises UnknownNameError if there is no such law."""
    require_law(name)
    points = [*entry_points(group=GROUP, name=name)]
    return GROUP.partition(".")[0] if name in SHIPPED else _package(points[0])


def _loaded(point: EntryPoint) -> Law[Any]:
    """Return the law that an entry point refers to; raises ConfigurationError where it is none."""
    try:
        law = point.load()
    except (ImportError, AttributeError) as error:
        raise ConfigurationError(
            f"control law {point.name!r} of {_package(point)} cannot be loaded: {error}"
        ) from error
    if not isinstance(law, Law) or law.name != point.name:
        raise ConfigurationError(
            f"entry point {point.name!r} of {_package(point)} must refer to a Law of this name, not {law!r}"
        )
    return law


def _package(point: EntryPoint) -> str:
    """Return the name of the package of an entry point."""
    return point.dist.name if point.dist else point.value
