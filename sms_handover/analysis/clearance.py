"""The clearance of a run: how near bodies came to each other, when, and whether they might touch."""

import logging
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from sms_handover.analysis.clearance_series import ClearanceSeries, SeriesOfGroups
from sms_handover.analysis.grasps import holds
from sms_handover.clearance.contacts import CONTACT_DEPTH, GraspContact, Group, contacts_of, fixed_groups
from sms_handover.clearance.distances import ClearanceModel
from sms_handover.clearance.solids import MissingMeshError, require_meshes
from sms_handover.clearance.worst_pair import NearestRecord
from sms_handover.errors import RobotDescriptionError, ScheduleError, UnknownNameError
from sms_handover.frames import tool_frame
from sms_handover.model.floating_model import floating_model, joint_columns
from sms_handover.model.poses import pose_of, se3_of
from sms_handover.run_data import RunData
from sms_handover.trajectory.schedule_text import deputy_size, grasping_arms
from sms_handover.types import BASE_NQ, Array, Pose

_LOG = logging.getLogger(__name__)

Rows = npt.NDArray[np.bool_]  # one per reference period


@dataclass(frozen=True)
class GroupClearance:
    """The least signed distance in m between two groups of bodies, when it was, and between which bodies.

    ``allowed`` is 0, or minus the depth of a declared contact; what is less is a collision.
    """

    group: str
    least: float
    allowed: float
    stamp_ns: int
    bodies: tuple[str, str]

    @property
    def margin(self) -> float:
        """How much farther apart than allowed the bodies stayed, m; negative in a collision."""
        return self.least - self.allowed

    @property
    def collides(self) -> bool:
        """Whether the bodies came nearer than is allowed."""
        return self.margin < 0.0


@dataclass(frozen=True)
class RunClearance:
    """The clearance of every group of bodies of a run, the worst one first, and its course over time."""

    groups: tuple[GroupClearance, ...]
    series: ClearanceSeries | None = field(default=None, compare=False, repr=False)

    @property
    def collisions(self) -> tuple[GroupClearance, ...]:
        """The groups of which bodies entered each other, in a declared contact deeper than allowed."""
        return tuple(group for group in self.groups if group.collides)


@dataclass(frozen=True)
class TaskTexts:
    """What a run was made with, as its bag carries it: the robot as URDF, the schedule as YAML.

    ``contact_depth`` m is how deep gripper and deputy may be in each other in a declared contact.
    """

    urdf: str
    schedule: str
    contact_depth: float = CONTACT_DEPTH

    def fit(self, run: RunData) -> bool:
        """Whether they describe a robot with the joints of a run, and a deputy; meshes must be there."""
        try:
            joint_columns(floating_model(self.urdf), run.joint_names)
            deputy_size(self.schedule), grasping_arms(self.schedule)
            require_meshes(self.urdf)
        except MissingMeshError as error:
            _LOG.warning("the clearance of the run is not judged: %s", error)
            return False
        except (RobotDescriptionError, ScheduleError, UnknownNameError):
            return False
        return True


def run_clearance(run: RunData, texts: TaskTexts) -> RunClearance:
    """Return how near the bodies of a run came to each other.

    Distances are taken at every reference period, and at every tick around the least one of each group. A
    held deputy moves with the tool that holds it. Contact between a gripper and the deputy is declared, and
    may be ``texts.contact_depth`` m deep, from the phase on in which the arm goes to a grasp frame, or from
    its grasp, until it has let go and has come off. Raises RobotDescriptionError or ScheduleError where the
    texts do not say what bodies and targets there are, and UnknownNameError where joints differ.
    """
    course = _Course(run, texts)
    sampled = course.sampled()
    found, series = [], SeriesOfGroups(sampled)
    for group, members in course.groups(sampled).items():
        pair, rows = min(members, key=lambda member: float(sampled[member[1], member[0]].min()))
        least, stamp_ns = course.refined(pair, rows, sampled[:, pair])
        one, other = course.model.pairs[pair]
        allowed = group.allowed(texts.contact_depth)
        found.append(GroupClearance(group.label, least, allowed, stamp_ns, (one.name, other.name)))
        series.add(group.label, allowed, found[-1].margin, members)
    worst_first = tuple(sorted(found, key=lambda group: group.margin))
    return RunClearance(worst_first, course.series(series, texts.contact_depth))


