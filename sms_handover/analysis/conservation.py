"""Conservation of momentum and energy over a run, and outcomes of its inverse kinematics."""

from dataclasses import dataclass
from math import nan

import numpy as np

from sms_handover.analysis.numbers import complete, largest, lengths
from sms_handover.analysis.phases import PhaseSpan
from sms_handover.analysis.signals import energy_residual
from sms_handover.graph.message_constants import CONSTANTS
from sms_handover.run_data import Array, RunData
from sms_handover.types import IkStatus

_NOT_ASKED = -1


@dataclass(frozen=True)
class PhysicsResiduals:
    """Largest violation of each conservation law by robot and deputy together in a run.

    ``linear_momentum`` kg m/s and ``angular_momentum`` kg m^2/s, the latter about the centre of mass, are the
    largest changes since the start less what wrenches from outside have given; ``energy`` is the largest
    |change of kinetic energy - work - external work + heat|, relative to ``peak_kinetic_energy`` J, and NaN
    if nothing moved.
    ``external_work`` J was done by wrenches from outside, ``lost`` J has become heat.
    """

    linear_momentum: float
    angular_momentum: float
    energy: float
    peak_kinetic_energy: float
    external_work: float
    lost: float


@dataclass(frozen=True)
class IkOutcomes:
    """How many inverse-kinematics solves a run requested, and how many did not converge.

    ``failures`` are those that ``stalled`` plus those that reached the ``iteration_limit``.
    """

    solves: int
    failures: int
    stalled: int
    iteration_limit: int


def physics_residuals(run: RunData, phase: PhaseSpan | None = None) -> PhysicsResiduals:
    """Return the residuals of momenta and energy in a phase or in the whole run.

    The energy balance of a phase starts at its first sample.
    """
    rows = phase.rows if phase else slice(None)
    peak = largest(run.kinetic_energy[rows])
    residual = energy_residual(run).values[rows, 0]
    known = residual[~np.isnan(residual)]
    return PhysicsResiduals(
        linear_momentum=largest(lengths(_change(run.linear_momentum - run.linear_impulse)[rows])),
        angular_momentum=largest(lengths(_change(run.angular_momentum - run.angular_impulse)[rows])),
        energy=largest(np.abs(known - known[:1])) / peak if peak > 0.0 else nan,
        peak_kinetic_energy=peak,
        external_work=_increase(run.external_work[rows]),
        lost=_increase(run.lost[rows]),
    )


def _change(rows: Array) -> Array:
    """Return rows less the first one that is known."""
    known = rows[complete(rows)][:1]
    return rows - known if len(known) else rows


def _increase(rows: Array) -> float:
    """Return how much the last known value is above the first; 0 if none is known."""
    known = rows[~np.isnan(rows)]
    return float(known[-1] - known[0]) if known.size else 0.0


def ik_outcomes(run: RunData, phase: PhaseSpan | None = None) -> IkOutcomes:
    """Return the outcomes of the inverse-kinematics solves in a phase or in the whole run."""
    status = run.ik_status[phase.rows if phase else slice(None)]
    of_kind = {kind: int(np.count_nonzero(status == CONSTANTS[kind])) for kind in IkStatus}
    solves = int(np.count_nonzero(status != _NOT_ASKED))
    return IkOutcomes(
        solves=solves,
        failures=solves - of_kind[IkStatus.CONVERGED],
        stalled=of_kind[IkStatus.STALLED],
        iteration_limit=of_kind[IkStatus.ITERATION_LIMIT],
    )
