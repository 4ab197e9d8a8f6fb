"""Parameters of the trajectory generator."""

from dataclasses import dataclass

from sms_handover.parameters import parameter
from sms_handover.trajectory.time_law import TIME_LAWS


@dataclass(frozen=True)
class TrajectoryParameters:
    """How targets are approached; the numbers are in ``config/trajectory.yaml``."""

    time_law: str = parameter(
        "step: the target jumps when a phase begins; quintic: it moves there from rest to rest",
        choices=tuple(TIME_LAWS),
    )
    jacobian_damping: float = parameter(
        "damping of the generalised Jacobian's inverse near singular configurations", minimum=0.0
    )
