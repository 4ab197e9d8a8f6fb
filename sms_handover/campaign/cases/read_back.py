"""Read back of drawn values from the parts of a loop: what the plant and the model have, not what was asked.

A value that was set and never arrived would make a campaign about nothing.
"""

from collections.abc import Callable, Mapping, Sequence
from math import isclose
from typing import Any

import pinocchio as pin

from sms_handover.campaign.definition.distributions import Value
from sms_handover.configuration.scenario_file import SHORT
from sms_handover.configuration.values import (
    CONDITIONS,
    DEPUTY,
    MODEL,
    ROBOT,
    ROLES,
    SCHEDULE,
    TRUTH,
    path_of,
)
from sms_handover.errors import ConfigurationError
from sms_handover.model.parts import Inertia, Origin
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.scenario import World
from sms_handover.trajectory.schedule import GraspFrameTarget, JointTarget, ToolTarget
from sms_handover.types import Pose
from sms_handover.units import ns_to_seconds

_REL, _ABS = 1e-9, 1e-12  # [-], [own unit] by which angles of a pose come back from its quaternion
_JOINT = "joint_"


def read_back(loop: Loop, path: str) -> Value:
    """Return the value at a dotted path as the parts of a loop have it.

    Of a value for everybody it is that of the plant, of ``model.…`` that of all others. Raises
    ConfigurationError where nothing can be read back.
    """
    try:
        found = _found(loop, path)
    except (KeyError, IndexError, AttributeError, ValueError, TypeError):
        raise ConfigurationError(
            f"{path} cannot be read back from plant or model, so it cannot be drawn"
        ) from None
    if not isinstance(found, bool | int | float | str):
        raise ConfigurationError(f"{path} is no single value: name an entry, as in {path}[0]")
    return found


def is_exact(loop: Loop, path: str) -> bool:
    """Whether the value at a path comes back as it was set; that of a robot with a model error does not."""
    if loop.scenario.truth.model_error is None:
        return True
    return not path.removeprefix(f"{TRUTH}.").startswith(f"{ROBOT}.")


def is_same(asked: object, found: object) -> bool:
    """Whether a value that was read back is the one that was asked for."""
    if isinstance(asked, bool) or isinstance(found, bool):
        return asked is found
    if isinstance(asked, int | float) and isinstance(found, int | float):
        return isclose(asked, found, rel_tol=_REL, abs_tol=_ABS)
    return asked == found


def _found(loop: Loop, path: str) -> Any:
    """Return what is at a path; raises what a wrong path raises."""
    scenario = loop.scenario
    first, _, rest = path.partition(".")
    if first == CONDITIONS:
        return _of_conditions(loop, path_of(f"{path}:=0")[2])
    if first not in (ROBOT, DEPUTY, SCHEDULE, *ROLES):
        section, name = (SHORT[first], first) if first in SHORT and not rest else (first, rest)
        return getattr(getattr(scenario.parameters, section), name)
    role, document, steps = path_of(f"{path}:=0")
    world: World = scenario.model if role == MODEL else scenario.truth
    if document == ROBOT:
        return _of_robot(world, steps)
    if steps[0] == DEPUTY:
        return _of_deputy(loop, world, steps[1:], of_plant=role != MODEL)
    return _of_schedule(world, steps)


def _of_robot(world: World, steps: Sequence[str]) -> Any:
    """Return a value of a robot: masses from the model in Pinocchio, the rest from what it is made of."""
    robot, description = world.robot, world.robot.description
    if steps[0] == "base":
        base = description.base
        body = robot.pin.inertias[robot.pin.getJointId("root_joint")]
        of_base: dict[str, Callable[[], Any]] = {
            "mass": lambda: float(body.mass),
            "com": lambda: float(body.lever[int(steps[2])]),
            "inertia": lambda: base.inertia.moments[int(steps[2])],
            "size": lambda: base.size[int(steps[2])],
        }
        return of_base[steps[1]]()
    if steps[0] != "arms":
        raise KeyError(steps[0])
    arm = next(item for item in description.arms if item.name == _name(steps[1], robot.arms))
    part, rest = steps[2], steps[3:]
    if part == "gripper":
        return getattr(arm.gripper, rest[0])
    if part == "mount":
        return _of_origin(arm.mount, rest)
    if part == "rotor_inertia":
        number = int(rest[0])
        joint = robot.arm_joints[arm.name].start + number
        return float(robot.pin.armature[robot.pin.nv - robot.n_joints + joint])
    if part == "limits":
        return _of_limits(arm.joints[int(rest[0].removeprefix(_JOINT)) - 1], rest[1:])
    if part == "description" and rest[0] == "joints":
        joint_of, link = arm.joints[int(rest[1])], arm.links[int(rest[1])]
        if rest[2] == "link":
            return link.radius if rest[3] == "radius" else _of_inertia(link.inertia, rest[3:])
        if rest[2] == "origin":
            return _of_origin(joint_of.origin, rest[3:])
        return joint_of.axis[int(rest[3])] if rest[2] == "axis" else _of_limits(joint_of, rest[3:])
    raise KeyError(part)


