"""Loading a task schedule from its YAML file, checked as a whole against the robot."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sms_handover.configuration.checks import check_number
from sms_handover.configuration.schedule_fields import HOLD, SCHEDULE_FIELDS, TARGET_KINDS
from sms_handover.configuration.sections import Section
from sms_handover.configuration.yaml_reader import Mapping, load_mapping, read_file
from sms_handover.errors import ScheduleError
from sms_handover.model.deputy import DeputyDescription, read_deputy
from sms_handover.model.poses import read_pose
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
from sms_handover.units import ns_to_seconds, seconds_to_ns


def load_schedule(path: Path, robot: RobotModel, reference_period_ns: int) -> Schedule:
    """Return the schedule in a file; raises what :func:`schedule_of` does, or ConfigurationError."""
    text = read_file(path)
    return schedule_of(load_mapping(text, path), text, robot, reference_period_ns)


def schedule_of(content: Mapping, text: str, robot: RobotModel, reference_period_ns: int) -> Schedule:
    """Return the schedule that the content of a file says, with its ``text`` for the record.

    Raises ScheduleError with line and phase of what is wrong.
    """
    root = Section(content, Path(), ScheduleError, spec=SCHEDULE_FIELDS)
    initial = root.section("initial")
    deputy = read_deputy(root.section("deputy"))
    arms = initial.section("joints")
    arms.only(robot.arms)
    joints = {arm: _joints(arms, arm, arm, robot) for arm in robot.arms}
    sections, phases = root.sections("phases"), list[Phase]()
    for section in sections:
        phases.append(_phase(section, robot, deputy, phases[-1].end_ns if phases else 0))
    check_phases(phases, sections, reference_period_ns)
    return Schedule(joints, read_pose(initial.section("base_in_world")), deputy, tuple(phases), text)


def _joints(section: Section, key: str, arm: str, robot: RobotModel) -> Array:
    """Return the joint angles of an arm under a key, which must be within their limits."""
    part = robot.arm_joints[arm]
    values = np.array(section.vector(key, part.stop - part.start))
    limits = zip(robot.joint_names[part], values, robot.lower[part], robot.upper[part], strict=True)
    for name, value, low, high in limits:
        what = f"{section.where(key)}: {name}"
        check_number(float(value), what, "rad", minimum=low, maximum=high, error=ScheduleError)
    return values


def _phase(section: Section, robot: RobotModel, deputy: DeputyDescription, previous_end_ns: int) -> Phase:
    """Return one phase; it starts where the one before ends."""
    name = section.text("name")
    if "start" in section:
        start_ns = seconds_to_ns(section.number("start"))
        if start_ns != previous_end_ns:
            raise section.error(
                f"phase {name!r} starts at {ns_to_seconds(start_ns):g} s, but the one before it ends at "
                f"{ns_to_seconds(previous_end_ns):g} s",
                "start",
            )
    duration = section.number("duration")
    motion = section.number("motion", duration)
    if motion > duration:
        raise section.error(
            f"{section.path('motion')} is {motion:g} s, must be <= {duration:g} s, the phase's duration; "
            "set motion too, or remove it (null) to move for the whole phase",
            "motion",
        )
    arms = section.section("arms")
    arms.only(robot.arms)
    targets = {arm: _target(arms, arm, robot, deputy) for arm in robot.arms}
    events = section.sections("events") if "events" in section else []
    commands = tuple(_command(event, robot, deputy) for event in events)
    gains = _gains(section.section("gains")) if "gains" in section else {}
    is_first = previous_end_ns == 0
    on_miss = _on_miss(section, commands, is_first=is_first) if "on_miss" in section else OnMiss()
    end_ns = previous_end_ns + seconds_to_ns(duration)
    return Phase(name, previous_end_ns, end_ns, seconds_to_ns(motion), targets, commands, gains, on_miss)


def _on_miss(section: Section, commands: Sequence[GraspCommand], *, is_first: bool) -> OnMiss:
    """Return what a phase does about a grasp that misses: a word, or ``retry`` with a number."""
    key, retry = "on_miss", MissAction.RETRY.value
    if all(command.action is GraspAction.RELEASE for command in commands):
        raise section.error(f"{key!r} is given, but no event of the phase is a grasp or transfer", key)
    if isinstance(section.value(key), str):
        word = section.name(key, "value", [action.value for action in MissAction])
        if word == retry:
            raise section.error(f"{key!r} needs the number of retries: write {{retry: 2}}", key)
        return OnMiss(MissAction(word))
    inner = section.section(key)
    retries = int(inner.number(retry))
    if is_first:
        raise section.error("a retry repeats the phase before, but this is the first one", key)
    return OnMiss(MissAction.RETRY, retries)


def _target(arms: Section, arm: str, robot: RobotModel, deputy: DeputyDescription) -> ArmTarget:
    """Return the target of one arm: the word ``hold`` or a mapping of exactly one kind."""
    value = arms.value(arm)
    if value == HOLD:
        return Hold()
    if not isinstance(value, dict):
        known = ", ".join(TARGET_KINDS)
        raise arms.error(f"{arms.path(arm)} is {value!r}, must be hold or a mapping with one of {known}", arm)
    section = arms.section(arm)
    kind = section.one_of(arms.path(arm))
    if kind == "joints":
        return JointTarget(_joints(section, kind, arm, robot))
    if kind == "tool_in_world":
        return ToolTarget(read_pose(section.section("tool_in_world")))
    offset = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
    if "tool_in_grasp_frame" in section:
        offset = read_pose(section.section("tool_in_grasp_frame"))
    return GraspFrameTarget(_grasp_frame(section, deputy), offset)


def _command(event: Section, robot: RobotModel, deputy: DeputyDescription) -> GraspCommand:
    """Return one event of a phase: ``grasp``, ``release`` or ``transfer`` and its details."""
    action = GraspAction(event.one_of("an event"))
    details = event.section(action.value)
    if action is GraspAction.RELEASE:
        return GraspCommand(action, details.name("arm", "arm", robot.arms))
    if action is GraspAction.GRASP:
        return GraspCommand(action, details.name("arm", "arm", robot.arms), _grasp_frame(details, deputy))
    giver, taker = (details.name(key, "arm", robot.arms) for key in ("from", "to"))
    return GraspCommand(action, taker, _grasp_frame(details, deputy), giver)


def _grasp_frame(section: Section, deputy: DeputyDescription) -> str:
    """Return the name of a grasp frame of the deputy."""
    return section.name("grasp_frame", "grasp frame", deputy.grasp_frames)


def _gains(section: Section) -> dict[str, dict[str, object]]:
    """Return the gains per control law; the controller checks names and values."""
    laws = {law: section.section(law) for law in section.keys}
    return {law: {name: gains.value(name) for name in gains.keys} for law, gains in laws.items()}
