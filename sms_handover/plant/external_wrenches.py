"""External wrenches on a robot and on what it holds: steps under them, and what they give to it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.conditions.wrench import BodyAtInstant, Wrench, WrenchModel, cross
from sms_handover.model.robot_model import BASE_NQ, BASE_NV
from sms_handover.model.springs import Springs
from sms_handover.plant.held_body import HeldBody, LeverArm
from sms_handover.plant.integrators import LieGroupIntegrator, Tableau
from sms_handover.types import Array, freeze

NO_FORCE = np.zeros(3)  # N


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
    """A body that floats beside another and counts to the same system: no forces act between the two.

    ``mass`` kg, ``centre`` (3,) m of mass in ``world`` at the start of a step, and its velocity (3,) m/s;
    ``force`` (3,) N acts on it over the step, in ``world`` axes.
    """

    mass: float
    centre: Array
    velocity: Array
    force: Array

    def at(self, after: float) -> tuple[Array, Array]:
        """Return centre of mass and its velocity after so many s of the step."""
        gained = after / self.mass * self.force
        return self.centre + after * (self.velocity + 0.5 * gained), self.velocity + gained


NO_ACCOUNT = ExternalAccount(NO_FORCE, NO_FORCE, 0.0)


@dataclass(frozen=True, eq=False)
class Acting:
    """The wrenches of a tick: on the base, and on what a hand holds; at least one of them."""

    base: Wrench | None
    held: Wrench | None

    @property
    def force(self) -> Array:
        """The sum of the forces (3,) N."""
        forces = [wrench.force for wrench in (self.base, self.held) if wrench]
        result: Array = sum(forces[1:], forces[0])
        return result


def robot_as_body(model: pin.Model, data: pin.Data, q: Array, v: Array) -> BodyAtInstant:
    """Return a robot as one body, with the inertia of all its links."""
    pin.ccrba(model, data, q, v)
    composite = data.Ig
    rotation = pin.Quaternion(q[3:BASE_NQ]).toRotationMatrix()
    return BodyAtInstant(q[:3], rotation, composite.mass, np.array(data.com[0]), composite.inertia)


def companion_of(model: pin.Model, data: pin.Data, at: tuple[Array, Array], force: Array) -> Companion:
    """Return a robot or body at q and v, with the force (3,) N on it, as the companion of another."""
    pin.centerOfMass(model, data, *at)
    return Companion(float(data.mass[0]), np.array(data.com[0]), np.array(data.vcom[0]), force)


def sum_over(models: Sequence[WrenchModel], start_s: float, tick_s: float, body: BodyAtInstant) -> Wrench:
    """Return the sum of some wrenches over a tick, in their order."""
    return sum((model.over(start_s, tick_s, body) for model in models), Wrench(NO_FORCE, NO_FORCE))


class WrenchStepper:
    """Steps of ``h`` s of H v' + c = (w, u) + J^T w_h under wrenches held in ``world`` axes.

    w acts on the base, w_h on what a hand holds, whose Jacobian is J. Not thread-safe.
    """

    def __init__(
        self,
        model: pin.Model,
        data: pin.Data,
        tableau: Tableau,
        h: float,
        held: HeldBody | None = None,
        springs: Springs | None = None,
    ) -> None:
        self._model, self._data, self._h = model, data, h
        self._held, self._springs = held, springs
        self._integrator = LieGroupIntegrator(model, tableau, h)
        self._generalized = np.zeros(model.nv)
        self._effort = np.zeros(model.nv - BASE_NV)
        self._acting: Acting | None = None

    def step(self, q: Array, v: Array, effort: Array, acting: Acting) -> tuple[Array, Array]:
        """Return q (7 + n,) and v (6 + n,) after a step under joint efforts (n,), as read-only arrays."""
        self._effort, self._acting = effort, acting
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
        force and on the turn of the body is integrated with both ends and their derivatives, which is exact
        to order 4:  int x dt = h (x_0 + x_1) / 2 + h^2 (x'_0 - x'_1) / 12.
        """
        if self._acting is None:
            return before
        linear, angular, work = before.linear_impulse, before.angular_impulse, before.work
        first, last = (self._arms_at(*at, companion, after) for at, after in ((start, 0.0), (end, self._h)))
        wrenches = (self._acting.base, self._acting.held)
        for wrench, arm_0, arm_1 in zip(wrenches, first, last, strict=True):
            if wrench and arm_0 and arm_1:
                moment = cross(self._integral(arm_0.lever, arm_1.lever), wrench.force)
                linear = linear + self._h * wrench.force
                angular = angular + (self._h * wrench.torque + moment)
                turned = float(wrench.torque @ self._integral(arm_0.turn, arm_1.turn))
                work = work + (float(wrench.force @ (arm_1.origin - arm_0.origin)) + turned)
        return ExternalAccount(linear, angular, work)

    def forces(self, q: Array, v: Array, effort: Array, acting: Acting) -> Array:
        """Return the generalized forces (6 + n,) of joint efforts, springs and wrenches at a state."""
        generalized = self._generalized
        generalized[:BASE_NV], generalized[BASE_NV:] = 0.0, effort
        if self._springs:
            generalized[-len(self._springs) :] = self._springs.torque(q, v)
        if acting.base:
            to_base = pin.Quaternion(q[3:BASE_NQ]).toRotationMatrix().T
            generalized[:3] = to_base @ acting.base.force
            generalized[3:BASE_NV] = to_base @ acting.base.torque
        if acting.held and self._held:
            generalized += self._held.generalized(self._model, self._data, q, acting.held)
        return generalized

    def _acceleration(self, q: Array, v: Array) -> Array:
        """Return v' (6 + n,)."""
        assert self._acting is not None
        forces = self.forces(q, v, self._effort, self._acting)
        result: Array = pin.aba(self._model, self._data, q, v, forces, pin.Convention.WORLD)
        return result

    def _arms_at(
        self, q: Array, v: Array, companion: Companion | None, after: float
    ) -> tuple[LeverArm, LeverArm | None]:
        """Return where base and held body are from the centre of mass, and how they turn.

        ``after`` s of the step have passed.
        """
        rotation = pin.Quaternion(q[3:BASE_NQ]).toRotationMatrix()
        acceleration = self._acceleration(q, v)
        turning = rotation @ acceleration[3:BASE_NV]
        pin.centerOfMass(self._model, self._data, q, v)
        centre, moving = self._data.com[0], self._data.vcom[0]
        if companion:
            mass = self._data.mass[0]
            shares = mass / (mass + companion.mass), companion.mass / (mass + companion.mass)
            beside, passing = companion.at(after)
            centre = shares[0] * centre + shares[1] * beside
            moving = shares[0] * moving + shares[1] * passing
        lever = np.array([q[:3] - centre, rotation @ v[:3] - moving])
        base = LeverArm(q[:3], lever, np.array([rotation @ v[3:BASE_NV], turning]))
        centre, moving = np.array(centre), np.array(moving)
        at = (q, v, acceleration)
        held = self._held.lever_arm(self._model, self._data, at, (centre, moving)) if self._held else None
        return base, held

    def _integral(self, first: Array, last: Array) -> Array:
        """Return the integral (3,) over the step of what has these values and rates (2, 3) at its ends."""
        result: Array = 0.5 * self._h * (first[0] + last[0]) + self._h**2 / 12.0 * (first[1] - last[1])
        return result
