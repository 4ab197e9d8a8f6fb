"""The handover task for every engine: track the recorded joint references under NMPC.

References, gains and tick are the same for all; so is the law, u = H*(q_d'' - A1 e - A2 e') + c*. Each
engine works out H and c itself, as its users would.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sms_handover.control.nmpc import NmpcGains
from sms_handover.control.reference_track import ReferenceTrack
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import Scenario
from sms_handover.simulation.wiring import gains_by_phase
from sms_handover.types import BASE_NV, Array, JointReference
from sms_handover.units import ns_to_seconds

State = tuple[Array, Array]  # q (7 + n,) and v (6 + n,) as RobotState has them


@dataclass(frozen=True, eq=False)
class HandoverTask:
    """The references of a recorded run, and where it starts."""

    scenario: Scenario
    run: RunData
    references: tuple[JointReference, ...]
    gains: tuple[NmpcGains, ...]

    @classmethod
    def of(cls, scenario: Scenario, run: RunData) -> "HandoverTask":
        """Return the task of a run of a scenario under NMPC."""
        rows = zip(run.reference_ns.tolist(), run.reference_position, run.reference_velocity, strict=True)
        gains = gains_by_phase(scenario.truth.schedule, scenario.parameters.controller)
        nmpc = tuple(item for item in gains if isinstance(item, NmpcGains))
        return cls(scenario, run, tuple(JointReference(*row) for row in rows), nmpc)

    @property
    def tick_s(self) -> float:
        """The tick in s."""
        return ns_to_seconds(self.scenario.parameters.common.tick_ns)

    @property
    def start(self) -> State:
        """The state at the beginning."""
        run = self.run
        return np.concatenate([run.base_pose[0], run.joint_position[0]]), np.zeros(
            run.base_twist.shape[1] + 14
        )


class Contestant(Protocol):
    """An engine that carries out the task."""

    def period(self, index: int) -> None:
        """Take reference ``index`` and go through its ticks."""

    @property
    def state(self) -> State:
        """The state it is in."""


class NmpcTracker:
    """The law for an engine that gives its own H (6 + n, 6 + n) and c (6 + n,), base rows first."""

    def __init__(self, task: HandoverTask) -> None:
        self._task = task
        self._track = ReferenceTrack()
        self._phase = 0
        self._limit = task.scenario.truth.robot.effort_limit
        self._use(task.gains[0])

    def take(self, index: int) -> int:
        """Take a reference, with the gains of its phase; return its stamp in ns."""
        phase, reference = self._task.run.phases[index].index, self._task.references[index]
        if phase != self._phase:
            self._phase = phase
            self._use(self._task.gains[phase])
            self._track.restart()
        self._track.update(reference)
        return reference.stamp_ns

    def effort(self, stamp_ns: int, q: Array, v: Array, inertia: Array, bias: Array) -> Array:
        """Return the joint efforts (n,) for joint angles and rates (n,)."""
        position, velocity, acceleration = self._track.at(stamp_ns)
        wanted = acceleration - self._a1 * (q - position) - self._a2 * (v - velocity)
        pull = inertia[:, BASE_NV:].dot(wanted) + bias
        yielding = np.linalg.solve(inertia[:BASE_NV, :BASE_NV], pull[:BASE_NV])
        effort = pull[BASE_NV:] - inertia[BASE_NV:, :BASE_NV].dot(yielding)
        limited: Array = np.minimum(np.maximum(effort, -self._limit), self._limit)
        return limited

    def _use(self, gains: NmpcGains) -> None:
        """Go on with other gains."""
        self._a1, self._a2 = gains.position_gain, gains.velocity_gain
