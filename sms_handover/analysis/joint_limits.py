"""How far the joints of a run kept to the limits of their positions and rates."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.model.floating_model import joint_columns
from sms_handover.run_data import RunData
from sms_handover.types import BASE_NQ, BASE_NV, Array
from sms_handover.units import ns_to_seconds


@dataclass(frozen=True)
class JointExtreme:
    """The joint that made the most of its limit, by how much, when, and for how long any joint was beyond.

    ``value`` is a share of the limit for rates, and rad beyond the nearer limit for positions (negative
    inside). ``beyond`` is in s.
    """

    joint: str
    value: float
    stamp_ns: int
    beyond: float


@dataclass(frozen=True)
class LimitUse:
    """What a run made of the joints' limits: largest share of a rate limit, farthest position."""

    rate: JointExtreme
    position: JointExtreme

    @property
    def kept(self) -> bool:
        """Whether no joint was beyond a limit."""
        return self.rate.value <= 1.0 and self.position.value <= 0.0


def limit_use(run: RunData, model: pin.Model) -> LimitUse:
    """Return what a run made of the limits in a description; raises UnknownNameError on a joint it lacks."""
    columns = np.array(joint_columns(model, run.joint_names))
    rate_limit = model.velocityLimit[columns - BASE_NQ + BASE_NV]
    lower, upper = model.lowerPositionLimit[columns], model.upperPositionLimit[columns]
    shares = np.abs(run.joint_velocity) / rate_limit
    beyond = np.maximum(run.joint_position - upper, lower - run.joint_position)
    return LimitUse(_extreme(run, shares, 1.0), _extreme(run, beyond, 0.0))


def _extreme(run: RunData, values: Array, limit: float) -> JointExtreme:
    """Return the largest value (N, n) with its joint and time, and how long one was above a limit."""
    tick, joint = np.unravel_index(np.nanargmax(values), values.shape)
    above = np.nanmax(values, axis=1) > limit
    duration = ns_to_seconds(int(np.diff(run.tick_ns, append=run.tick_ns[-1])[above].sum()))
    return JointExtreme(run.joint_names[joint], float(values[tick, joint]), int(run.tick_ns[tick]), duration)
