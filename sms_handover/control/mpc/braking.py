"""Braking: the plan that brings the joints to rest with constant decelerations, within the effort limits."""

import numpy as np

from sms_handover.control.mpc.horizon import Horizon
from sms_handover.control.mpc.plan import Plan
from sms_handover.control.mpc.planner import PlanStart
from sms_handover.control.mpc.prediction import PredictionModel
from sms_handover.types import Array

_SHORTEST = 0.2  # [s] in which joints are brought to rest where efforts allow it
_DOUBLINGS = 8  # [-] of that time: 51 s is long enough for any arm with an effort limit to speak of
_INTERVALS = 8  # [-] of the plan, at whose beginnings efforts are looked at


def braking_plan(
    model: PredictionModel, start: PlanStart, effort_limit: Array, number: int, begin_ns: int
) -> Plan:
    """Return the shortest of some plans that end at rest and need no more than a limit (n,) N m.

    All joints decelerate from rates w to 0 in the same time. If none keeps the limit it is the longest.
    """
    rest = np.abs(start.w).max(initial=0.0) == 0.0
    for doubling in range(1 if rest else _DOUBLINGS + 1):
        time = _SHORTEST * 2.0**doubling
        horizon = Horizon(np.full(_INTERVALS, time / _INTERVALS))
        accelerations = np.tile(-start.w / time, (_INTERVALS, 1))
        prediction = model.predict(horizon, start.base, start.q, start.w, accelerations)
        if (np.abs(prediction.effort) <= effort_limit).all():
            break
    return Plan(number, begin_ns, start.q, start.w, accelerations, horizon.intervals)
