"""Reading a task schedule from its YAML file, checked whole against the robot."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sms_handover.configuration.sections import Section, read_section
from sms_handover.errors import ScheduleError, UnknownNameError
from sms_handover.model.deputy import DeputyDescription
from sms_handover.model.poses import pose_from_xyz_rpy
from sms_handover.model.robot_model import RobotModel
from sms_handover.trajectory.schedule import (
    ArmTarget,
    GraspFrameTarget,
    Hold,
    JointTarget,
    MissAction,
    OnMiss,
    Phase,
    Schedule,
    ToolTarget,
)
from sms_handover.trajectory.validate import check_phases
from sms_handover.types import Array, GraspAction, GraspCommand, Pose
from sms_handover.units import seconds_to_ns

MOST_RETRIES = 100  # of one phase; more is a mistake rather than patience
_TARGET_KINDS = ("hold", "joints", "tool_in_world", "grasp_frame")


def load_schedule(path: Path, robot: RobotModel, reference_period_ns: int) -> Schedule:
    """Return the schedule in a file; raises ScheduleError naming the line or phase that is wrong."""
    root, text = read_section(path)
    root.reject_unknown(("initial", "deputy", "phases"))
    initial = root.section("initial")
    initial.reject_unknown(("base_in_world", "joints"))
    deputy = _deputy(root.section("deputy"))
    joints = _initial_joints(initial.section("joints"), robot)
    phases: list[Phase] = []
    for item in root.sections("phases"):
        phases.append(_phase(item, robot, deputy, phases[-1].end_ns if phases else 0))
    if not phases:
        raise root.error("'phases' is empty: a schedule needs at least one phase")
    lines = [item.line for item in root.sections("phases")]
    check_phases(path, phases, lines, reference_period_ns)
    base = _pose(initial.section("base_in_world"))
    return Schedule(joints, base, deputy, tuple(phases), text)


def _deputy(section: Section) -> DeputyDescription:
    """Return the deputy of the schedule."""
    section.reject_unknown(("mass", "size", "in_world", "grasp_frames"))
    mass = section.number("mass", "kg", minimum=0.0)
    if mass != 0.0:
        raise section.error(f"'mass' is {mass:g} kg, but only a massless deputy (0 kg) can be simulated yet")
    size = np.array(section.vector("size", 3, "m"))
    if not np.all(size > 0):
        raise section.error("'size' must be three positive lengths in m", section.line_of("size"))
    frames = section.section("grasp_frames")
    grasp_frames = {name: _pose(frames.section(name)) for name in frames.keys}
    return DeputyDescription(mass, size, _pose(section.section("in_world")), grasp_frames)


def _initial_joints(section: Section, robot: RobotModel) -> dict[str, Array]:
    """Return the initial joint angles of every arm, which must be within their limits."""
    section.reject_unknown(robot.arms)
    return {arm: _joints(section, arm, arm, robot) for arm in robot.arms}


def _joints(section: Section, key: str, arm: str, robot: RobotModel) -> Array:
    """Return the joint angles of an arm under a key, which must be within their limits."""
    part = robot.arm_joints[arm]
    values = np.array(section.vector(key, part.stop - part.start, "rad"))
    limits = zip(robot.joint_names[part], values, robot.lower[part], robot.upper[part], strict=True)
    for name, value, low, high in limits:
        if not low <= value <= high:
            raise section.error(
                f"{name} is {value:g} rad, allowed is {low:g} to {high:g} rad", section.line_of(key)
            )
    return values


def _phase(section: Section, robot: RobotModel, deputy: DeputyDescription, previous_end_ns: int) -> Phase:
    """Return one phase; it starts where the one before ends unless it says when."""
    section.reject_unknown(("name", "start", "duration", "motion", "arms", "events", "on_miss", "gains"))
    name = section.text("name")
    start_ns = previous_end_ns
    if section.has("start"):
        start_ns = seconds_to_ns(section.number("start", "s", minimum=0.0))
        if start_ns != previous_end_ns:
            raise section.error(
                f"phase {name!r} starts at {start_ns / 1e9:g} s, but the one before it ends at "
                f"{previous_end_ns / 1e9:g} s",
                section.line_of("start"),
            )
    duration_ns = seconds_to_ns(section.number("duration", "s", minimum=1e-9))
    motion_ns = duration_ns
    if section.has("motion"):
        motion_ns = seconds_to_ns(section.number("motion", "s", minimum=1e-9))
        if motion_ns > duration_ns:
            raise section.error(
                f"phase {name!r}: 'motion' is longer than the phase", section.line_of("motion")
            )
    arms = section.section("arms")
    arms.reject_unknown(robot.arms)
    targets = {arm: _target(arms, arm, robot, deputy) for arm in robot.arms}
    events = section.sections("events") if section.has("events") else []
    commands = tuple(_command(event, robot, deputy) for event in events)
    gains = _gains(section.section("gains")) if section.has("gains") else {}
    on_miss = _on_miss(section, commands, is_first=start_ns == 0) if section.has("on_miss") else OnMiss()
    return Phase(name, start_ns, start_ns + duration_ns, motion_ns, targets, commands, gains, on_miss)


def _on_miss(section: Section, commands: Sequence[GraspCommand], *, is_first: bool) -> OnMiss:
    """Return what a phase does about a grasp that misses: a word, or ``retry`` with a number."""
    key, words = "on_miss", tuple(action.value for action in MissAction)
    line = section.line_of(key)
    if all(command.action is GraspAction.RELEASE for command in commands):
        raise section.error(f"{key!r} is given, but no event of the phase is a grasp or transfer", line)
    if section.is_text(key):
        word = section.text(key)
        if word not in words:
            raise ScheduleError(str(UnknownNameError("value", word, words, f"{section.where(key)}: {key!r}")))
        if word == MissAction.RETRY.value:
            raise section.error(f"{key!r} needs to know how often: write {{retry: 2}}", line)
        return OnMiss(MissAction(word))
    inner = section.section(key)
    inner.reject_unknown((MissAction.RETRY.value,))
    retries = inner.count(MissAction.RETRY.value, minimum=1, maximum=MOST_RETRIES)
    if is_first:
        raise section.error("a retry does the phase before again, but this is the first one", line)
    return OnMiss(MissAction.RETRY, retries)


def _target(arms: Section, arm: str, robot: RobotModel, deputy: DeputyDescription) -> ArmTarget:
    """Return the target of one arm: the word ``hold`` or a mapping of exactly one kind."""
    if not arms.has(arm):
        raise arms.error(f"target of {arm!r} is missing: give one of {', '.join(_TARGET_KINDS)}")
    if arms.is_text(arm):
        if arms.value(arm) != "hold":
            known = "'hold' or a mapping with one of " + ", ".join(_TARGET_KINDS[1:])
            raise arms.error(f"target of {arm!r} is {arms.value(arm)!r}, expected {known}", arms.line_of(arm))
        return Hold()
    section = arms.section(arm)
    section.reject_unknown(("joints", "tool_in_world", "grasp_frame", "tool_in_grasp_frame"))
    kinds = [kind for kind in _TARGET_KINDS if section.has(kind)]
    if len(kinds) != 1:
        raise section.error(f"target of {arm!r} needs exactly one of {', '.join(_TARGET_KINDS[1:])}")
    if kinds[0] == "joints":
        return JointTarget(_joints(section, "joints", arm, robot))
    if kinds[0] == "tool_in_world":
        return ToolTarget(_pose(section.section("tool_in_world")))
    offset = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
    if section.has("tool_in_grasp_frame"):
        offset = _pose(section.section("tool_in_grasp_frame"))
    return GraspFrameTarget(_grasp_frame(section, "grasp_frame", deputy), offset)


def _command(event: Section, robot: RobotModel, deputy: DeputyDescription) -> GraspCommand:
    """Return one event of a phase: ``grasp``, ``release`` or ``transfer`` and its details."""
    kinds = tuple(action.value for action in GraspAction)
    event.reject_unknown(kinds)
    if len(event.keys) != 1:
        raise event.error(f"an event is exactly one of {', '.join(kinds)}")
    action = GraspAction(event.keys[0])
    details = event.section(action.value)
    if action is GraspAction.RELEASE:
        details.reject_unknown(("arm",))
        return GraspCommand(action, _arm(details, "arm", robot))
    if action is GraspAction.GRASP:
        details.reject_unknown(("arm", "grasp_frame"))
        return GraspCommand(action, _arm(details, "arm", robot), _grasp_frame(details, "grasp_frame", deputy))
    details.reject_unknown(("from", "to", "grasp_frame"))
    frame = _grasp_frame(details, "grasp_frame", deputy)
    return GraspCommand(action, _arm(details, "to", robot), frame, _arm(details, "from", robot))


def _arm(section: Section, key: str, robot: RobotModel) -> str:
    """Return the name of an arm of the robot."""
    return _known(section, key, "arm", robot.arms)


def _grasp_frame(section: Section, key: str, deputy: DeputyDescription) -> str:
    """Return the name of a grasp frame of the deputy."""
    return _known(section, key, "grasp frame", tuple(deputy.grasp_frames))


def _known(section: Section, key: str, kind: str, known: tuple[str, ...]) -> str:
    """Return the text under a key if it is among the known names."""
    name = section.text(key)
    if name not in known:
        prefix = str(section.error("", section.line_of(key))).rstrip(": ")
        raise ScheduleError(str(UnknownNameError(kind, name, known, prefix)))
    return name


def _gains(section: Section) -> dict[str, dict[str, object]]:
    """Return the gains per control law; the controller checks names and values."""
    gains = {}
    for law in section.keys:
        inner = section.section(law)
        gains[law] = {name: inner.value(name) for name in inner.keys}
    return gains


def _pose(section: Section) -> Pose:
    """Return the pose given by ``xyz`` in m and ``rpy`` in rad (fixed axes, as in URDF)."""
    section.reject_unknown(("xyz", "rpy"))
    return pose_from_xyz_rpy(
        np.array(section.vector("xyz", 3, "m")), np.array(section.vector("rpy", 3, "rad"))
    )