class _Course:
    """The configurations of a run, with the deputy, and who was to touch it when."""

    def __init__(self, run: RunData, texts: TaskTexts) -> None:
        self._pin = floating_model(texts.urdf)
        self._run, self._data = run, self._pin.createData()
        self.model = ClearanceModel(self._pin, texts.urdf, run.arms, deputy_size(texts.schedule))
        self._nearest = NearestRecord(self.model)
        self._columns = joint_columns(self._pin, run.joint_names)
        usable = np.isfinite(run.deputy_pose).all(axis=1)
        ticks = np.searchsorted(run.tick_ns, run.reference_ns)
        usable &= ticks < run.tick_ns.size
        ticks = np.minimum(ticks, run.tick_ns.size - 1)
        usable &= run.tick_ns[ticks] == run.reference_ns
        self._rows = np.flatnonzero(usable)  # of the reference periods, those with state and deputy
        self._ticks = ticks[self._rows]
        self._stamps = run.reference_ns[self._rows]
        self._grasps = holds(run.grasp_events)
        self._aims = self._aiming(grasping_arms(texts.schedule))

    def sampled(self) -> Array:
        """Return the distances (M, pairs) m at the reference periods."""
        distances = np.empty((self._ticks.size, len(self.model.pairs)))
        for row, tick in enumerate(self._ticks):
            distances[row] = self.model.distances(self._q(tick), self._deputy(row))
            self._nearest.keep(distances[row])
        return distances

    def series(self, groups: SeriesOfGroups, contact_depth: float) -> ClearanceSeries:
        """Return the sampled distances over time, with the worst pair of each reference period."""
        worst = self._nearest.worst(self._stamps, groups.sampled, groups.declared, contact_depth)
        return ClearanceSeries(self._stamps, groups.groups(), groups.allowed, worst)

    def groups(self, sampled: Array) -> dict[Group, list[tuple[int, Rows]]]:
        """Return the pairs that count to each group, and in which of the sampled periods they do."""
        found: dict[Group, list[tuple[int, Rows]]] = {}
        if sampled.size:
            always = np.ones(self._ticks.size, dtype=bool)
            for group, pairs in fixed_groups(self.model.pairs).items():
                found[group] = [(pair, always) for pair in pairs]
        for pair, contact in contacts_of(self.model.pairs).items():
            groups = self._groups_of(contact, sampled[:, pair])
            for group in dict.fromkeys(groups):
                rows = np.array([item == group for item in groups])
                found.setdefault(group, []).append((pair, rows))
        return found

    def refined(self, pair: int, rows: Rows, distances: Array) -> tuple[float, int]:
        """Return the least distance m of a pair while ``rows`` hold, to the tick, and its stamp in ns."""
        row = int(np.flatnonzero(rows)[distances[rows].argmin()])
        least, stamp_ns = float(distances[row]), int(self._stamps[row])
        for period in (row - 1, row):
            if not (0 <= period < self._ticks.size - 1 and rows[period]):
                continue
            for tick in range(int(self._ticks[period]) + 1, int(self._ticks[period + 1])):
                q = self._q(tick)
                distance = float(self.model.distances(q, self._deputy_between(period, tick, q))[pair])
                if distance < least:
                    least, stamp_ns = distance, int(self._run.tick_ns[tick])
        return least, stamp_ns

    def _groups_of(self, contact: GraspContact, distances: Array) -> list[Group]:
        """Return the group of a gripper and the deputy in each period."""
        aims, holds = self._aims[contact.arm], self._held_by(contact.arm)
        rows = zip(distances.tolist(), aims.tolist(), holds.tolist(), strict=True)
        return [contact.advance(distance, aims=aim, holds=hold) for distance, aim, hold in rows]

    def _aiming(self, grasping: tuple[frozenset[str], ...]) -> dict[str, Rows]:
        """Return when each arm goes to a grasp frame."""
        phases = [self._run.phases[row].index for row in self._phase_rows()]
        return {
            arm: np.array([index < len(grasping) and arm in grasping[index] for index in phases], dtype=bool)
            for arm in self._run.arms
        }

    def _phase_rows(self) -> npt.NDArray[np.intp]:
        """Return which entry of the run's phases is in force at each sampled reference period."""
        begins = np.array([phase.stamp_ns for phase in self._run.phases], dtype=np.int64)
        return np.maximum(np.searchsorted(begins, self._stamps, side="right") - 1, 0)

    def _held_by(self, arm: str) -> Rows:
        """Return when an arm holds the deputy."""
        holder = np.zeros(self._stamps.size, dtype=bool)
        for hold in self._grasps:
            holder[self._stamps >= hold.since_ns] = hold.holder == arm
        return holder

    def _holder(self, stamp_ns: int) -> str:
        """Return who holds the deputy at a time, '' if nobody does."""
        return next((hold.holder for hold in reversed(self._grasps) if hold.since_ns <= stamp_ns), "")

    def _q(self, tick: int) -> Array:
        """Return the configuration of a tick, in the order of the description's joints."""
        q = np.empty(self._pin.nq)
        q[:BASE_NQ] = self._run.base_pose[tick]
        q[self._columns] = self._run.joint_position[tick]
        return q

    def _deputy(self, row: int) -> Pose:
        """Return where the deputy is at a reference period."""
        pose = self._run.deputy_pose[self._rows[row]]
        return Pose(pose[:3], pose[3:])

    def _deputy_between(self, row: int, tick: int, q: Array) -> Pose:
        """Return where the deputy is at a tick behind a reference period: with its tool, or drifting."""
        begin, holder = se3_of(self._deputy(row)), self._holder(int(self._stamps[row]))
        if holder:
            tool_then = self._tool(holder, self._q(int(self._ticks[row])))
            return pose_of(self._tool(holder, q) * tool_then.actInv(begin))
        first, last = self._stamps[row], self._stamps[row + 1]
        share = float(self._run.tick_ns[tick] - first) / float(last - first)
        return pose_of(pin.SE3.Interpolate(begin, se3_of(self._deputy(row + 1)), share))

    def _tool(self, arm: str, q: Array) -> pin.SE3:
        """Return the placement of a tool."""
        pin.forwardKinematics(self._pin, self._data, q)
        frame = self._pin.getFrameId(tool_frame(arm))
        return pin.updateFramePlacement(self._pin, self._data, frame).copy()
