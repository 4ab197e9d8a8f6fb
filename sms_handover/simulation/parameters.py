"""Parameters that the whole loop shares."""

from dataclasses import dataclass

from sms_handover.errors import ConfigurationError
from sms_handover.parameters import parameter
from sms_handover.units import seconds_to_ns


@dataclass(frozen=True)
class CommonParameters:
    """Clock and files of a run; the numbers are in ``config/common.yaml``."""

    tick: float = parameter("simulated time between two states", unit="s", minimum=1e-6, maximum=1.0)
    reference_period: float = parameter(
        "simulated time between two joint references", unit="s", minimum=1e-6, maximum=10.0
    )
    robot: str = parameter("path of the robot description; empty: the package's robot.yaml")
    schedule: str = parameter("path of the task schedule; empty: the package's handover.yaml")

    def __post_init__(self) -> None:
        """Refuse a reference period that is no whole number of ticks."""
        if self.reference_ns % self.tick_ns:
            raise ConfigurationError(
                f"reference_period is {self.reference_period:g} s, allowed is a multiple of the tick "
                f"of {self.tick:g} s"
            )

    @property
    def tick_ns(self) -> int:
        """The tick in ns."""
        return seconds_to_ns(self.tick)

    @property
    def reference_ns(self) -> int:
        """The reference period in ns."""
        return seconds_to_ns(self.reference_period)
