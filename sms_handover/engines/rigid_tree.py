"""Tree of rigid bodies of a URDF: what fixed joints hold together is one body, in plain NumPy."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from sms_handover.model.parts import Origin
from sms_handover.model.urdf_tree import FIXED, TreeLink, UrdfTree, read_urdf
from sms_handover.types import Array

Frame = tuple[Array, Array]  # rotation matrix (3, 3) and origin (3,) m in another frame


@dataclass(eq=False)
class RigidBody:
    """Links that move as one, in the frame of the first: kg, m, and kg m^2 about the centre of mass.

    ``joint`` carries it and turns it about ``axis``; at angle 0 its frame is ``in_parent`` of body number
    ``parent``. The body of the root has neither. ``frames`` has the place of each of its links.
    """

    joint: str
    parent: int
    in_parent: Frame
    axis: Array
    mass: float = 0.0
    com: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    frames: dict[str, Frame] = field(default_factory=dict)

    def add(self, mass: float, com: Array, inertia: Array) -> None:
        """Add a mass with its inertia about its own centre, by the parallel-axis theorem."""
        total = self.mass + mass
        centre = (self.mass * self.com + mass * com) / total
        self.inertia = (
            self.inertia + inertia + _of_point(self.mass, self.com - centre) + _of_point(mass, com - centre)
        )
        self.mass, self.com = total, centre


def rigid_bodies(urdf: str) -> list[RigidBody]:
    """Return the bodies of a robot: the root's first, then each after the one that carries it.

    Raises RobotDescriptionError if the text is no URDF.
    """
    tree = read_urdf(urdf)
    bodies: list[RigidBody] = []
    _grow(tree, tree.links[tree.root], RigidBody("", -1, _still(), np.zeros(3)), _still(), bodies)
    return bodies


def placed(bodies: list[RigidBody], root: Frame, angles: Array) -> list[Frame]:
    """Return the frame of every body in ``world``; ``angles`` (n,) rad in the order of the bodies."""
    found = [root]
    for body, angle in zip(bodies[1:], angles, strict=True):
        turned = _within(found[body.parent], body.in_parent)
        found.append((turned[0] @ turn_about(body.axis, angle), turned[1]))
    return found


def centre_of_mass(
    bodies: list[RigidBody], frames: list[Frame], twist: tuple[Array, Array], rates: Array
) -> tuple[Array, Array]:
    """Return position m and velocity m/s of the centre of mass in ``world``.

    ``twist`` is velocity of the root's origin and angular velocity of the root in ``world`` axes; ``rates``
    (n,) rad/s are those of the joints. A body moves with v = v_p + w_p x (r - r_p), w = w_p + a q'.
    """
    motion, total = [twist], 0.0
    centre, velocity = np.zeros(3), np.zeros(3)
    for number, (body, (axes, origin)) in enumerate(zip(bodies, frames, strict=True)):
        if number:
            linear, angular = motion[body.parent]
            linear = linear + np.cross(angular, origin - frames[body.parent][1])
            motion.append((linear, angular + axes @ body.axis * rates[number - 1]))
        linear, angular = motion[number]
        arm = axes @ body.com
        centre += body.mass * (origin + arm)
        velocity += body.mass * (linear + np.cross(angular, arm))
        total += body.mass
    return centre / total, velocity / total


def turn_about(axis: Array, angle: float) -> Array:
    """Return the rotation matrix about a unit axis, by Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross))


def _grow(tree: UrdfTree, link: TreeLink, body: RigidBody, at: Frame, bodies: list[RigidBody]) -> None:
    """Add a link, and what it carries, to the body it belongs to; a moving joint begins a new one."""
    if not body.frames:
        bodies.append(body)
    number = bodies.index(body)
    body.frames[link.name] = at
    if link.inertia is not None:
        axes = at[0] @ pin.rpy.rpyToMatrix(np.array(link.inertia_rpy))
        moments = axes @ link.inertia.matrix @ axes.T
        body.add(link.inertia.mass, at[1] + at[0] @ np.array(link.inertia.com), moments)
    for joint in tree.below(link.name):
        place = _within(at, _frame(joint.origin))
        child = tree.links[joint.child]
        if joint.kind == FIXED:
            _grow(tree, child, body, place, bodies)
        else:
            moved = RigidBody(joint.name, number, place, np.array(joint.axis))
            _grow(tree, child, moved, _still(), bodies)


def chains(bodies: list[RigidBody]) -> Iterator[list[int]]:
    """Yield the numbers of the bodies of each serial chain that the root carries."""
    for first in (number for number, body in enumerate(bodies) if body.parent == 0):
        chain = [first]
        while following := [number for number, body in enumerate(bodies) if body.parent == chain[-1]]:
            chain += following
        yield chain


def _still() -> Frame:
    return np.eye(3), np.zeros(3)


def _frame(origin: Origin) -> Frame:
    return pin.rpy.rpyToMatrix(np.array(origin.rpy)), np.array(origin.xyz)


def _within(outer: Frame, inner: Frame) -> Frame:
    """Return a frame in what the outer one is in."""
    return outer[0] @ inner[0], outer[1] + outer[0] @ inner[1]


def _of_point(mass: float, at: Array) -> Array:
    """Return the inertia of a point mass."""
    return np.asarray(mass * (at @ at * np.eye(3) - np.outer(at, at)))
