"""Body tree: the inertial and geometric data of a robot, read from its Pinocchio model."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
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
    ``turns`` are those of a mount, about axes of the parent one after the other, each by its axis, cosine and
    sine: ``rotation`` and ``place`` are then in the axes that they lead to.
    """

    parent: int
    rotation: Array
    place: Array
    axis: Array
    mass: float
    first_moment: Array
    inertia: Array
    rotor: float
    turns: tuple[tuple[int, float, float], ...] = ()


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
PER_MOUNT = 9  # cosines and sines of three turns, and place
_MASS, _FIRST_MOMENT, _DIAGONAL = 0, 1, (4, 7, 9)  # where they are among the numbers of a body


def coordinate_axis(body: Body) -> int | None:
    """Return the axis of the frame that a joint turns about, None if it is another one."""
    return int(np.argmax(body.axis)) if np.count_nonzero(body.axis == 1.0) == 1 else None


def mounts_of(bodies: Sequence[Body]) -> tuple[int, ...]:
    """Return the bodies whose place on the base is an argument of the compiled functions.

    Those are all that it carries if one of them is turned at an odd angle, as errors of mounts lead to: one
    library then serves robots that differ in their mounts. Where each turn is one by quarters, constants save
    time.
    """
    carried = tuple(index for index, body in enumerate(bodies) if body.parent == 0)
    is_odd = any(np.any(np.abs(bodies[index].rotation) % 1.0) for index in carried)
    return carried if is_odd else ()


def hung_of(bodies: Sequence[Body]) -> dict[int, int]:
    """Return the bodies that hang from odd mounts, each with the axis along which its place is an argument.

    The origin of a mounted joint is where its axis comes nearest to the origin of the base, so how far along
    that axis the next joint begins depends on the mount.
    """
    mounts, found = mounts_of(bodies), {}
    for index, body in enumerate(bodies):
        axis = coordinate_axis(bodies[body.parent]) if body.parent in mounts else None
        if axis is not None:
            found[index] = axis
    return found


def lightened_of(bodies: Sequence[Body]) -> dict[int, tuple[int, ...]]:
    """Return the bodies that leave what they can to their parents, and which of their numbers are then zero.

    Mass on the axis of a joint, and inertia that is the same about all axes across it, move as if they were
    fixed to the parent, so that they can be counted there [Khalil2004]. The equations then have fewer
    operations, and other last digits: those of robots without odd mounts keep theirs. A body that carries no
    other is left as it is, since a payload may change it alone.
    """
    if not mounts_of(bodies):
        return {}
    found: dict[int, tuple[int, ...]] = {}
    for index in {body.parent for body in bodies[1:]} - {0}:
        axis = coordinate_axis(bodies[index])
        if axis is not None:
            found[index] = (_MASS, _FIRST_MOMENT + axis, _DIAGONAL[(axis + 2) % 3])
    return found


def parameter_count(bodies: Sequence[Body]) -> int:
    """Return how many parameters the compiled functions of a robot have."""
    return PER_BODY * len(bodies) + PER_MOUNT * len(mounts_of(bodies)) + len(hung_of(bodies))


@lru_cache(maxsize=8)
def parameters_of(bodies: tuple[Body, ...]) -> Array:
    """Return the parameters of bodies, the argument of the compiled functions.

    Of each mass kg, first moment (3) kg m, inertia xx xy xz yy yz zz kg m^2 and rotor kg m^2, as in Body, but
    for what :func:`lightened_of` leaves to the parent; then, of mounts that are arguments, cosines and sines
    of three turns and the place m, as in :func:`mount_numbers`; then where :func:`hung_of` bodies begin, m.
    """
    upper = np.triu_indices(3)
    mounts = [mount_numbers(bodies[at]) for at in mounts_of(bodies)]
    lightened = _lightened(bodies)
    rows = [(body.mass, *body.first_moment, *body.inertia[upper], body.rotor) for body in lightened]
    hung = [bodies[at].place[axis] for at, axis in hung_of(bodies).items()]
    return read_only(np.concatenate([np.ravel(rows), np.ravel(mounts), hung]))


def mount_numbers(body: Body) -> Array:
    """Return the rotation R of a mount as turns R_k(a) R_j(b) R_k(c), and its place in the axes after two.

    Cosine and sine of a, b and c, then the place m (9,), for the axis k of the joint, or z, and j the second
    after it. The third turn only shifts the angle of the joint; and as the origin of the joint is where its
    axis comes nearest to that of the parent, the place has no part along k.
    """
    axis = coordinate_axis(body)
    k = 2 if axis is None else axis
    i, j = (k + 1) % 3, (k + 2) % 3
    across = float(np.sqrt(body.rotation[i, k] ** 2 + body.rotation[j, k] ** 2))
    first = (body.rotation[i, k] / across, body.rotation[j, k] / across) if across else (1.0, 0.0)
    second = float(body.rotation[k, k]), across
    turned = _turn(k, *first) @ _turn(j, *second)
    rest, place = turned.T @ body.rotation, turned.T @ body.place
    if axis is not None:
        place[axis] = 0.0
    return np.array([*first, *second, rest[i, i], rest[j, i], *place])


def _turn(axis: int, cosine: float, sine: float) -> Array:
    """Return the rotation about an axis of the frame."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = cosine
    matrix[j, i], matrix[i, j] = sine, -sine
    return matrix


def _lightened(bodies: Sequence[Body]) -> list[Body]:
    """Return bodies whose parents have what :func:`lightened_of` says."""
    found, lightened = list(bodies), lightened_of(bodies)
    for index in sorted(lightened, reverse=True):
        body, parent = found[index], found[bodies[index].parent]
        axis = int(np.argmax(body.axis))
        along = np.eye(3)[axis]
        across = body.inertia[(axis + 2) % 3, (axis + 2) % 3] * (np.eye(3) - np.outer(along, along))
        moment = body.first_moment[axis] * along
        found[index] = replace(
            body, mass=0.0, first_moment=body.first_moment - moment, inertia=body.inertia - across
        )
        turned, place = body.rotation @ moment, body.place
        half = turned + 0.5 * body.mass * place
        shift = 2.0 * (place @ half) * np.eye(3) - np.outer(place, half) - np.outer(half, place)
        found[body.parent] = replace(
            parent,
            mass=parent.mass + body.mass,
            first_moment=parent.first_moment + turned + body.mass * place,
            inertia=parent.inertia + body.rotation @ across @ body.rotation.T + shift,
        )
    return found


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
