"""Compensation: computed torque with integral action, feed-forward of friction, and observed disturbances."""

from dataclasses import dataclass

import numpy as np

from sms_handover.control.computed_torque import TrackingEfforts
from sms_handover.control.disturbance_observer import DisturbanceObserver
from sms_handover.control.friction_feed_forward import FrictionFeedForward
from sms_handover.control.integral_action import IntegralAction
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import BASE_NQ, BASE_NV, Array, read_only


@dataclass(frozen=True)
class Compensation:
    """What compensates for what a model does not know; each is None where it is not wanted.

    ``bandwidth`` is that of the observer of disturbances, 1/s; ``dt`` s is the tick.
    """

    dt: float
    integral: IntegralAction | None = None
    friction: FrictionFeedForward | None = None
    bandwidth: float | None = None

    @property
    def any(self) -> bool:
        """Whether there is something to compensate with."""
        return bool(self.integral or self.friction or self.bandwidth)


class CompensatedTorque:
    """Computed torque of q_d'' - y, plus the believed friction, less what is observed beyond it.

    With y of the integral action, tau_f of the feed-forward and the effect r of the observer,

        u = H*(q_d'' - y - a_1 e - a_2 e') + c* + tau_f - r.

    The observer is told u - tau_f: it observes what friction is left, so that nothing is compensated twice.
    Efforts are taken to act as far as joints can give them. It has to be called once each tick; not
    thread-safe.
    """

    def __init__(self, robot: RobotModel, efforts: TrackingEfforts, compensation: Compensation) -> None:
        """Compensate the computed torque of a robot."""
        self._robot, self._efforts = robot, efforts
        self._integral, self._friction = compensation.integral, compensation.friction
        self._action: Array = np.zeros(robot.n_joints)  # [rad/s^2]
        self._observer: DisturbanceObserver | None = None
        if compensation.bandwidth:
            self._observer = DisturbanceObserver(robot, compensation.bandwidth, compensation.dt)

    @property
    def observer(self) -> DisturbanceObserver | None:
        """The observer of disturbances."""
        return self._observer

    @property
    def action(self) -> Array:
        """The integral action y (n,) rad/s^2."""
        return read_only(self._action)

    @property
    def memory(self) -> Array:
        """What later efforts depend on, as one array: the integral action, then that of the observer."""
        parts = [self._action] if self._observer is None else [self._action, self._observer.memory]
        return read_only(np.concatenate(parts))

    def restore(self, memory: Array) -> None:
        """Go back to a former :attr:`memory`; an empty one is that of the start of a run."""
        n = self._robot.n_joints
        self._action = np.array(memory[:n]) if memory.size else np.zeros(n)
        if self._observer:
            self._observer.restore(memory[n:])

    def go_on_from(self, before: "CompensatedTorque") -> None:
        """Take over what was found while the robot carried something else."""
        self._action = before._action
        if self._observer and before._observer:
            self._observer.begin_with(before._observer.estimate)

    def __call__(self, q: Array, v: Array, desired: Array, feedback: Array) -> Array:
        """Return the joint efforts (n,) N m, not limited."""
        aimed = desired
        if self._integral:
            aimed = np.array(desired)
            aimed[2] -= self._action
        wanted = self._efforts(q, v, aimed, feedback)
        believed = self._friction.torque(desired[1]) if self._friction else np.zeros(len(wanted))
        wanted = wanted + believed
        if self._observer:
            wanted = wanted - self._observer.joint_effect(q, v)
        given = self._robot.limited(wanted)
        if self._observer:
            self._observer.act(q, v, given - believed)
        if self._integral:
            errors = np.array([q[BASE_NQ:] - desired[0], v[BASE_NV:] - desired[1]])
            pull = np.add.reduce(feedback * errors)
            self._action = self._integral.advanced(self._action, pull, wanted, given)
        return wanted


def memory_of(efforts: TrackingEfforts) -> Array:
    """Return the memory of computed torque, empty where nothing is compensated."""
    return efforts.memory if isinstance(efforts, CompensatedTorque) else np.zeros(0)


def restore_memory(efforts: TrackingEfforts, memory: Array) -> None:
    """Take computed torque back to a former memory."""
    if isinstance(efforts, CompensatedTorque):
        efforts.restore(memory)


def continued(efforts: TrackingEfforts, before: TrackingEfforts) -> TrackingEfforts:
    """Return the computed torque of a robot that carries something else, with what was found before."""
    if isinstance(efforts, CompensatedTorque) and isinstance(before, CompensatedTorque):
        efforts.go_on_from(before)
    return efforts
