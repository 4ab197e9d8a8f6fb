"""Momentum of robot and deputy as a scene shows it: centre of mass, and angular momentum about it."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.model.poses import se3_of
from sms_handover.run_data import RunData
from sms_handover.scene.links import DescribedRobot, Rows, moving_joints
from sms_handover.types import Array, Pose, freeze

_LEAST = 1e-6  # [kg m^2/s] far above rounding, and far below what a tumbling deputy brings along


@dataclass(frozen=True, eq=False)
class PointMass:
    """The deputy as the centre of mass sees it: ``mass`` kg at ``com`` (3,) m in it."""

    mass: float
    com: Array

    def __post_init__(self) -> None:
        freeze(self, "com")


MASSLESS = PointMass(0.0, np.zeros(3))


@dataclass(frozen=True, eq=False)
class Momentum:
    """Centre of mass (T, 3) m and angular momentum (T, 3) kg m^2/s about it in ``world``; NaN if unknown."""

    centre_of_mass: Array
    angular_momentum: Array

    def __post_init__(self) -> None:
        freeze(self, "centre_of_mass", "angular_momentum")


def momentum_of(
    run: RunData, robot: DescribedRobot, deputy: PointMass, ticks: Rows, periods: Rows
) -> Momentum | None:
    """Return the momentum at some ticks and reference periods of a run, None if it is but rounding."""
    angular = run.angular_momentum[periods]
    sizes = np.linalg.norm(angular, axis=1)
    if not np.any(sizes > _LEAST):  # neither where it was not recorded
        return None
    centres = robot.centres_of_mass(run.base_pose[ticks], *moving_joints(run, ticks, periods))
    if deputy.mass:
        places = np.array([_place(row, deputy.com) for row in run.deputy_pose[periods]])
        total = robot.mass + deputy.mass
        centres = (robot.mass * centres + deputy.mass * places) / total
    return Momentum(centres, angular)


def _place(deputy_in_world: Array, com: Array) -> Array:
    """Return where a point (3,) m of the deputy is in ``world``."""
    placed: pin.SE3 = se3_of(Pose(deputy_in_world[:3], deputy_in_world[3:]))
    place: Array = placed.act(np.array(com))
    return place
