"""Stability of the sampled loop in every phase, with what the arms carry then."""

from collections.abc import Sequence
from typing import Any

from sms_handover.control.law import Law
from sms_handover.control.stability import check_stability
from sms_handover.model.known_payload import KnownPayload
from sms_handover.model.robot_model import RobotModel
from sms_handover.trajectory.schedule import Schedule
from sms_handover.types import Array


def check_stability_by_phase(
    law: Law[Any],
    robot: RobotModel,
    schedule: Schedule,
    gains: Sequence[Any],
    dt: float,
    places: Sequence[tuple[Array, str]],
) -> None:
    """Raise UnstableLoopError if the sampled loop of a tick of ``dt`` s diverges in a phase.

    ``gains`` and ``places``, each a configuration (7 + n,) and its name in the error, are by phase. A law
    whose gains do not scale with the inertia, such as PID, is unstable from some mass of the deputy on: the
    loop of a joint with inertia I is stable for K_P K_D > K_I I.
    """
    payload = KnownPayload(robot, schedule.deputy)
    for grip, one, (q, where) in zip(schedule.grips, gains, places, strict=True):
        if payload.has_mass:
            payload.hold(grip)
        held = payload.has_mass and grip.arm
        load = f" with the {schedule.deputy.mass:g} kg of the deputy in {grip.arm}" if held else ""
        check_stability(law, payload.robot, (one,), dt, q, f"{where}{load}")
