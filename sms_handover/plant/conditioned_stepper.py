"""Conditioned stepper: steps of the robot under friction and under wrenches from outside."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sms_handover.conditions.wrench import WrenchModel
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.external_wrenches import (
    Companion,
    ExternalAccount,
    WrenchStepper,
    robot_as_body,
    sum_over,
)
from sms_handover.plant.integrators import Tableau
from sms_handover.plant.joint_friction import JointFriction
from sms_handover.plant.stepper import Stepper
from sms_handover.types import Array, frozen
from sms_handover.units import ns_to_seconds


@dataclass(frozen=True, eq=False)
class Resistance:
    """What acts within a tick beside the motors: friction of the joints, wrenches on the base."""

    friction: JointFriction | None
    wrenches: Sequence[WrenchModel]


class ResistedStepper(ABC):
    """Steps in which something acts beside the motors, and what came of the latest one."""

    @abstractmethod
    def begin(self, start_ns: int) -> None:
        """Tell when the next step begins."""

    @abstractmethod
    def step(self, q: Array, v: Array, effort: Array) -> tuple[Array, Array]:
        """Return q (7 + n,) and v (6 + n,) after a step under joint efforts (n,), as read-only arrays."""

    @property
    @abstractmethod
    def lost(self) -> float:
        """Energy in J that friction has taken in the latest step: -tau . dq, exact as tau is held."""

    @abstractmethod
    def given(self, before: ExternalAccount, companion: Companion | None = None) -> ExternalAccount:
        """Return an account of what wrenches have given, after the latest step."""


class ConditionedStepper(ResistedStepper):
    """Steps of ``h`` s by another stepper, with friction torques held over the step, and wrenches.

    Under wrenches the step is that of :class:`~sms_handover.plant.external_wrenches.WrenchStepper`. Of the
    latest step it knows what friction has taken and what the wrenches have given. Not thread-safe.
    """

    def __init__(
        self, robot: RobotModel, resistance: Resistance, inner: Stepper, tableau: Tableau, h: float
    ) -> None:
        self._robot, self._resistance, self._inner, self._h = robot, resistance, inner, h
        self._under_wrench = WrenchStepper(robot, tableau, h) if resistance.wrenches else None
        self._generalized = np.zeros(robot.pin.nv)
        self._start_s = 0.0
        self._start = self._end = (np.zeros(0), np.zeros(0))
        self._friction: Array | None = None

    def begin(self, start_ns: int) -> None:
        """Tell when the next step begins."""
        self._start_s = ns_to_seconds(start_ns)

    def step(self, q: Array, v: Array, effort: Array) -> tuple[Array, Array]:
        """Return q (7 + n,) and v (6 + n,) after a step under joint efforts (n,), as read-only arrays."""
        robot, resistance, under_wrench = self._robot, self._resistance, self._under_wrench
        generalized = self._generalized
        generalized[BASE_NV:] = effort
        wrench = None
        if under_wrench:
            body = robot_as_body(robot, q, v)
            wrench = sum_over(resistance.wrenches, self._start_s, self._h, body)
            generalized[:3] = body.rotation.T @ wrench.force
            generalized[3:BASE_NV] = body.rotation.T @ wrench.torque
        total, self._friction = effort, None
        if resistance.friction:
            self._friction = resistance.friction.torque(robot, q, v, generalized)
            total = frozen(effort + self._friction)
        if under_wrench and wrench:
            end = under_wrench.step(q, v, total, wrench)
        else:
            end = self._inner.step(q, v, total)
        self._start, self._end = (q, v), end
        return end

    @property
    def lost(self) -> float:
        """Energy in J that friction has taken in the latest step: -tau . dq, exact as tau is held."""
        if self._friction is None:
            return 0.0
        lost = 0.0
        for part in (self._friction * (self._end[0] - self._start[0])[BASE_NQ:]).tolist():
            lost -= part
        return lost

    def given(self, before: ExternalAccount, companion: Companion | None = None) -> ExternalAccount:
        """Return an account of what wrenches have given, after the latest step."""
        if self._under_wrench is None:
            return before
        return self._under_wrench.given(self._start, self._end, before, companion)
