"""Parameters of the controller: its law, and the gains of every law that it may be."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, make_dataclass
from typing import Any

from sms_handover.configuration.parameters import build, parameter
from sms_handover.control.law import Law
from sms_handover.control.mpc.parameters import MpcGains
from sms_handover.control.nmpc import NmpcGains
from sms_handover.control.pid import PidGains
from sms_handover.control.registry import GROUP, SHIPPED
from sms_handover.errors import ConfigurationError, UnknownNameError


@dataclass(frozen=True)
class ControllerParameters(MpcGains, PidGains, NmpcGains):
    """The law that controls the joints, and its gains; the values are in ``config/controller.yaml``."""

    law: str = parameter(
        f"control law: {', '.join(SHIPPED)}, or one of another package (entry points {GROUP})"
    )
    disturbance_bandwidth: float = parameter(
        "laws with a model of the dynamics: bandwidth of the observer of disturbances, whose estimate is "
        "taken off the efforts; 0: none",
        unit="1/s",
        minimum=0.0,
        maximum=1e4,
    )
    integral_time: float = parameter(
        "laws with a model of the dynamics: integral time T_i of their feedback of the tracking error; 0: no "
        "integral action",
        unit="s",
        minimum=0.0,
        maximum=1e4,
    )
    friction_viscous: float = parameter(
        "laws with a model of the dynamics: viscous friction that each joint is believed to have, added to "
        "the efforts; 0: none",
        unit="N m s/rad",
        minimum=0.0,
        maximum=1e3,
    )
    friction_coulomb: float = parameter(
        "laws with a model of the dynamics: Coulomb friction that each joint is believed to have, added to "
        "the efforts; 0: none",
        unit="N m",
        minimum=0.0,
        maximum=1e3,
    )
    friction_speed: float = parameter(
        "desired joint rate within which the believed Coulomb friction changes its sign smoothly",
        unit="rad/s",
        minimum=1e-6,
        maximum=10.0,
    )
    reference_hold: float = parameter(
        "real time: how long the desired motion is extrapolated when the next reference is overdue, before "
        "it stops",
        unit="s",
        minimum=0.0,
        maximum=3600.0,
    )


def parameters_with(law: Law[Any], every_node: type) -> type[ControllerParameters]:
    """Return the parameters of the controller under a law, with those of a law of another package.

    ``every_node`` is the dataclass of the parameters that every node has. Raises ConfigurationError if that
    law calls a parameter like one that is there already.
    """
    if law.name in SHIPPED:
        return ControllerParameters
    for item in fields(law.parameters):
        if item.name in {
            found.name for taken in (ControllerParameters, every_node) for found in fields(taken)
        }:
            raise ConfigurationError(
                f"control law {law.name!r} has a parameter {item.name!r}, as the controller has: rename it"
            )
    bases = (law.parameters, ControllerParameters)
    return make_dataclass(ControllerParameters.__name__, (), bases=bases, frozen=True)


def gains_of(
    law: Law[Any], parameters: ControllerParameters, overrides: Mapping[str, object], where: str
) -> Any:
    """Return the gains of a law, with the overrides of a phase on top.

    Raises ConfigurationError where an override is not a gain of the law or out of range.
    """
    names = {item.name for item in fields(law.parameters)}
    for name in overrides:
        if name not in names:
            raise UnknownNameError(f"gain of {law.name}", name, sorted(names), where)
    return build(law.parameters, {**{name: getattr(parameters, name) for name in names}, **overrides}, where)
