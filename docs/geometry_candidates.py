"""Candidates of the search: geometries of the handover, drawn at random, varied, written as schedules."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi, radians
from typing import Any

import numpy as np
import pinocchio as pin

from sms_handover.configuration.documents import as_yaml
from sms_handover.ik.levenberg_marquardt import find_joints
from sms_handover.ik.parameters import IkParameters
from sms_handover.model.poses import pose_from_xyz_rpy, pose_of, se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.trajectory.schedule import Schedule, ToolTarget
from sms_handover.types import BASE_NQ, BASE_NV, Array, IkRequest, IkStatus, Pose

ARM_A, ARM_B = "arm_a", "arm_b"
END_A, END_B = "end_a", "end_b"
APPROACH, CARRY, WITHDRAW = PHASES = ("approach", "carry", "withdraw")
SIZE = (0.1, 0.34, 0.1)  # m, a 3U CubeSat with its long edge along its y axis
ORIGIN = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))

_GAP = 0.005  # m between the face of the deputy and a gripper in a grasp frame
_GRASP_Y = 0.12  # m from the centre of the deputy to a grasp frame, along its long edge
_DURATION = 20.0  # s; the paper shows three phases in 60 s
_MOTION = 15.0  # s that a smooth time law takes
_SOFTER = {"nmpc": {"rolling_period": 2.0}}  # s, once the deputy is held, as in the paper
_ELBOW_OUT = np.array([0.648, -1.712, 1.448, 1.87, 1.671, -1.412, 1.205])  # rad, of the arm at +y
_MIRROR = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # to the arm at -y
_MARGIN = 0.1  # rad that joints keep from their position limits at rest
_TURN = 0.9  # rad that a joint turns at most in a phase; the rate under PID is up to K_P / K_D of it
_ACROSS = 1e-3  # m that a tool at rest may be on the side of the other arm: rounding
_GRID = 0.01  # m, to which positions are rounded
_FINE, _COARSE = radians(5.0), radians(15.0)  # to which turns of tools and rolls of the deputy are rounded
_OFTEN = 0.4  # [-] share of the numbers that a variation changes


@dataclass(frozen=True, eq=False)
class Design:
    """The numbers that make a geometry, and that a search varies: lengths in m, angles in rad.

    Centre (3,) and roll of the deputy at the start, roll (``stance``) and centre (3,) at the handover, and
    how far B takes it from there (3,), in ``world``; the turns of the tools about their own axes in the
    grasp frames; joints (7,) with which A grasps and B takes over, guesses that IK makes exact; the sweeps
    that lead to these from the starts (7,).
    """

    deputy: Array
    roll: float
    stance: float
    meeting: Array
    away: Array
    turn_a: float
    turn_b: float
    grasp_a: Array
    take_b: Array
    sweep_a: Array
    sweep_b: Array

    def rounded(self) -> "Design":
        """Return it with numbers that a person would write."""
        return replace(
            self,
            deputy=_round(self.deputy, _GRID),
            roll=float(_round(self.roll, _COARSE)),
            stance=float(_round(self.stance, _COARSE)),
            meeting=_round(self.meeting, _GRID),
            away=_round(self.away, _GRID),
            turn_a=float(_round(self.turn_a, _FINE)),
            turn_b=float(_round(self.turn_b, _FINE)),
        )


@dataclass(frozen=True, eq=False)
class Geometry:
    """Where everything is: the design with exact joints, rests of the arms (14,) rad, poses in ``world``.

    ``rests`` has the start and the end of each phase, with the base where it was at first.
    """

    design: Design
    rests: tuple[Array, Array, Array, Array]
    deputy_in_world: Pose
    meeting_in_world: Pose
    end_in_world: Pose
    frames: Mapping[str, Pose]


def drawn(random: np.random.Generator, *, wide: bool = False) -> Design:
    """Return a random design; for ``wide`` see :func:`redrawn`."""
    none, joints = np.zeros(3), np.zeros(7)
    design = Design(none, 0.0, 0.0, none, none, 0.0, 0.0, joints, joints, joints, joints)
    for phase in PHASES:
        design = redrawn(design, phase, random, wide=wide)
    return design


def redrawn(design: Design, phase: str, random: np.random.Generator, *, wide: bool = False) -> Design:
    """Return a design with what decides a phase drawn anew.

    The arms sweep about their joints 1 along the face of a deputy in front of them. Joint 1 of both arms
    turns about the x axis of the base: a tool that points along it and a face across it stay as far apart as
    they are while the arm swings past, however far a law overshoots.

    A ``wide`` motion is one for the shipped handover: the deputy far out, so that the arms move much
    inertia far, its long edge upright, so that they pass above each other, handed over at the centre line.
    """
    along, least = random.uniform, 0.5 if wide else 0.25  # rad
    if phase == APPROACH:
        height = along(0.35 if wide else 0.0, 0.6) * float(random.choice([-1.0, 1.0]))  # m
        upright = wide or random.random() < 0.5
        stance = pi / 2.0 if upright else 0.0
        roll = stance if wide else stance + _COARSE * int(random.integers(-2, 3))
        return replace(
            design,
            deputy=np.array([along(1.0, 1.2), along(0.2 if wide else 0.05, 0.45), height]),
            roll=roll,
            stance=stance,
            turn_a=float(along(-pi, pi)),
            grasp_a=_guess(random),
            sweep_a=_sweep(random, least),
        ).rounded()
    if phase == CARRY:
        x, _, z = design.deputy
        y = 0.0 if design.stance else along(-0.1, 0.1)  # a tool on the side of the other arm is rejected
        return replace(
            design,
            meeting=np.array([x - along(0.0, 0.01), y, z + along(-0.25, 0.25)]),
            turn_b=float(along(-pi, pi)),
            take_b=_guess(random) * _MIRROR,
            sweep_b=_sweep(random, least),
        ).rounded()
    away = np.array([along(0.03, 0.2), along(-0.3, 0.0), along(-0.2, 0.2)])
    return replace(design, away=away).rounded()


def varied(design: Design, random: np.random.Generator, scale: float) -> Design:
    """Return a design in which some of the numbers, not the roll, are a little different."""

    def change(size: int, deviation: float) -> Array:
        return random.normal(0.0, scale * deviation, size) * (random.random(size) < _OFTEN)

    in_plane = np.array([8.0, 1.0, 1.0, 1.0, 1.0, 1.0, 4.0])  # joints 1 and 7 keep the tool in its plane
    shift = change(3, 0.03)
    return replace(
        design,
        deputy=design.deputy + shift,
        meeting=design.meeting + np.array([shift[0], 0.0, 0.0]) + change(3, 0.03) * [0.3, 0.0, 1.0],
        away=design.away + change(3, 0.03),
        turn_a=design.turn_a + float(change(1, 0.2)[0]),
        turn_b=design.turn_b + float(change(1, 0.2)[0]),
        grasp_a=design.grasp_a + change(7, 0.1),
        take_b=design.take_b + change(7, 0.1),
        sweep_a=design.sweep_a + change(7, 0.01) * in_plane,
        sweep_b=design.sweep_b + change(7, 0.01) * in_plane,
    ).rounded()


def resolved(design: Design, robot: RobotModel, ik: IkParameters) -> Geometry | str:
    """Return the geometry of a design, or the phase in which it is out of reach.

    That is so too where a joint comes near its limit or would turn fast, or a tool is on the side of the
    other arm.
    """
    frames = {END_A: _grasp_frame(1.0, design.turn_a), END_B: _grasp_frame(-1.0, design.turn_b)}
    deputy = pose_from_xyz_rpy(design.deputy, np.array([design.roll, 0.0, 0.0]))
    stance = np.array([design.stance, 0.0, 0.0])
    meeting = pose_from_xyz_rpy(design.meeting, stance)
    end = pose_from_xyz_rpy(design.meeting + design.away, stance)

    def reach(guess: Array, arm: str, deputy: Pose, frame: str) -> Array | None:
        tool = pose_of(se3_of(deputy) * se3_of(frames[frame]))
        seed = np.zeros(robot.n_joints)
        seed[robot.arm_joints[arm]] = guess
        found = find_joints(robot, IkRequest(ORIGIN, seed, {arm: tool}), ik)
        joints = found.joint_position[robot.arm_joints[arm]]
        return joints if found.status is IkStatus.CONVERGED and allowed(joints, arm) else None

    def allowed(joints: Array, arm: str) -> bool:
        part, side = robot.arm_joints[arm], 1.0 if arm == ARM_A else -1.0
        inside = (joints >= robot.lower[part] + _MARGIN) & (joints <= robot.upper[part] - _MARGIN)
        q = np.zeros(robot.n_joints)
        q[part] = joints
        across = side * robot.tools_in_world(ORIGIN, q, [arm])[arm].position[1]
        return bool(inside.all()) and across >= -_ACROSS

    grasp = reach(design.grasp_a, ARM_A, deputy, END_A)
    if grasp is None:
        return APPROACH
    start_a = _round(grasp + _swept(robot, ARM_A, grasp, design.sweep_a), 1e-4)
    if not allowed(start_a, ARM_A) or _turned(grasp, start_a):
        return APPROACH
    give = reach(grasp, ARM_A, meeting, END_A)
    if give is None or _turned(grasp, give):
        return CARRY
    take = reach(design.take_b, ARM_B, meeting, END_B)
    if take is None:
        return CARRY
    start_b = _round(take + _swept(robot, ARM_B, take, design.sweep_b), 1e-4)
    if not allowed(start_b, ARM_B) or _turned(take, start_b):
        return CARRY
    last = reach(take, ARM_B, end, END_B)
    if last is None or _turned(take, last):
        return WITHDRAW
    pairs = ((start_a, start_b), (grasp, start_b), (give, take), (give, last))
    one, two, three, four = (np.concatenate(pair) for pair in pairs)
    exact = replace(design, grasp_a=grasp, take_b=take)
    return Geometry(exact, (one, two, three, four), deputy, meeting, end, frames)


def design_of(schedule: Schedule, robot: RobotModel, ik: IkParameters) -> Design:
    """Return the design of a schedule that :func:`schedule_text` wrote, to vary it further."""
    _, carry, withdraw = schedule.phases
    frames = {name: se3_of(frame) for name, frame in schedule.deputy.grasp_frames.items()}
    targets = (carry.targets[ARM_A], carry.targets[ARM_B], withdraw.targets[ARM_B])
    give, take, last = (target.tool_in_world for target in targets if isinstance(target, ToolTarget))
    deputy = se3_of(schedule.deputy.deputy_in_world)
    meeting = se3_of(give) * frames[END_A].inverse()
    along = pin.utils.rotate("y", pi / 2.0).T

    def swept(arm: str, tool: Pose) -> tuple[Array, Array]:
        start, part = schedule.initial_joints[arm], robot.arm_joints[arm]
        seed = np.zeros(robot.n_joints)
        seed[part] = start
        joints = find_joints(robot, IkRequest(ORIGIN, seed, {arm: tool}), ik).joint_position[part]
        pure = _swept(robot, arm, joints, np.array([start[0] - joints[0], *np.zeros(6)]))
        change = start - joints - pure
        change[0] = start[0] - joints[0]
        return joints, change

    def turn(frame: str) -> float:
        rotation = along @ frames[frame].rotation
        return float(np.arctan2(rotation[1, 0], rotation[0, 0]))

    grasp_a, sweep_a = swept(ARM_A, pose_of(deputy * frames[END_A]))
    take_b, sweep_b = swept(ARM_B, take)
    return Design(
        deputy=deputy.translation,
        roll=float(pin.rpy.matrixToRpy(deputy.rotation)[0]),
        stance=float(pin.rpy.matrixToRpy(meeting.rotation)[0]),
        meeting=meeting.translation,
        away=last.position - take.position,
        turn_a=turn(END_A),
        turn_b=turn(END_B),
        grasp_a=grasp_a,
        take_b=take_b,
        sweep_a=sweep_a,
        sweep_b=sweep_b,
    )


def schedule_text(geometry: Geometry) -> str:
    """Return the schedule of a geometry as YAML."""
    rest, frames = geometry.rests[0], geometry.frames

    def tool(deputy: Pose, frame: str) -> dict[str, Any]:
        return {"tool_in_world": _written(pose_of(se3_of(deputy) * se3_of(frames[frame])))}

    held = {"gains": _SOFTER}
    phases: list[dict[str, Any]] = [
        {"name": APPROACH, "arms": {ARM_A: {"grasp_frame": END_A}, ARM_B: "hold"}},
        {
            "name": CARRY,
            "events": [{"grasp": {"arm": ARM_A, "grasp_frame": END_A}}],
            "arms": {
                ARM_A: tool(geometry.meeting_in_world, END_A),
                ARM_B: tool(geometry.meeting_in_world, END_B),
            },
            **held,
        },
        {
            "name": WITHDRAW,
            "events": [{"transfer": {"from": ARM_A, "to": ARM_B, "grasp_frame": END_B}}],
            "arms": {ARM_A: "hold", ARM_B: tool(geometry.end_in_world, END_B)},
            **held,
        },
    ]
    content = {
        "initial": {
            "base_in_world": _written(ORIGIN),
            "joints": {ARM_A: _rounded(rest[:7], 4), ARM_B: _rounded(rest[7:], 4)},
        },
        "deputy": {
            "mass": 0.0,
            "size": list(SIZE),
            "in_world": _written(geometry.deputy_in_world),
            "grasp_frames": {name: _written(frame) for name, frame in frames.items()},
        },
        "phases": [{**phase, "duration": _DURATION, "motion": _MOTION} for phase in phases],
    }
    return as_yaml(content)


def _guess(random: np.random.Generator) -> Array:
    """Return a guess for IK with the elbow outwards, of the arm at +y."""
    joints = _ELBOW_OUT + random.normal(0.0, 0.5, 7)
    joints[[0, 6]] = random.uniform(-2.5, 2.5, 2)
    return joints


def _sweep(random: np.random.Generator, least: float) -> Array:
    """Return a sweep: how far joint 1 goes, at ``least`` rad, and what the other joints add to it (7,)."""
    change = random.normal(0.0, 0.01, 7)
    change[0] = random.uniform(least, 0.9) * random.choice([-1.0, 1.0])
    return change


def _swept(robot: RobotModel, arm: str, joints: Array, sweep: Array) -> Array:
    """Return by how much joints (7,) change in a sweep about joint 1, with what is added to it.

    IK takes the shortest way to a pose. For that to be joints 1 and 7 alone, neither may move the elbow about
    the line from shoulder to wrist: the change is at right angles to the null vector of the Jacobian, which
    depends on neither of the two.
    """
    part = robot.arm_joints[arm]
    q = robot.configuration(ORIGIN, np.zeros(robot.n_joints))
    q[BASE_NQ + part.start : BASE_NQ + part.stop] = joints
    jacobian = pin.computeFrameJacobian(robot.pin, robot.data, q, robot.tool_frame_id[arm])
    null = np.linalg.svd(jacobian[:, BASE_NV + part.start : BASE_NV + part.stop])[2][-1]
    change = np.array(sweep)
    change[6] -= sweep[0] * null[0] / null[6]
    return change


def _turned(one: Array, other: Array) -> bool:
    """Whether a joint would turn too far between two rests."""
    return bool(np.abs(other - one).max() > _TURN)


def _grasp_frame(side: float, turn: float) -> Pose:
    """Return a grasp frame on the -x face of the deputy: the tool points at it, turned about its axis."""
    rotation = pin.utils.rotate("y", pi / 2.0) @ pin.utils.rotate("z", turn)
    return pose_of(pin.SE3(rotation, np.array([-SIZE[0] / 2.0 - _GAP, side * _GRASP_Y, 0.0])))


def _written(pose: Pose) -> dict[str, list[float]]:
    """Return a pose as files have it."""
    placement = se3_of(pose)
    rpy = pin.rpy.matrixToRpy(placement.rotation)
    return {"xyz": _rounded(placement.translation, 6), "rpy": _rounded(rpy, 12)}


def _rounded(values: Array, digits: int) -> list[float]:
    """Return numbers with so many digits behind the point, without -0."""
    return [float(round(float(value), digits)) + 0.0 for value in values]


def _round(values: Any, step: float) -> Any:
    """Return numbers as multiples of a step."""
    return np.round(np.asarray(values) / step) * step
