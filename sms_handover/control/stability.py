"""Stability of the sampled loop: whether gains and tick can work together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sms_handover.control.law import G, Law, LinearFeedback
from sms_handover.errors import UnstableLoopError
from sms_handover.model.reduced import reduced_dynamics
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array

ROUNDING = 1e-9  # [-] accuracy of the eigenvalues of the sampled loop


@dataclass(frozen=True)
class LoopStability:
    """Spectral radius of the sampled loop and the joint that moves most in its fastest-growing mode."""

    spectral_radius: float
    joint: str

    @property
    def stable(self) -> bool:
        """Whether every mode decays."""
        return self.spectral_radius < 1.0 - ROUNDING


def sampled_loop(inertia: Array, feedback: LinearFeedback, dt: float) -> Array:
    """Return the transition matrix of (e, e', z) over one tick with the efforts held constant.

    The arms are linearised at rest, e'' = H*^-1 u, which a zero-order hold samples exactly:
    e+ = e + e' dt + H*^-1 u dt^2/2, e'+ = e' + H*^-1 u dt, z+ = z + e dt. Without integral action
    z is omitted: it would only add eigenvalues of one.
    """
    n = inertia.shape[0]
    has_integral = bool(np.any(feedback.integral))
    gains = [feedback.position, feedback.velocity] + ([feedback.integral] if has_integral else [])
    pull = np.linalg.solve(inertia, np.hstack(gains))
    size = pull.shape[1]
    transition = np.eye(size)
    transition[:n, n : 2 * n] = dt * np.eye(n)
    transition[:n] -= 0.5 * dt * dt * pull
    transition[n : 2 * n] -= dt * pull
    if has_integral:
        transition[2 * n :, :n] = dt * np.eye(n)
    return transition


def loop_stability(
    inertia: Array, feedback: LinearFeedback, dt: float, joint_names: Sequence[str]
) -> LoopStability:
    """Return the stability of the sampled loop for the reduced inertia H* (n, n) and a tick of ``dt`` s."""
    values, vectors = np.linalg.eig(sampled_loop(inertia, feedback, dt))
    worst = int(np.argmax(np.abs(values)))
    n = inertia.shape[0]
    share = np.abs(vectors[: 2 * n, worst]).reshape(2, n).max(axis=0)
    return LoopStability(float(np.abs(values[worst])), joint_names[int(np.argmax(share))])


def check_stability(
    law: Law[G],
    robot: RobotModel,
    gains_by_phase: Sequence[G],
    dt: float,
    q: Array,
    where: str = "at the start configuration",
) -> tuple[LoopStability, ...]:
    """Return the stability of the sampled loop of each gain set at rest in q (7 + n,).

    Nothing is known of a law without a linearisation. Raises UnstableLoopError if a loop diverges; ``where``
    names q in its text.
    """
    if law.linearised is None:
        return ()
    inertia = reduced_dynamics(robot, q, np.zeros(robot.pin.nv)).inertia
    found = []
    for gains in gains_by_phase:
        stability = loop_stability(inertia, law.linearised(gains, inertia), dt, robot.joint_names)
        if not stability.stable:
            raise UnstableLoopError(
                f"the loop of {gains} at a tick of {dt:g} s is unstable {where}: "
                f"spectral radius {stability.spectral_radius:.6f}, must be < 1, "
                f"first at {stability.joint}; use a shorter tick or smaller gains"
            )
        found.append(stability)
    return tuple(found)
