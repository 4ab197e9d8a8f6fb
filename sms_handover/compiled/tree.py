"""Body tree: the inertial and geometric data of a robot, read from its Pinocchio model."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pinocchio as pin

from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.types import Array, read_only

_ROUNDING = 1e-14  # [-, m, kg m, kg m^2] entries this close to -1, 0 or 1 are set to it
_BASE = 1  # index of the base among Pinocchio's joints; the universe is 0


@dataclass(frozen=True, eq=False)
class Body:
    """A body and the joint that carries it, in the frame of the joint, which moves with the body.

    The origin of the frame is where the axis of the joint comes nearest to the origin of the parent: fewer
    coordinates are other than zero there than where the model has it, and the equations are shorter.
    ``parent`` is the index of the body that carries the joint, -1 for the base. ``rotation`` (3, 3) and
    ``place`` (3,) m are those of the joint's frame at angle zero in the frame of the parent, ``axis`` (3,)
    is that of the joint. ``first_moment`` (3,) kg m is the mass times the centre of mass, ``inertia``
    (3, 3) kg m^2 is about the origin of the frame; ``rotor`` kg m^2 is the reflected inertia of the motor.
    """

    parent: int
    rotation: Array
    place: Array
    axis: Array
    mass: float
    first_moment: Array
    inertia: Array
    rotor: float


@dataclass(frozen=True, eq=False)
class Tool:
    """A tool, its place on the body that carries it, and the joints of its arm.

    ``rotation`` (3, 3) and ``place`` (3,) m are in the frame of ``body``; the arm has ``joints``
    joints, from ``first_joint`` on.
    """

    body: int
    rotation: Array
    place: Array
    first_joint: int
    joints: int


PER_BODY = 11  # mass, first moment (3), inertia (6: xx xy xz yy yz zz), rotor
PER_MOUNT = 12  # rotation, row by row, and place


def mounts_of(bodies: Sequence[Body]) -> tuple[int, ...]:
    """Return the bodies whose place on the base is an argument of the compiled functions.

    Those are all that it carries if one of them is turned at an odd angle, as errors of mounts lead to: one
    library then serves robots that differ in their mounts. Where each turn is one by quarters, constants save
    time.
    """
    carried = tuple(index for index, body in enumerate(bodies) if body.parent == 0)
    is_odd = any(np.any(np.abs(bodies[index].rotation) % 1.0) for index in carried)
    return carried if is_odd else ()


def parameter_count(bodies: Sequence[Body]) -> int:
    """Return how many parameters the compiled functions of a robot have."""
    return PER_BODY * len(bodies) + PER_MOUNT * len(mounts_of(bodies))


def parameters_of(bodies: Sequence[Body]) -> Array:
    """Return the parameters of bodies, the argument of the compiled functions.

    Of each mass kg, first moment (3) kg m, inertia xx xy xz yy yz zz kg m^2 and rotor kg m^2, as in Body;
    then rotation and place m of mounts that are arguments.
    """
    upper = np.triu_indices(3)
    rows = [(body.mass, *body.first_moment, *body.inertia[upper], body.rotor) for body in bodies]
    mounts = [(*bodies[at].rotation.ravel(), *bodies[at].place) for at in mounts_of(bodies)]
    return read_only(np.concatenate([np.ravel(rows), np.ravel(mounts)]))


@lru_cache(maxsize=8)  # a loop asks a dozen times for the same robots, in truth and model, bare and loaded
def body_tree(robot: RobotModel) -> tuple[Body, ...]:
    """Return the bodies, base first, then one for each joint in the order of ``robot.joint_names``."""
    model = robot.pin
    along = _shifts(model)
    return tuple(_body(model, index, along) for index in range(_BASE, model.njoints))


@lru_cache(maxsize=8)
def tools_of(robot: RobotModel) -> tuple[Tool, ...]:
    """Return the tools in the order of ``robot.arms``."""
    return tuple(_tool(robot, arm) for arm in robot.arms)


def _tool(robot: RobotModel, arm: str) -> Tool:
    """Return the tool of an arm."""
    frame, joints = robot.pin.frames[robot.tool_frame_id[arm]], robot.arm_joints[arm]
    placement, body = frame.placement, frame.parentJoint - _BASE
    rotation = _tidy(placement.rotation)
    place = _tidy(placement.translation - _shifts(robot.pin)[frame.parentJoint])
    return Tool(body, rotation, place, joints.start, joints.stop - joints.start)


def _shifts(model: pin.Model) -> list[Array]:
    """Return by joint where our frame begins in that of the model (3,) m: on the axis of the joint."""
    shifts = [np.zeros(3)] * (_BASE + 1)
    for index in range(_BASE + 1, model.njoints):
        placement, axis = model.jointPlacements[index], _axis(model, index)
        place = placement.translation - shifts[model.parents[index]]
        shifts.append(-(place @ (placement.rotation @ axis)) * axis)
    return shifts


def _body(model: pin.Model, index: int, shifts: Sequence[Array]) -> Body:
    """Return one body of a Pinocchio model."""
    placement, inertia, parent = model.jointPlacements[index], model.inertias[index], model.parents[index]
    shift, is_base = shifts[index], index == _BASE
    lever = np.array(inertia.lever) - shift
    about_origin = inertia.inertia + inertia.mass * (lever @ lever * np.eye(3) - np.outer(lever, lever))
    return Body(
        parent=-1 if is_base else parent - _BASE,
        rotation=_tidy(placement.rotation),
        place=_tidy(placement.translation + placement.rotation @ shift - shifts[parent]),
        axis=read_only(np.zeros(3)) if is_base else _axis(model, index),
        mass=float(inertia.mass),
        first_moment=_tidy(inertia.mass * lever),
        inertia=_tidy(about_origin),
        rotor=0.0 if is_base else float(model.armature[BASE_NV - 1 + index - _BASE]),
    )


def _axis(model: pin.Model, index: int) -> Array:
    """Return the axis (3,) of a revolute joint in its own frame."""
    joint = model.joints[index]
    data = joint.createData()
    joint.calc(data, pin.neutral(model))
    return _tidy(np.array(data.S).reshape(-1)[3:])


def _tidy(values: Array) -> Array:
    """Return an array with entries close to -1, 0 and 1 set to them: cos(pi/2) as 0 removes whole terms."""
    array = np.array(values, dtype=np.float64)
    nearest = np.clip(np.round(array), -1.0, 1.0)
    return read_only(np.where(np.abs(array - nearest) < _ROUNDING, nearest + 0.0, array))
