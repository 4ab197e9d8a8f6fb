"""Constraints of a plan: rows with a name, a unit and a limit, hard or soft.

A soft row may be exceeded at a price, and by how much is reported. What is exceeded where the plan begins has
to be back at its limit at the end of the horizon, linearly in time, so that a start outside is no infeasible
program and no violent motion either.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sms_handover.control.mpc.distance_rows import DistanceRows
from sms_handover.control.mpc.horizon import Horizon
from sms_handover.control.mpc.parameters import MpcGains
from sms_handover.control.mpc.prediction import Derivatives, Prediction
from sms_handover.control.mpc.sensitivity import Sensitivity
from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.types import Array

_AXES = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class Constraint:
    """Rows low <= value + matrix da <= high, R of them, for changes da (N n,) of the accelerations.

    ``limit_low`` and ``limit_high`` are what they are to keep; ``low`` and ``high`` may be wider where the
    plan begins outside. ``scale`` is what an excess is compared with where rows of different units are.
    """

    names: tuple[str, ...]
    value: Array
    matrix: Array
    low: Array
    high: Array
    limit_low: Array
    limit_high: Array
    scale: Array
    soft: bool


class Limits:
    """The limits of a robot under a set of parameters, turned into rows about a prediction."""

    def __init__(self, robot: RobotModel, gains: MpcGains, initial_rotation: Array) -> None:
        """Keep the attitude about an initial one (3, 3)."""
        self._gains, self._initial = gains, initial_rotation
        self._joints = robot.joint_names
        self._effort = gains.effort_share * robot.effort_limit
        inside = 1.0 - gains.limit_margin
        own = np.array(robot.pin.velocityLimit[BASE_NV:])
        asked = gains.joint_rate_limit or np.inf
        self._rate = inside * np.minimum(own, asked)
        self._lower, self._upper = robot.lower, robot.upper
        self._base_rate = inside * gains.base_rate_limit
        self._attitude = inside * gains.base_attitude_limit

    def constraints(
        self,
        horizon: Horizon,
        prediction: Prediction,
        sensitivity: Sensitivity,
        distances: DistanceRows | None,
    ) -> list[Constraint]:
        """Return the rows of all limits about a prediction."""
        count, n = horizon.count, len(self._joints)
        found = [self._efforts(prediction, sensitivity, count)]
        later, eye, none = slice(1, count + 1), np.eye(n), np.zeros((n, n))
        by_phi = np.zeros((count, n, 3))
        positions = Derivatives(
            np.broadcast_to(eye, (count, n, n)), np.broadcast_to(none, (count, n, n)), by_phi
        )
        rates = Derivatives(positions.w, positions.q, by_phi)
        left = 1.0 - horizon.times[1:] / horizon.times[-1]

        def soft(names: Sequence[str], values: Array, by: Derivatives, low: Array, high: Array) -> Constraint:
            rows, at = sensitivity.rows(by, later), values[1:]
            over, under = np.maximum(values[0] - high, 0.0), np.maximum(low - values[0], 0.0)
            wide_low, wide_high = low - left[:, None] * under, high + left[:, None] * over
            return _flat(names, at, rows, (wide_low, wide_high), (low, high), is_soft=True)

        found.append(
            soft(
                [f"position of {name}" for name in self._joints],
                prediction.q,
                positions,
                self._lower,
                self._upper,
            )
        )
        found.append(
            soft([f"rate of {name}" for name in self._joints], prediction.w, rates, -self._rate, self._rate)
        )
        if self._base_rate:
            by, limit = prediction.omega_by, np.full(3, self._base_rate)
            some = Derivatives(by.q[later], by.w[later], by.phi[later])
            found.append(
                soft([f"base rate about {axis}" for axis in _AXES], prediction.omega, some, -limit, limit)
            )
        if self._attitude:
            angle, by_turn = self._attitudes(prediction)
            flat = np.zeros((count, 3, n))
            limit, some = np.full(3, self._attitude), Derivatives(flat, flat, by_turn[1:])
            found.append(soft([f"base attitude about {axis}" for axis in _AXES], angle, some, -limit, limit))
        if distances is not None:
            found.append(self._distances(distances, sensitivity, later, left))
        return found

    def _efforts(self, prediction: Prediction, sensitivity: Sensitivity, count: int) -> Constraint:
        """Return the hard rows of joint efforts where each interval begins."""
        rows = sensitivity.rows(prediction.effort_by, slice(0, count))
        limit, names = self._effort, [f"effort of {name}" for name in self._joints]
        return _flat(names, prediction.effort, rows, (-limit, limit), (-limit, limit), is_soft=False)

    def _attitudes(self, prediction: Prediction) -> tuple[Array, Array]:
        """Return the rotation vectors (N + 1, 3) from the initial attitude, and their derivatives by phi."""
        angles, by = np.zeros((len(prediction.phi), 3)), np.zeros((len(prediction.phi), 3, 3))
        for k, phi in enumerate(prediction.phi):
            turned = self._initial.T @ prediction.rotation[k]
            angles[k], by[k] = pin.log3(turned), pin.Jlog3(turned) @ pin.Jexp3(phi)
        return angles, by

    def _distances(
        self, distances: DistanceRows, sensitivity: Sensitivity, later: slice, left: Array
    ) -> Constraint:
        """Return the soft rows of distances."""
        rows = sensitivity.rows(distances.by, later)
        least = distances.least
        high = np.full_like(least, np.inf)
        names = [f"distance {name}" for node in distances.names for name in node]
        flat = rows.reshape(-1, rows.shape[-1])
        wide = (least - left[:, None] * np.maximum(least - distances.at_start, 0.0)).ravel()
        value, low, top = distances.distance.ravel(), least.ravel(), high.ravel()
        scale = np.full_like(low, self._gains.least_distance)
        return Constraint(tuple(names), value, flat, wide, top, low, top, scale, soft=True)


def _flat(
    names: Sequence[str],
    values: Array,
    rows: Array,
    bounds: tuple[Array, Array],
    limits: tuple[Array, Array],
    *,
    is_soft: bool,
) -> Constraint:
    """Return a constraint from values (K, r), rows (K, r, N n), bounds and limits (K, r) or (r,)."""
    low, high = (np.broadcast_to(bound, values.shape).ravel() for bound in bounds)
    limit_low, limit_high = (np.broadcast_to(limit, values.shape).ravel() for limit in limits)
    scale = 0.5 * (limit_high - limit_low)
    every = tuple(names) * len(values)
    flat = rows.reshape(-1, rows.shape[-1])
    return Constraint(every, values.ravel(), flat, low, high, limit_low, limit_high, scale, is_soft)
