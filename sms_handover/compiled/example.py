"""Example on which a library is held against Pinocchio before it is used."""

from pathlib import Path

import numpy as np
import pinocchio as pin

from sms_handover.errors import ConfigurationError
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array

_TOLERANCE = 1e-9  # [-] of the largest value; rounding leaves 1e-14
_SEED = 0


def example_of(robot: RobotModel) -> tuple[Array, Array, Array]:
    """Return a fixed q, v and one value per joint."""
    random = np.random.default_rng(_SEED)
    base = pin.SE3ToXYZQUAT(pin.SE3(pin.exp3(random.normal(size=3)), random.normal(size=3)))
    q = np.concatenate([base, random.uniform(-1.0, 1.0, robot.n_joints)])
    return q, random.uniform(-0.1, 0.1, robot.pin.nv), random.uniform(-1.0, 1.0, robot.n_joints)


def require_equal(library: Path, pairs: list[tuple[Array, Array]]) -> None:
    """Raise ConfigurationError unless a library agrees with Pinocchio."""
    for ours, theirs in pairs:
        apart = float(np.abs(ours - theirs).max() / np.abs(theirs).max())
        if not apart <= _TOLERANCE:
            raise ConfigurationError(
                f"compiled dynamics in {library} differ from Pinocchio by {apart:.1e} of the largest value, "
                f"must be <= {_TOLERANCE:g}: remove the file, or use dynamics 'pinocchio'"
            )
