"""Drift of targets from where a preview expects them, also where they jump as a measured deputy does."""

from math import exp

import pinocchio as pin

from sms_handover.model.poses import se3_of
from sms_handover.types import Pose, Twist

_TIME_CONSTANT = 0.3  # [s] of the low pass, less than a horizon; own choice


def change_of(before: Pose, now: Pose, since: float) -> Twist:
    """Return the twist in ``world`` axes by which a shift and a turn have changed in ``since`` > 0 s."""
    turned = pin.log3(se3_of(now).rotation @ se3_of(before).rotation.T)
    return Twist((now.position - before.position) / since, turned / since)


def low_passed(before: Twist, now: Twist, since: float, elapsed: float) -> Twist:
    """Return the mean of ``elapsed`` s, and later a low pass of the first order, ``since`` s after the last.

    A deputy that is seen jumps by some mm from one measurement to the next. The change of one period, gone on
    with over a horizon of a hundred periods, would lead the tools past it by as much as that.
    """
    share = max(1.0 - exp(-since / _TIME_CONSTANT), since / elapsed)
    linear = before.linear + share * (now.linear - before.linear)
    return Twist(linear, before.angular + share * (now.angular - before.angular))