def _name(step: str, names: Sequence[str]) -> str:
    """Return the name of an item that is given by its name or its index."""
    return names[int(step)] if step.isdecimal() else step


def _of_limits(joint: Any, steps: Sequence[str]) -> float:
    """Return a limit of a joint."""
    limits: Mapping[str, Any] = {
        "position": (joint.lower, joint.upper),
        "velocity": joint.velocity,
        "effort": joint.effort,
    }
    return float(limits[steps[0]][int(steps[1])] if steps[0] == "position" else limits[steps[0]])


def _of_inertia(inertia: Inertia | None, steps: Sequence[str]) -> float:
    """Return a value of the inertia of a body; raises ValueError if it has no mass."""
    if inertia is None:
        raise ValueError("no mass")
    if steps[0] == "mass":
        return inertia.mass
    return {"com": inertia.com, "inertia": inertia.moments}[steps[0]][int(steps[1])]


def _of_origin(origin: Origin, steps: Sequence[str]) -> float:
    """Return a value of the pose of a frame."""
    return {"xyz": origin.xyz, "rpy": origin.rpy}[steps[0]][int(steps[1])]


def _of_pose(pose: Pose, steps: Sequence[str]) -> float:
    """Return a coordinate of a pose, or one of its angles about the fixed axes."""
    if steps[0] == "xyz":
        return float(pose.position[int(steps[1])])
    rotation = pin.Quaternion(pose.quaternion_xyzw).matrix()
    return float({"rpy": pin.rpy.matrixToRpy(rotation)}[steps[0]][int(steps[1])])


def _of_deputy(loop: Loop, world: World, steps: Sequence[str], *, of_plant: bool) -> Any:
    """Return a value of the deputy; where it is at the start is asked of the plant."""
    deputy = world.schedule.deputy
    if steps[0] == "in_world":
        return _of_pose(loop.deputy.deputy_in_world if of_plant else deputy.deputy_in_world, steps[1:])
    if steps[0] == "grasp_frames":
        return _of_pose(deputy.grasp_frames[steps[1]], steps[2:])
    if steps[0] == "twist_in_world":
        twist = loop.deputy.twist_deputy_in_world if of_plant else deputy.twist_in_world
        return float({"linear": twist.linear, "angular": twist.angular}[steps[1]][int(steps[2])])
    if steps[0] == "size":
        return float(deputy.size[int(steps[1])])
    return deputy.mass if steps[0] == "mass" else _of_inertia(deputy.body, steps)


def _of_conditions(loop: Loop, steps: Sequence[str]) -> Any:
    """Return a value of the conditions; of one that every joint has, that of the first."""
    if steps[0] == "model_error":
        return getattr(getattr(loop.scenario.truth.model_error, steps[1]), steps[2])
    value: Any = loop.applied_conditions
    for step in steps:
        value = value[int(step)] if isinstance(value, list) else value[step]
    return value[0] if isinstance(value, list) else value


def _of_schedule(world: World, steps: Sequence[str]) -> Any:
    """Return a value of the schedule."""
    schedule = world.schedule
    if steps[0] == "initial" and steps[1] == "base_in_world":
        return _of_pose(schedule.base_in_world, steps[2:])
    if steps[0] == "initial" and steps[1] == "joints":
        return float(schedule.initial_joints[steps[2]][int(steps[3])])
    if steps[0] != "phases":
        raise KeyError(steps[0])
    name = _name(steps[1], [item.name for item in schedule.phases])
    phase = next(item for item in schedule.phases if item.name == name)
    if steps[2] == "duration":
        return ns_to_seconds(phase.end_ns - phase.start_ns)
    if steps[2] == "motion":
        return ns_to_seconds(phase.motion_ns)
    if steps[2] == "gains":
        value: Any = phase.gains[steps[3]][steps[4]]
        return value[int(steps[5])] if len(steps) > 5 else value
    target, rest = phase.targets[steps[3]], steps[4:]
    if isinstance(target, JointTarget):
        return float(target.position[int(rest[1])])
    if isinstance(target, ToolTarget):
        return _of_pose(target.tool_in_world, rest[1:])
    if isinstance(target, GraspFrameTarget):
        return _of_pose(target.tool_in_grasp_frame, rest[1:])
    raise KeyError(steps[3])
