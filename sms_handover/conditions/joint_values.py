"""Joint values: friction, errors of the torque and the way of a command, of each joint."""

from dataclasses import dataclass

import numpy as np

from sms_handover.errors import ConfigurationError
from sms_handover.types import Array, freeze


@dataclass(frozen=True, eq=False)
class FrictionValues:
    """Friction of each joint (n,).

    ``viscous`` N m s/rad; ``coulomb`` N m; ``stiction`` N m, what a joint at rest bears at most, >= coulomb;
    ``stribeck_speed`` rad/s, > 0, at which the difference between the two has fallen to a share of 1/e.
    """

    viscous: Array
    coulomb: Array
    stiction: Array
    stribeck_speed: Array

    def __post_init__(self) -> None:
        freeze(self, "viscous", "coulomb", "stiction", "stribeck_speed")
        if np.any(self.stiction < self.coulomb):
            joint = int(np.argmax(self.stiction < self.coulomb))
            raise ConfigurationError(
                f"stiction is {self.stiction[joint]:g} N m, "
                f"must be >= the Coulomb friction of {self.coulomb[joint]:g} N m"
            )

    def with_free(self, count: int) -> "FrictionValues":
        """Return those of these joints and so many more without friction behind them."""
        none = np.zeros(count)
        viscous, coulomb, stiction, speed = (
            np.concatenate([part, none])
            for part in (self.viscous, self.coulomb, self.stiction, self.stribeck_speed)
        )
        speed[speed.size - count :] = 1.0  # [rad/s], of no effect
        return FrictionValues(viscous, coulomb, stiction, speed)

    @property
    def any(self) -> bool:
        """Whether a joint has friction."""
        return bool(np.any(self.viscous) or np.any(self.stiction))


@dataclass(frozen=True, eq=False)
class TorqueErrors:
    """Errors of the torque of each joint (n,).

    ``gain`` [-], 0 for none; ``offset`` N m; ``step`` N m of the command, 0 for none; ``noise_density``
    N m/sqrt(Hz), the square root of the two-sided power spectral density.
    """

    gain: Array
    offset: Array
    step: Array
    noise_density: Array

    def __post_init__(self) -> None:
        freeze(self, "gain", "offset", "step", "noise_density")

    @property
    def any(self) -> bool:
        """Whether a torque differs from its command."""
        return any(map(np.any, (self.gain, self.offset, self.step, self.noise_density)))


@dataclass(frozen=True)
class CommandErrors:
    """The way of a command: it takes ``delay`` s, and gets lost with the probability ``dropped``."""

    delay: float = 0.0
    dropped: float = 0.0

    @property
    def any(self) -> bool:
        """Whether a command may come late or not at all."""
        return bool(self.delay or self.dropped)
