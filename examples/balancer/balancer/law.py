"""Law ``balancer``: joint rates by a quadratic program each reference period, torques by computed torque."""

from time import perf_counter

import numpy as np
import pinocchio as pin

import sms_handover as sms
from balancer.gains import Gains
from balancer.motion import Motion, expected
from balancer.program import Program, Rates
from balancer.setpoint import Setpoint

_TOOL_WEIGHT = np.array([1e6] * 3 + [1e5] * 3)  # [s^2/m^2, s^2/rad^2] of the twist of a tool
_TOOL_GAIN = 4.0  # [1/s] by which errors of tools, and of joints that lead their arm, decay
_JOINT_WEIGHT = 1e6  # [s^2/rad^2] of rates of joints that lead their arm
_ELBOW_WEIGHT = 100.0  # [s^2/rad^2] of what the joints of a tool's arm do besides, other than the reference
_REST_WEIGHT = 0.01  # [s^2/rad^2] of all rates of such an arm other than those of the reference
_SINGULAR = 1e-3  # [-] of the largest singular value of a tool's Jacobian: what is less moves nothing
_IDLE_WEIGHT, _IDLE_GAIN = 1.0, 0.1  # [s^2/rad^2, 1/s] by which an idle arm goes back to its posture
_CHANGE_WEIGHT = 10.0  # [s^2/rad^2] of changes of its rates in a period
_BOUND_GAIN = 2.0  # [1/s] a bound is approached no faster than this times the way left
_PUSH = 0.01  # [m/s] at most, by which bodies that are too near come apart
_NEAR = 0.1  # [m] above the least distance: what is farther off does not get there in a period
_BRAKING = 0.1  # [s] in which rates fall to 1/e without a solution
_FEEDBACK = np.array([[40.0], [12.0]])  # [1/s^2, 1/s] of computed torque about the setpoint


