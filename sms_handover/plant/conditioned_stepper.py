"""Conditioned stepper: steps of the robot under friction and under wrenches from outside."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sms_handover.conditions.wrench import WrenchModel
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.external_wrenches import (
    NO_FORCE,
    Acting,
    Companion,
    ExternalAccount,
    WrenchStepper,
    companion_of,
)
from sms_handover.plant.integrators import Tableau
from sms_handover.plant.joint_friction import JointFriction
from sms_handover.plant.outside_wrenches import OutsideWrenches
from sms_handover.plant.stepper import Stepper
from sms_handover.types import Array, BaseWrench, frozen
from sms_handover.units import ns_to_seconds


@dataclass(frozen=True, eq=False)
class Resistance:
    """What acts within a tick beside the motors: friction of the joints, wrenches on base and deputy."""

    friction: JointFriction | None
    wrenches: Sequence[WrenchModel]
    deputy_wrenches: Sequence[WrenchModel] = ()


class ResistedStepper(ABC):
    """Steps in which something acts beside the motors, and what came of the latest one."""

    @abstractmethod
    def begin(self, start_ns: int, asked: BaseWrench | None = None) -> None:
        """Tell when the next step begins, and which wrench on the base others ask for in it."""

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
        self._outside = OutsideWrenches(robot, resistance.wrenches, resistance.deputy_wrenches, h)
        self._under_wrench = WrenchStepper(
            robot.pin, robot.data, tableau, h, self._outside.held, robot.springs
        )
        self._generalized = np.zeros(robot.pin.nv)
        self._start_s = 0.0
        self._asked: BaseWrench | None = None
        self.acting: Acting | None = None
        self._start = self._end = (np.zeros(0), np.zeros(0))
        self._friction: Array | None = None

    def begin(self, start_ns: int, asked: BaseWrench | None = None) -> None:
        """Tell when the next step begins, and which wrench on the base others ask for in it."""
        self._start_s, self._asked = ns_to_seconds(start_ns), asked

    def step(self, q: Array, v: Array, effort: Array) -> tuple[Array, Array]:
        """Return q (7 + n,) and v (6 + n,) after a step under joint efforts (n,), as read-only arrays."""
        robot, under_wrench = self._robot, self._under_wrench
        generalized, friction = self._generalized, self._resistance.friction
        generalized[BASE_NV:] = effort
        if robot.springs:
            generalized[-len(robot.springs) :] = robot.springs.torque(q, v)
        acting = self.acting = self._outside.over(self._start_s, q, v, self._asked)
        if acting:
            generalized = under_wrench.forces(q, v, effort, acting)
        total, self._friction = effort, None
        if friction:
            self._friction = friction.torque(robot, q, v, generalized)
            total = frozen(effort + self._friction)
        end = under_wrench.step(q, v, total, acting) if acting else self._inner.step(q, v, total)
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

    @property
    def as_companion(self) -> Companion:
        """The robot as the companion of a deputy that floats, as the latest step began."""
        force = self.acting.force if self.acting else NO_FORCE
        return companion_of(self._robot.pin, self._robot.data, self._start, force)

    def given(self, before: ExternalAccount, companion: Companion | None = None) -> ExternalAccount:
        """Return an account of what wrenches have given, after the latest step."""
        if self.acting is None:
            return before
        return self._under_wrench.given(self._start, self._end, before, companion)
