"""Parameters of the IK solver."""

from dataclasses import dataclass

from sms_handover.configuration.parameters import parameter


@dataclass(frozen=True)
class IkParameters:
    """Stopping and damping of the solver; the numbers are in ``config/ik.yaml``."""

    position_tolerance: float = parameter("converged below this position error", unit="m", minimum=1e-12)
    orientation_tolerance: float = parameter(
        "converged below this orientation error", unit="rad", minimum=1e-12
    )
    damping_bias: float = parameter(
        "constant part of the damping, added to the error energy", unit="", minimum=0.0
    )
    max_iterations: int = parameter("iterations before the solver gives up", minimum=1)
    stall_step: float = parameter(
        "stalled when no joint moves more than this in an iteration", unit="rad", minimum=0.0
    )
