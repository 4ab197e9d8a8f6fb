"""Disturbance observer: what acts besides the commanded efforts, by the generalised momentum."""

import numpy as np
import pinocchio as pin

from sms_handover.model.robot_model import RobotModel
from sms_handover.types import BASE_NV, Array, read_only


class DisturbanceObserver:
    """Estimates the disturbance d of p' = C^T v + (0, u) + d, with p = H v [DeLuca2005].

    The estimate r = K (p - z), with z' = C^T v + (0, u) + r, is d behind a first-order lag: r' = K (d - r).
    It has to be asked once each tick, and told the efforts of the tick; not thread-safe.
    """

    def __init__(self, robot: RobotModel, bandwidth: float, dt: float) -> None:
        """Observe a robot whose efforts change every ``dt`` s, with a bandwidth K in 1/s."""
        self._robot, self._data = robot, robot.pin.createData()
        self._bandwidth, self._dt = bandwidth, dt
        self.restore(np.zeros(0))

    @property
    def estimate(self) -> Array:
        """The disturbance (6 + n,): wrench on the base in its axes N, N m, and joint torques N m."""
        return read_only(self._estimate)

    @property
    def memory(self) -> Array:
        """What later estimates depend on, (3 (6 + n),)."""
        return read_only(np.concatenate([self._integral, self._flow, self._estimate]))

    def restore(self, memory: Array) -> None:
        """Go back to a former :attr:`memory`; an empty one is that of the start of a run."""
        size = self._robot.pin.nv
        self._begun = memory.size > 0
        parts: Array = np.array(memory).reshape(3, size) if self._begun else np.zeros((3, size))
        self._integral: Array = parts[0]
        self._flow: Array = parts[1]
        self._estimate: Array = parts[2]

    def begin_with(self, estimate: Array) -> None:
        """Begin with an estimate (6 + n,): what acts stays while the momentum jumps, as at a grasp."""
        self.restore(np.zeros(0))
        self._estimate = np.array(estimate)

    def joint_effect(self, q: Array, v: Array) -> Array:
        """Return what the disturbance does to the joints (n,) N m, directly and through the free base.

        A wrench r_b on the base does H_bm^T H_b^-1 r_b less, so the effect is r_m - H_bm^T H_b^-1 r_b.
        """
        inertia = np.array(pin.crba(self._robot.pin, self._data, q, pin.Convention.LOCAL))
        momentum = inertia @ v
        if self._begun:
            self._integral = self._integral + self._dt * (self._flow + self._estimate)
        else:
            self._integral, self._begun = momentum - self._estimate / self._bandwidth, True
        self._estimate = self._bandwidth * (momentum - self._integral)
        base, coupling = inertia[:BASE_NV, :BASE_NV], inertia[:BASE_NV, BASE_NV:]
        through_base = coupling.T @ np.linalg.solve(base, self._estimate[:BASE_NV])
        effect: Array = self._estimate[BASE_NV:] - through_base
        return effect

    def act(self, q: Array, v: Array, efforts: Array) -> None:
        """Take account of the efforts (n,) N m of the tick that begins at a state."""
        self._flow = np.array(pin.computeCoriolisMatrix(self._robot.pin, self._data, q, v)).T @ v
        self._flow[BASE_NV:] += efforts
