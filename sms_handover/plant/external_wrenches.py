"""External wrenches on the base: steps of the robot under them, and what they give to it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.conditions.wrench import BodyAtInstant, Wrench, WrenchModel, cross
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.integrators import LieGroupIntegrator, Tableau
from sms_handover.types import Array, freeze

_NOTHING = np.zeros(3)


@dataclass(frozen=True, eq=False)
class ExternalAccount:
    """What wrenches from outside have given since the start, in ``world`` axes.

    Linear impulse (3,) N s, angular impulse (3,) N m s about the centre of mass of robot and deputy, and work
    in J.
    """

    linear_impulse: Array
    angular_impulse: Array
    work: float

    def __post_init__(self) -> None:
        freeze(self, "linear_impulse", "angular_impulse")


@dataclass(frozen=True, eq=False)
class Companion:
    """A body that floats beside the robot and counts to the same system: it moves as if alone.

    ``mass`` kg, ``centre`` (3,) m of mass in ``world`` at the start of a step, and its velocity (3,) m/s.
    """

    mass: float
    centre: Array
    velocity: Array


NO_ACCOUNT = ExternalAccount(_NOTHING, _NOTHING, 0.0)


def robot_as_body(robot: RobotModel, q: Array, v: Array) -> BodyAtInstant:
    """Return the robot as one body, with the inertia of all its links."""
    pin.ccrba(robot.pin, robot.data, q, v)
    composite = robot.data.Ig
    rotation = pin.Quaternion(q[3:BASE_NQ]).toRotationMatrix()
    return BodyAtInstant(q[:3], rotation, composite.mass, np.array(robot.data.com[0]), composite.inertia)


def sum_over(models: Sequence[WrenchModel], start_s: float, tick_s: float, body: BodyAtInstant) -> Wrench:
    """Return the sum of some wrenches over a tick, in their order."""
    force, torque = _NOTHING, _NOTHING
    for model in models:
        wrench = model.over(start_s, tick_s, body)
        force, torque = force + wrench.force, torque + wrench.torque
    return Wrench(force, torque)


class WrenchStepper:
    """Steps of ``h`` s of H v' + c = (w, u) under a wrench w on the base, held in ``world`` axes.

    Not thread-safe.
    """

    def __init__(self, robot: RobotModel, tableau: Tableau, h: float) -> None:
        self._model, self._data, self._h = robot.pin, robot.data, h
        self._integrator = LieGroupIntegrator(robot.pin, tableau, h)
        self._generalized = np.zeros(robot.pin.nv)
        self._wrench = Wrench(_NOTHING, _NOTHING)

    def step(self, q: Array, v: Array, effort: Array, wrench: Wrench) -> tuple[Array, Array]:
        """Return q (7 + n,) and v (6 + n,) after a step under joint efforts (n,), as read-only arrays."""
        self._generalized[BASE_NV:], self._wrench = effort, wrench
        return self._integrator.step(self._acceleration, q, v)

    def given(
        self,
        start: tuple[Array, Array],
        end: tuple[Array, Array],
        before: ExternalAccount,
        companion: Companion | None = None,
    ) -> ExternalAccount:
        """Return an account after the last step, from q and v at its ends.

        The linear impulse is F h and the work of the force F . dp, exactly; what depends on the lever of the
        force and on the turn of the base is integrated with both ends and their derivatives, which is exact
        to order 4:  int x dt = h (x_0 + x_1) / 2 + h^2 (x'_0 - x'_1) / 12.
        """
        force, torque = self._wrench.force, self._wrench.torque
        (lever_0, turn_0), (lever_1, turn_1) = (
            self._lever_and_turn(*at, companion, after) for at, after in ((start, 0.0), (end, self._h))
        )
        angular = self._h * torque + cross(self._integral(lever_0, lever_1), force)
        moved = end[0][:3] - start[0][:3]
        work = float(force @ moved) + float(torque @ self._integral(turn_0, turn_1))
        return ExternalAccount(
            before.linear_impulse + self._h * force, before.angular_impulse + angular, before.work + work
        )

    def _acceleration(self, q: Array, v: Array) -> Array:
        """Return v' (6 + n,)."""
        to_base = pin.Quaternion(q[3:BASE_NQ]).toRotationMatrix().T
        self._generalized[:3] = to_base @ self._wrench.force
        self._generalized[3:BASE_NV] = to_base @ self._wrench.torque
        result: Array = pin.aba(self._model, self._data, q, v, self._generalized, pin.Convention.WORLD)
        return result

    def _lever_and_turn(
        self, q: Array, v: Array, companion: Companion | None, after: float
    ) -> tuple[Array, Array]:
        """Return the base's origin less the centre of mass, and its angular velocity: (2, 3), with rates.

        ``after`` s of the step have passed.
        """
        rotation = pin.Quaternion(q[3:BASE_NQ]).toRotationMatrix()
        turning = rotation @ self._acceleration(q, v)[3:BASE_NV]
        pin.centerOfMass(self._model, self._data, q, v)
        centre, moving = self._data.com[0], self._data.vcom[0]
        if companion:
            mass = self._data.mass[0]
            shares = mass / (mass + companion.mass), companion.mass / (mass + companion.mass)
            centre = shares[0] * centre + shares[1] * (companion.centre + after * companion.velocity)
            moving = shares[0] * moving + shares[1] * companion.velocity
        lever = np.array([q[:3] - centre, rotation @ v[:3] - moving])
        return lever, np.array([rotation @ v[3:BASE_NV], turning])

    def _integral(self, first: Array, last: Array) -> Array:
        """Return the integral (3,) over the step of what has these values and rates (2, 3) at its ends."""
        result: Array = 0.5 * self._h * (first[0] + last[0]) + self._h**2 / 12.0 * (first[1] - last[1])
        return result
