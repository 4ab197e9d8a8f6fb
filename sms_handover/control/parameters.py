"""Parameters of the controller."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields

from sms_handover.configuration.parameters import build, parameter
from sms_handover.control.nmpc import MAX_CONTROL_ORDER, NmpcGains
from sms_handover.control.pid import PidGains
from sms_handover.errors import UnknownNameError

LAWS = ("nmpc", "pid")


@dataclass(frozen=True)
class ControllerParameters:
    """Which law controls the joints and its gains; the numbers are in ``config/controller.yaml``."""

    law: str = parameter("control law", choices=LAWS)
    rolling_period: float = parameter("nmpc: prediction horizon T_r", unit="s", minimum=1e-3)
    control_order: int = parameter("nmpc: order of the input", minimum=0, maximum=MAX_CONTROL_ORDER)
    proportional: float = parameter("pid: proportional gain K_P", unit="N m/rad", minimum=0.0)
    integral: float = parameter("pid: integral gain K_I", unit="N m/(rad s)", minimum=0.0)
    derivative: float = parameter("pid: derivative gain K_D", unit="N m s/rad", minimum=0.0)
    reference_hold: float = parameter(
        "real time: how long the desired motion is carried on when the next reference is overdue, before it "
        "stands still",
        unit="s",
        minimum=0.0,
        maximum=3600.0,
    )


def gains_of(
    parameters: ControllerParameters, overrides: Mapping[str, object], where: str
) -> NmpcGains | PidGains:
    """Return the gains of the chosen law, with the overrides of a phase on top.

    Raises ConfigurationError where an override is not a gain of the law or out of range.
    """
    cls: type[NmpcGains] | type[PidGains] = NmpcGains if parameters.law == "nmpc" else PidGains
    names = {item.name for item in fields(cls)}
    for name in overrides:
        if name not in names:
            raise UnknownNameError(f"gain of {parameters.law}", name, sorted(names), where)
    base = {name: value for name, value in asdict(parameters).items() if name in names}
    return build(cls, {**base, **overrides}, where)
