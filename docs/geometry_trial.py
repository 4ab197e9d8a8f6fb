"""Trial of a geometry: checks at rest and on straight paths, then the run, which ends where it fails."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf, isnan
from pathlib import Path

import numpy as np

from docs.geometry_candidates import (
    APPROACH,
    ARM_A,
    ARM_B,
    CARRY,
    END_A,
    END_B,
    ORIGIN,
    SIZE,
    WITHDRAW,
    Geometry,
)
from sms_handover.analysis.claims import Claim, judge
from sms_handover.analysis.metrics import measure
from sms_handover.analysis.numbers import largest
from sms_handover.clearance.bodies import BodyKind
from sms_handover.clearance.distances import ClearanceModel
from sms_handover.configuration.yaml_reader import load_mapping
from sms_handover.control.nmpc import NMPC
from sms_handover.control.pid import PID
from sms_handover.errors import ConfigurationError
from sms_handover.model.poses import pose_of, se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.run_data import RunData
from sms_handover.simulation.observed_ticks import Ticks
from sms_handover.simulation.quiet_periods import QuietPeriods
from sms_handover.simulation.scenario import Scenario, World, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.trajectory.load import schedule_of
from sms_handover.trajectory.schedule import Schedule
from sms_handover.types import BASE_NQ, BASE_NV, Array, GraspEvent, GraspStatus, Pose

LAWS = (PID.name, NMPC.name)  # the one that fails more often first
_SHARES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4)  # [-] of a straight joint path; PID overshoots
_NEAR = 0.002  # [m] that a gripper and the deputy stay apart on such a path; 5 mm in a grasp
_APART = 0.03  # [m] that all other bodies stay apart on it


@dataclass(frozen=True, eq=False)
class Attempt:
    """What came of a run under one law, over its reference periods.

    ``failure`` is '' if the task was completed and nothing touched, else what ended the run, in ``phase``;
    ``run`` is there if nothing did. ``least`` is the least distance of two bodies in m, in contact or not,
    and ``rate`` the largest share of a rate limit.
    """

    failure: str
    phase: str
    least: float
    rate: float
    run: RunData | None = None


@dataclass(frozen=True, eq=False)
class Trial:
    """What came of a geometry under both laws.

    Claims and peak torques N m are there if no attempt failed. ``lead`` is by how many s NMPC settles earlier
    than PID in the motion in which it is least.
    """

    attempts: Mapping[str, Attempt]
    claims: tuple[Claim, ...] = ()
    peaks: Mapping[str, float] | None = None
    lead: float = 0.0

    @property
    def failed(self) -> Attempt | None:
        """The attempt that failed, None if none did."""
        return next((attempt for attempt in self.attempts.values() if attempt.failure), None)

    @property
    def least(self) -> float:
        """The least distance of two bodies under either law, m."""
        return min(attempt.least for attempt in self.attempts.values())

    @property
    def rate(self) -> float:
        """The largest share of a rate limit under either law."""
        return max(attempt.rate for attempt in self.attempts.values())


class Bench:
    """What every trial shares: scenario ``paper`` under each law with compiled dynamics, and bodies."""

    def __init__(self) -> None:
        """Load them."""
        values = {"common.dynamics": "compiled"}
        self._scenarios = {law: load_scenario("paper", {**values, "law": law}) for law in LAWS}
        scenario = self._scenarios[LAWS[0]]
        self.robot, self.ik = scenario.model.robot, scenario.parameters.ik
        self._reference_ns = scenario.parameters.common.reference_ns
        self._per_reference = scenario.parameters.common.ticks_per_reference
        robot = self.robot
        self._bodies = ClearanceModel(robot.pin, robot.urdf, robot.arms, np.array(SIZE))
        meet = {BodyKind.GRIPPER, BodyKind.DEPUTY}
        near = [{one.kind, other.kind} == meet for one, other in self._bodies.pairs]
        self._floor = np.where(near, _NEAR, _APART)

    def collides(self, geometry: Geometry) -> str:
        """Return the phase in which bodies come too near each other on straight joint paths, '' if in none.

        The paths go on beyond their ends by as much as a law overshoots; where both arms move, each may be
        anywhere on its own.
        """
        for phase, joints, deputy in self._passed(geometry):
            q = self.robot.configuration(ORIGIN, joints)
            if (self._bodies.distances(q, deputy) < self._floor).any():
                return phase
        return ""

    def schedule(self, text: str) -> Schedule:
        """Return the schedule that a text says; raises ScheduleError."""
        return schedule_of(load_mapping(text, Path("geometry")), text, self.robot, self._reference_ns)

    def trial(self, schedule: Schedule, floor: float = 0.0) -> Trial:
        """Return what comes of a schedule under both laws; ends where bodies are nearer than ``floor`` m."""
        attempts: dict[str, Attempt] = {}
        for law in LAWS:
            attempts[law] = self.attempt(schedule, law, floor)
            if attempts[law].failure:
                return Trial(attempts)
        runs = {law: attempt.run for law, attempt in attempts.items() if attempt.run is not None}
        metrics = {law: measure(run) for law, run in runs.items()}
        claims = judge(metrics[NMPC.name], metrics[PID.name])
        settling = next(claim for claim in claims if claim.name == "settling").findings
        lead = min(_or_late(item.pid) - _or_late(item.nmpc) for item in settling)
        peaks = {law: largest(each.torque.peak) for law, each in metrics.items()}
        return Trial(attempts, claims, peaks, lead)

    def attempt(self, schedule: Schedule, law: str, floor: float = 0.0) -> Attempt:
        """Return what comes of a schedule under one law."""
        world = World(self.robot, schedule)
        watch = _Watch(self._bodies, self.robot, floor, self._per_reference)
        try:
            run = simulate(Scenario(self._scenarios[law].parameters, world, world), until=watch.fails_in)
        except ConfigurationError as error:
            return Attempt(str(error), schedule.phases[0].name, -inf, inf)
        if watch.failure:
            return Attempt(watch.failure, watch.phase, watch.least, watch.rate)
        return Attempt("", watch.phase, watch.least, watch.rate, run)

    def _passed(self, geometry: Geometry) -> Iterator[tuple[str, Array, Pose]]:
        """Yield phase, joints (14,) and deputy along straight joint paths."""
        robot = self.robot
        start, grasp, give, end = geometry.rests
        a, b = (robot.arm_joints[arm] for arm in (ARM_A, ARM_B))

        def held(joints: Array, arm: str, frame: str) -> Pose:
            tool = se3_of(robot.tools_in_world(ORIGIN, joints, [arm])[arm])
            return pose_of(tool * se3_of(geometry.frames[frame]).inverse())

        for share in _SHARES:
            yield APPROACH, start + share * (grasp - start), geometry.deputy_in_world
        for share in _SHARES:
            joints = give + share * (end - give)
            yield WITHDRAW if share else CARRY, joints, held(joints, ARM_B, END_B)
        for share_a in _SHARES:
            for share_b in _SHARES:
                joints = np.array(grasp)
                joints[a] += share_a * (give - grasp)[a]
                joints[b] += share_b * (give - grasp)[b]
                yield CARRY, joints, held(joints, ARM_A, END_A)


class _Watch:
    """Looks at every reference period of a run in turn, up to the one in which something fails."""

    def __init__(self, bodies: ClearanceModel, robot: RobotModel, floor: float, per_reference: int) -> None:
        """Begin a run; bodies fail nearer than ``floor`` m."""
        self._bodies, self._robot = bodies, robot
        self._rate_limit = robot.pin.velocityLimit[BASE_NV:]
        self._floor, self._per_reference = floor, per_reference
        self.least, self.rate, self.failure, self.phase = inf, 0.0, "", ""

    def fails_in(self, ticks: Ticks | QuietPeriods) -> bool:
        """Whether something fails in one of these periods, of which the later ones are not looked at."""
        for phase, q, v, deputy, events in _periods(ticks, self._per_reference):
            self.phase, self.failure = phase, self._failure(q, v, deputy, events)
            if self.failure:
                return True
        return False

    def _failure(self, q: Array, v: Array, deputy: Pose, events: tuple[GraspEvent, ...]) -> str:
        """Return what fails in a period, '' if nothing does, and note how near and fast it was."""
        distances = self._bodies.distances(q[0], deputy)
        nearest = int(distances.argmin())
        self.least = min(self.least, float(distances[nearest]))
        self.rate = max(self.rate, float((np.abs(v[:, BASE_NV:]) / self._rate_limit).max()))
        if any(event.status is not GraspStatus.SUCCEEDED for event in events):
            return "a grasp missed"
        if self.least < self._floor:
            one, other = self._bodies.pairs[nearest]
            return f"{one.label} - {other.label}"
        if self.rate > 1.0:
            return "rate limit"
        joints = q[:, BASE_NQ:]
        beyond = (joints < self._robot.lower) | (joints > self._robot.upper)
        return "position limit" if beyond.any() else ""


def _periods(
    ticks: Ticks | QuietPeriods, per_reference: int
) -> Iterator[tuple[str, Array, Array, Pose, tuple[GraspEvent, ...]]]:
    """Yield phase, q (ticks, 7 + n) and v (ticks, 6 + n), deputy as it begins, and grasps of every period."""
    q, v = ticks.rows.q, ticks.rows.v
    if isinstance(ticks, Ticks):
        assert ticks.period is not None
        yield ticks.period.phase.name, q, v, ticks.period.deputy.deputy_in_world, ticks.period.events
        return
    for index, (phase, row) in enumerate(zip(ticks.phases, ticks.periods.deputy_pose, strict=True)):
        its = slice(index * per_reference, (index + 1) * per_reference)
        yield phase.name, q[its], v[its], Pose(row[:3], row[3:]), ()


def _or_late(time: float) -> float:
    """Return a settling time in s, that of a phase where there is none."""
    return 20.0 if isnan(time) else time
