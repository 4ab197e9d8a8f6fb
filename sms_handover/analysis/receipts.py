"""Whether a run kept the laws that a free-floating robot keeps, and whether its references existed."""

from dataclasses import dataclass
from math import nan

import numpy as np

from sms_handover.analysis.numbers import largest, lengths
from sms_handover.analysis.signals import energy_residual
from sms_handover.run_data import RunData
from sms_handover.types import IkStatus

_CONVERGED = list(IkStatus).index(IkStatus.CONVERGED)
_NOT_ASKED = -1


@dataclass(frozen=True)
class PhysicsResiduals:
    """Largest violation of each conservation law over a run that starts at rest.

    ``linear_momentum`` kg m/s and ``angular_momentum`` kg m^2/s, the latter about the centre of
    mass; ``energy`` is the largest |change of kinetic energy - work of the torques|, relative to
    ``peak_kinetic_energy`` J, and NaN if nothing moved.
    """

    linear_momentum: float
    angular_momentum: float
    energy: float
    peak_kinetic_energy: float


@dataclass(frozen=True)
class IkOutcomes:
    """How many inverse-kinematics solves a run asked for, and how many did not converge."""

    solves: int
    failures: int


def physics_residuals(run: RunData) -> PhysicsResiduals:
    """Return how far momenta and energy were from what they must be."""
    peak = largest(run.kinetic_energy)
    return PhysicsResiduals(
        linear_momentum=largest(lengths(run.linear_momentum)),
        angular_momentum=largest(lengths(run.angular_momentum)),
        energy=largest(np.abs(energy_residual(run).values)) / peak if peak > 0.0 else nan,
        peak_kinetic_energy=peak,
    )


def ik_outcomes(run: RunData) -> IkOutcomes:
    """Return how the inverse-kinematics solves of a run ended."""
    asked = run.ik_status != _NOT_ASKED
    failed = asked & (run.ik_status != _CONVERGED)
    return IkOutcomes(int(np.count_nonzero(asked)), int(np.count_nonzero(failed)))
