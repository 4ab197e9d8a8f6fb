"""Disturbance observer: what acts besides the commanded efforts, by the generalised momentum."""

import numpy as np
import pinocchio as pin

from sms_handover.control.computed_torque import TrackingEfforts
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import BASE_NV, Array, read_only


class ObservedTorque:
    """Computed torque less the disturbance that is observed [DeLuca2005].

    With p = H v the momentum obeys p' = C^T v + (0, u) + d. The estimate r = K (p - z), with
    z' = C^T v + (0, u) + r, is d behind a first-order lag: r' = K (d - r). Of d a wrench f_b on the base acts
    on the joints through the base, so u is less r_m - H_bm^T H_b^-1 r_b. Efforts are taken to act as far as
    joints can give them. It has to be called once each tick; not thread-safe.
    """

    def __init__(self, robot: RobotModel, efforts: TrackingEfforts, bandwidth: float, dt: float) -> None:
        """Observe a robot whose efforts change every ``dt`` s, with a bandwidth K in 1/s."""
        self._robot, self._efforts, self._data = robot, efforts, robot.pin.createData()
        self._bandwidth, self._dt = bandwidth, dt
        self.restore(np.zeros(0))

    @property
    def estimate(self) -> Array:
        """The disturbance (6 + n,): wrench on the base in its axes N, N m, and joint torques N m."""
        return read_only(self._estimate)

    @property
    def memory(self) -> Array:
        """What later estimates depend on, as one array; empty before the first call."""
        if not self._begun:
            return np.zeros(0)
        return read_only(np.concatenate([self._integral, self._flow, self._estimate]))

    def restore(self, memory: Array) -> None:
        """Go back to a former :attr:`memory`; an empty one is that of the start of a run."""
        size = self._robot.pin.nv
        self._begun = memory.size > 0
        parts: Array = np.array(memory).reshape(3, size) if self._begun else np.zeros((3, size))
        self._integral: Array = parts[0]
        self._flow: Array = parts[1]
        self._estimate: Array = parts[2]

    def __call__(self, q: Array, v: Array, desired: Array, feedback: Array) -> Array:
        """Return the joint efforts (n,) N m, not limited."""
        model, data = self._robot.pin, self._data
        inertia = np.array(pin.crba(model, data, q, pin.Convention.LOCAL))
        momentum = inertia @ v
        if self._begun:
            self._integral = self._integral + self._dt * (self._flow + self._estimate)
        else:
            self._integral, self._begun = momentum, True
        self._estimate = self._bandwidth * (momentum - self._integral)
        base, coupling = inertia[:BASE_NV, :BASE_NV], inertia[:BASE_NV, BASE_NV:]
        through_base = coupling.T @ np.linalg.solve(base, self._estimate[:BASE_NV])
        efforts: Array = self._efforts(q, v, desired, feedback) - self._estimate[BASE_NV:] + through_base
        self._flow = np.array(pin.computeCoriolisMatrix(model, data, q, v)).T @ v
        self._flow[BASE_NV:] += self._robot.limited(efforts)
        return efforts


def memory_of(efforts: TrackingEfforts) -> Array:
    """Return the memory of computed torque, empty where nothing is observed."""
    return efforts.memory if isinstance(efforts, ObservedTorque) else np.zeros(0)


def restore_memory(efforts: TrackingEfforts, memory: Array) -> None:
    """Take computed torque back to a former memory."""
    if isinstance(efforts, ObservedTorque):
        efforts.restore(memory)
