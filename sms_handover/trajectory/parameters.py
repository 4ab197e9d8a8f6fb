"""Parameters of the trajectory generator."""

from dataclasses import dataclass

from sms_handover.configuration.parameters import parameter
from sms_handover.trajectory.time_law import TIME_LAWS


@dataclass(frozen=True)
class TrajectoryParameters:
    """Parameters of the generator; the numbers are in ``config/trajectory.yaml``."""

    time_law: str = parameter(
        "step: the target jumps when a phase begins; quintic: it moves there from rest to rest",
        choices=tuple(TIME_LAWS),
    )
    jacobian_damping: float = parameter(
        "damping of the generalised Jacobian's inverse near singular configurations", minimum=0.0
    )
    ik_failures: int = parameter(
        "reference periods in a row without convergence of inverse kinematics after which the phase has "
        "failed; 0: never",
        minimum=0,
    )
    failure_hold: float = parameter(
        "simulated time for which the joints are held after a phase has failed, before the run ends",
        unit="s",
        minimum=0.0,
        maximum=3600.0,
    )
