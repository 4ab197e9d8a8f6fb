"""Law ``mpc``: predictive control of robot and base under constraints."""

import numpy as np

from sms_handover.control.law import Law, LawSetup, LinearFeedback, Need
from sms_handover.control.mpc.controller import MpcController
from sms_handover.control.mpc.parameters import MpcGains
from sms_handover.control.mpc.real_time import MpcInRealTime
from sms_handover.types import Array


def linearised(gains: MpcGains, inertia: Array) -> LinearFeedback:
    """Return the feedback about a plan: K_e = k_p H*, K_v = k_v H*, K_z = 0."""
    none = np.zeros_like(inertia)
    return LinearFeedback(gains.plan_position_gain * inertia, gains.plan_velocity_gain * inertia, none)


def _controller(setup: LawSetup[MpcGains]) -> MpcController:
    """Return the controller of a setup; raises what it does."""
    return MpcController(setup) if setup.start_solver is None else MpcInRealTime(setup)


MPC = Law(
    "mpc",
    "predictive control that keeps limits of efforts, rates, attitude and distances",
    MpcGains,
    _controller,
    linearised,
    frozenset({Need.TOOL_TARGETS, Need.PREVIEW, Need.PAYLOAD, Need.CLEARANCE}),
)
