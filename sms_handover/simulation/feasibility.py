"""Feasibility of a schedule, checked before anything moves."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

import numpy as np

from sms_handover.clearance.bodies import BodyKind
from sms_handover.clearance.distances import ClearanceModel
from sms_handover.errors import ScheduleError
from sms_handover.ik.levenberg_marquardt import solve_ik
from sms_handover.ik.parameters import IkParameters
from sms_handover.model.known_payload import KnownPayload
from sms_handover.model.poses import pose_distance
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.deputy import GraspTolerance, MasslessDeputy
from sms_handover.plant.grasping import execute_grasp
from sms_handover.plant.rigid_deputy import RigidDeputy
from sms_handover.simulation.predicted_momentum import PredictedMomentum, base_after
from sms_handover.simulation.wiring import initial_joints, make_clearance
from sms_handover.trajectory.generator import goal_in_world
from sms_handover.trajectory.schedule import GraspFrameTarget, JointTarget, Phase, Schedule, ToolTarget
from sms_handover.types import Array, GraspStatus, IkRequest, Pose, Twist, freeze
from sms_handover.units import DEG_PER_RAD, MM_PER_M, ns_to_seconds

_DRIFT_STEP_S = 0.005  # [s] of a free deputy; its error is far below a grasp tolerance
_MAX_SETTLE = 40  # [-] each round shrinks the error by about the arms' share of the mass
_SETTLED = 1e-9  # [m, rad] change of the base pose in a round
_SETTLED_OUT_OF_REACH = 1e-4  # [m, rad] the same where only the size of a miss is wanted
_DRAWS = 20  # [-] random configurations drawn for one that is free: a third overlaps with the shipped robot
_RESTARTS = 10  # [-] random configurations tried where the present one does not lead to the target
_WORTH_FOLLOWING = 0.9  # [-] share of the best error energy below which a restart is followed up
_SEED = 20250101  # [-] so that a schedule always gets the same verdict
ANY_GRASP = GraspTolerance(inf, inf, inf)
_AT_REST = Twist(np.zeros(3), np.zeros(3))


@dataclass(frozen=True, eq=False)
class PhasePrediction:
    """The end of a phase: joint angles (n,) rad, base pose, and rotation of the base.

    ``base_rotation_angle`` in rad is counted from the start of the run. ``restarts`` is how many random
    configurations were tried before one led to the targets; a run has only the first try, so anything
    but 0 means that it may come to rest elsewhere.
    """

    phase: str
    joint_position: Array
    base_in_world: Pose
    base_rotation_angle: float
    restarts: int

    def __post_init__(self) -> None:
        freeze(self, "joint_position")


@dataclass(frozen=True, eq=False)
class _Rest:
    """The robot at rest: base pose, joint angles (n,), and the error energy of tools with a target."""

    base_in_world: Pose
    joint_position: Array
    targets: Mapping[str, Pose]
    missed: Mapping[str, tuple[float, float]]  # per arm out of tolerance: m, rad

    @property
    def energy(self) -> float:
        """Squared errors of all arms that miss their target, metres and radians weighted alike."""
        return sum(position**2 + angle**2 for position, angle in self.missed.values())


def check_feasibility(
    robot: RobotModel, schedule: Schedule, ik: IkParameters, tolerance: GraspTolerance = ANY_GRASP
) -> tuple[PhasePrediction, ...]:
    """Return where each phase will end; raises ScheduleError where a target or a grasp is out of reach.

    Assumes that a phase ends with its joints at rest, at its targets, on a straight path in joint space. At
    zero momentum the base's displacement follows from the joint path alone, whatever its timing; a deputy
    with mass, as it is known, is carried, and what momentum it brings turns and moves the whole for the rest
    of the task. A grasp is checked at the tool pose that the phase before ends at, at no relative speed.
    Poses on the way to a target are not checked. Without a ``tolerance`` every grasp holds.
    """
    return _Walk(robot, schedule, ik, tolerance).predictions()


class _Walk:
    """Goes through the phases from rest to rest."""

    def __init__(
        self, robot: RobotModel, schedule: Schedule, ik: IkParameters, tolerance: GraspTolerance
    ) -> None:
        """Begin at the start of the schedule."""
        self._robot, self._schedule, self._ik = robot, schedule, ik
        self._tolerance = replace(tolerance, speed=inf, rate=inf)
        self._deputy = _deputy(schedule)
        self._momentum = PredictedMomentum(KnownPayload(robot, schedule.deputy))
        self._base, self._joints = schedule.base_in_world, initial_joints(robot, schedule)

    def predictions(self) -> tuple[PhasePrediction, ...]:
        """Return the prediction of every phase."""
        found = []
        for phase in self._schedule.phases:
            self._grasp(phase)
            if not self._deputy.holder:
                self._deputy.drift(ns_to_seconds(phase.end_ns - phase.start_ns))
            rest, restarts = self._reach(phase)
            self._base, self._joints = rest.base_in_world, rest.joint_position
            turned = pose_distance(self._schedule.base_in_world, self._base)[1]
            found.append(PhasePrediction(phase.name, self._joints, self._base, turned, restarts))
        return tuple(found)

    def _grasp(self, phase: Phase) -> None:
        """Carry out the grasp commands of a phase; raises ScheduleError where one would not succeed."""
        tools = self._carry_deputy(self._base, self._joints)
        at_rest = dict.fromkeys(tools, _AT_REST)
        for command in phase.commands:
            event = execute_grasp(command, self._deputy, tools, at_rest, self._tolerance, phase.start_ns)
            if event.status is GraspStatus.MISSED:
                raise ScheduleError(
                    f"phase {phase.name!r}: {command.arm} would miss grasp frame {command.grasp_frame!r}: "
                    f"{event.detail}"
                )
            if event.status is GraspStatus.REJECTED:
                raise ScheduleError(f"phase {phase.name!r}: {event.detail}")
            if isinstance(self._deputy, RigidDeputy):
                self._momentum.handed_over(event, self._deputy, self._base, self._joints)

    def _reach(self, phase: Phase) -> tuple[_Rest, int]:
        """Return where a phase ends and after how many restarts; raises ScheduleError where it cannot."""
        random = np.random.default_rng(_SEED)
        best = self._settle(phase, self._base, self._joints)
        restarts, overlapping = 0, None
        while best.missed and restarts < _RESTARTS:
            restarts += 1
            trial = self._solve(best.base_in_world, self._restart(best, random), best.targets)
            if trial.energy < _WORTH_FOLLOWING * best.energy:
                settled = self._settle(phase, trial.base_in_world, trial.joint_position)
                if settled.missed or self._is_free(settled.base_in_world, settled.joint_position):
                    best = min(best, settled, key=lambda rest: rest.energy)
                else:
                    overlapping = overlapping or settled  # taken if no other restart leads there
        best = overlapping if best.missed and overlapping else best
        for arm, (position, angle) in best.missed.items():
            x, y, z = best.targets[arm].position
            raise ScheduleError(
                f"phase {phase.name!r}: the target of {arm} at ({x:.3f}, {y:.3f}, {z:.3f}) m is out of "
                f"reach: the nearest pose found is {position * MM_PER_M:.3g} mm and "
                f"{angle * DEG_PER_RAD:.3g} deg away"
            )
        return best, restarts

    def _restart(self, best: _Rest, random: np.random.Generator) -> Array:
        """Return random joints of the arms that miss, at which no two bodies of the robot overlap.

        If they do in many draws, as in a narrow place, the last one has to do.
        """
        robot, seed = self._robot, np.array(best.joint_position)
        for _ in range(_DRAWS):
            for arm in best.missed:
                part = robot.arm_joints[arm]
                low, high = np.maximum(robot.lower[part], -np.pi), np.minimum(robot.upper[part], np.pi)
                seed[part] = random.uniform(low, high)
            if self._is_free(best.base_in_world, seed):
                break
        return seed

    def _is_free(self, base_in_world: Pose, joints: Array) -> bool:
        """Whether no two bodies of the robot overlap; what the deputy may touch depends on the phase."""
        q = self._robot.configuration(base_in_world, joints)
        distances = self._clearance.distances(q, self._deputy.state.deputy_in_world)
        return bool(distances[self._of_robot].min(initial=inf) >= 0.0)

    @cached_property
    def _clearance(self) -> ClearanceModel:
        """The distances of the bodies, made where a restart needs them."""
        return make_clearance(self._robot, self._schedule)

    @cached_property
    def _of_robot(self) -> list[int]:
        """The pairs of bodies without the deputy."""
        pairs = enumerate(self._clearance.pairs)
        return [index for index, (_, other) in pairs if other.kind is not BodyKind.DEPUTY]

    def _settle(self, phase: Phase, base_in_world: Pose, seed: Array) -> _Rest:
        """Return the rest at which joints and base agree, by fixed-point iteration from a seed.

        The joints decide how far the base is pushed, and the base pose which joints reach the targets.
        """
        base = base_in_world
        joints = self._with_joint_targets(phase, seed)
        for _ in range(_MAX_SETTLE):
            rest = self._solve(base, joints, self._targets(phase, base, joints))
            joints = rest.joint_position
            settled = self._base_after(phase, joints)
            if max(pose_distance(base, settled)) <= (_SETTLED_OUT_OF_REACH if rest.missed else _SETTLED):
                break
            base = settled
        return rest

    def _base_after(self, phase: Phase, joints: Array) -> Pose:
        """Return the base pose at the end of a phase that ends with these joints (n,)."""
        momentum, robot = self._momentum.total, self._momentum.payload.robot
        duration = ns_to_seconds(phase.end_ns - phase.start_ns)
        return base_after(robot, self._base, self._joints, joints, momentum, duration)

    def _solve(self, base_in_world: Pose, seed: Array, targets: Mapping[str, Pose]) -> _Rest:
        """Return the rest with the joints that inverse kinematics finds, and which arms miss."""
        result = solve_ik(self._robot, IkRequest(base_in_world, seed, targets), self._ik)
        tools = self._robot.tools_in_world(base_in_world, result.joint_position)
        errors = {arm: pose_distance(tools[arm], target) for arm, target in targets.items()}
        limits = (self._ik.position_tolerance, self._ik.orientation_tolerance)
        missed = {arm: error for arm, error in errors.items() if error[0] > limits[0] or error[1] > limits[1]}
        return _Rest(base_in_world, result.joint_position, targets, missed)

    def _with_joint_targets(self, phase: Phase, seed: Array) -> Array:
        """Return the seed with every joint target put in; an arm on hold is where it was anyway."""
        joints = np.array(seed)
        for arm, target in phase.targets.items():
            if isinstance(target, JointTarget):
                joints[self._robot.arm_joints[arm]] = target.position
        return joints

    def _targets(self, phase: Phase, base_in_world: Pose, joints: Array) -> dict[str, Pose]:
        """Return the tool targets in ``world``, with a held deputy where its arm now takes it."""
        self._carry_deputy(base_in_world, joints)
        deputy_in_world = self._deputy.state.deputy_in_world
        return {
            arm: goal_in_world(target, self._schedule.deputy, deputy_in_world)
            for arm, target in phase.targets.items()
            if isinstance(target, ToolTarget | GraspFrameTarget)
        }

    def _carry_deputy(self, base_in_world: Pose, joints: Array) -> dict[str, Pose]:
        """Return the tools of a configuration, with a held deputy moved along."""
        tools = self._robot.tools_in_world(base_in_world, joints)
        if self._deputy.holder:
            self._deputy.follow(tools[self._deputy.holder], _AT_REST)
        return tools


def _deputy(schedule: Schedule) -> MasslessDeputy:
    """Return the deputy of a schedule at time zero."""
    known = schedule.deputy
    place = (known.deputy_in_world, known.grasp_frames)
    if known.inertia is None:
        return MasslessDeputy(*place, known.twist_in_world)
    return RigidDeputy(*place, known.inertia, _DRIFT_STEP_S, known.twist_in_world)