class Balancer:
    """Leads tools where targets are, and moves the idle arm so that the base turns as little as possible.

    An arm is idle while no target leads it: its joints are to stay where they were when the phase began, and
    it does not hold the deputy.
    """

    def __init__(self, setup: sms.LawSetup[Gains]) -> None:
        """Keep what the law needs."""
        assert setup.preview is not None and setup.distances is not None  # it declares both needs
        self._setup, self._preview, self._distances = setup, setup.preview, setup.distances
        robot = setup.robot
        self._rate_limit = np.array(robot.pin.velocityLimit[sms.BASE_NV :])
        self._feedback = np.repeat(_FEEDBACK, robot.n_joints, axis=1)
        self.reset()

    def reset(self) -> None:
        """Return to the start of a run."""
        self._preview.reset()
        self._payload = sms.KnownPayload(self._setup.robot, self._setup.deputy)
        self._efforts = self._setup.computed_torque(self._payload.robot)
        self._news: tuple[sms.GraspEvent, ...] = ()
        self._guidance: sms.Guidance | None = None
        self._setpoint: Setpoint | None = None
        self._entry: object = None
        self._solves = self._failures = 0
        self._report: sms.PlanReport | None = None

    def guide(self, guidance: sms.Guidance) -> None:
        """Take the targets of now, and note which arms are led by joints that have begun to move."""
        reference, entry = guidance.reference, guidance.phase.entry
        if entry != self._entry:
            self._entry, self._at_rest = entry, reference.position
            self._moved = np.zeros(reference.position.size, dtype=bool)
        self._moved |= (reference.position != self._at_rest) | (reference.velocity != 0.0)
        self._guidance, self._led_rates = guidance, reference.velocity

    def grasped(self, event: sms.GraspEvent) -> None:
        """Learn what came of a grasp command; it counts from the next state on."""
        self._news = (*self._news, event)

    def effort(self, stamp_ns: int, q: sms.Array, v: sms.Array) -> sms.Array:
        """Return the joint efforts (n,) N m."""
        self._heed_news(stamp_ns)
        if self._setpoint is None:
            self._setpoint = self._next(stamp_ns, q[sms.BASE_NQ :], v[sms.BASE_NV :], 0.0 * v[sms.BASE_NV :])
        if self._guidance is not None:
            guidance, self._guidance = self._guidance, None
            self._solve(stamp_ns, q, v, guidance)
        return self._payload.robot.limited(self._efforts(q, v, self._setpoint.at(stamp_ns), self._feedback))

    def take_status(self) -> sms.PlanReport | None:
        """Return the report of the solve since the last call, None if there was none."""
        report, self._report = self._report, None
        return report

    @property
    def setpoint(self) -> Setpoint | None:
        """What the joints follow, None before the first state."""
        return self._setpoint

    def program(
        self, gains: Gains, motion: Motion, target: sms.PreviewedTargets, *, failed: bool = False
    ) -> Program:
        """Return the program for the rates at the end of a period, with targets of then; with hard bounds."""
        robot = self._payload.robot
        program = Program(robot.joint_names)
        self._add_arms(program, motion, target, failed=failed)
        program.add(motion.reaction[3:], -motion.drift[3:], gains.base_turn_weight)
        self._bound_joints(program, gains, motion)
        self._keep_apart(program, gains, motion, target)
        return program

    def _heed_news(self, stamp_ns: int) -> None:
        """Take up the payload of the events before a state."""
        due = [event for event in self._news if event.stamp_ns < stamp_ns]
        self._news = self._news[len(due) :]
        for event in due:
            self._preview.grasped(event)
        if any([self._payload.grasped(event) for event in due]):
            self._efforts = self._setup.computed_torque(self._payload.robot)

    def _next(self, stamp_ns: int, q: sms.Array, w: sms.Array, reached: sms.Array) -> Setpoint:
        """Return the setpoint from a time on."""
        return Setpoint(stamp_ns, q, w, reached, self._setup.reference_ns, self._setup.longest_reference_ns)

    def _solve(self, stamp_ns: int, q: sms.Array, v: sms.Array, guidance: sms.Guidance) -> None:
        """Find the rates for the end of the reference period that begins now."""
        begun = perf_counter()
        self._preview.update(guidance.phase, guidance.reference, guidance.tool_in_world, q, v)
        period_ns, gains = self._setup.reference_ns, self._setup.gains[guidance.phase.index]
        (target,) = self._preview.ahead([stamp_ns + period_ns])
        assert self._setpoint is not None
        joints, rates, _ = self._setpoint.at(stamp_ns)
        motion = expected(self._payload.robot, q, v, joints, rates, 1e-9 * period_ns)
        program = self.program(gains, motion, target, failed=guidance.phase.failed)
        set_up = perf_counter()
        found = program.solve()
        solved = found.status is sms.PlanStatus.SOLVED
        self._solves, self._failures = self._solves + 1, self._failures + (not solved)
        reached = found.rates if solved else rates * (1.0 - motion.h / (motion.h + _BRAKING))
        self._setpoint = self._next(stamp_ns, joints, rates, reached)
        self._report = self._reported(stamp_ns, found, set_up - begun, perf_counter() - set_up)

    def _reported(self, stamp_ns: int, found: Rates, set_up: float, solved: float) -> sms.PlanReport:
        """Return the report of a solve, as that of a plan of one period; times in s."""
        return sms.PlanReport(
            stamp_ns,
            self._solves,
            found.status,
            found.iterations,
            found.active,
            found.excess,
            found.row,
            found.residual,
            set_up,
            solved,
            set_up + solved,
            plan_age=0.0,
            reused_plans=self._failures,
        )

    def _add_arms(
        self, program: Program, motion: Motion, target: sms.PreviewedTargets, *, failed: bool
    ) -> None:
        """Add what leads each arm: its tool, its joints, or nothing but its posture."""
        robot, every = self._payload.robot, np.eye(self._payload.robot.n_joints)
        tools = robot.tools_at(motion.q)
        for arm, part in robot.arm_joints.items():
            if arm in target.tool_in_world:
                goal, tool = sms.se3_of(target.tool_in_world[arm]), sms.se3_of(tools[arm])
                error = np.concatenate(
                    [tool.translation - goal.translation, pin.log3(tool.rotation @ goal.rotation.T)]
                )
                jacobian, rest = motion.rates(sms.tool_jacobian(robot, motion.q, arm))
                rest = rest - target.tool_twist_in_world[arm].row
                program.add(*motion.approaching(error, jacobian, rest, _TOOL_GAIN), _TOOL_WEIGHT)
                own = jacobian[:, part]
                besides = (np.eye(own.shape[1]) - np.linalg.pinv(own, _SINGULAR) @ own) @ every[part]
                program.add(besides, besides @ self._led_rates, _ELBOW_WEIGHT)
                program.add(every[part], self._led_rates[part], _REST_WEIGHT)
                continue
            idle = not (failed or self._moved[part].any() or arm == target.holder)
            weight, gain = (_IDLE_WEIGHT, _IDLE_GAIN) if idle else (_JOINT_WEIGHT, _TOOL_GAIN)
            error = motion.q[sms.BASE_NQ :][part] - target.joint_position[part]
            rows = motion.approaching(error, every[part], -target.joint_velocity[part], gain)
            program.add(*rows, weight)
            if idle:
                program.add(every[part], motion.w[part], _CHANGE_WEIGHT)

    def _bound_joints(self, program: Program, gains: Gains, motion: Motion) -> None:
        """Bound rates, and rates towards the limits of joints, so that no limit is ever passed."""
        robot, every = self._payload.robot, np.eye(self._payload.robot.n_joints)
        limit = np.minimum(self._rate_limit, gains.arm_rate_limit or np.inf)
        joints = motion.q[sms.BASE_NQ :]
        matrix, low = motion.approaching(joints - robot.lower, every, 0.0, _BOUND_GAIN)
        _, high = motion.approaching(joints - robot.upper, every, 0.0, _BOUND_GAIN)
        scale = np.diag(matrix)
        program.bound(np.maximum(-limit, low / scale), np.minimum(limit, high / scale))

    def _keep_apart(
        self, program: Program, gains: Gains, motion: Motion, target: sms.PreviewedTargets
    ) -> None:
        """Let no two bodies come nearer than is allowed; those that are come apart."""
        bodies = sms.DistanceGradients(self._setup.robot, self._distances, gains.keep_apart)
        left = bodies.at(motion.q, target) - bodies.least(target)
        near = np.flatnonzero(left < _NEAR).tolist()
        if not near:
            return
        gradients = np.vstack([bodies.gradient(index, target) for index in near])
        rows, rest = motion.rates(gradients)
        matrix, low = motion.approaching(left[near], rows, rest, _BOUND_GAIN)
        names = [f"distance {' - '.join(bodies.pairs[index].names)}" for index in near]
        program.keep(names, matrix, np.minimum(low, _PUSH - rest))


def linearised(gains: Gains, inertia: sms.Array) -> sms.LinearFeedback:
    """Return the feedback about the setpoint: K_e = a_1 H*, K_v = a_2 H*, K_z = 0."""
    position, velocity = _FEEDBACK[:, 0]
    return sms.LinearFeedback(position * inertia, velocity * inertia, np.zeros_like(inertia))


LAW = sms.Law(
    "balancer",
    "tools where targets are, and an idle arm that keeps the base's attitude",
    Gains,
    Balancer,
    linearised,
    frozenset({sms.Need.TOOL_TARGETS, sms.Need.PREVIEW, sms.Need.PAYLOAD, sms.Need.CLEARANCE}),
)
