"""MJCF text of a robot, for MuJoCo: bodies, joints, motors and tool sites of a URDF, and its solids.

Numbers keep full double precision.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin

from sms_handover.model.parts import Floats, Inertia, Origin
from sms_handover.model.urdf_tree import FIXED, TreeJoint, TreeLink, UrdfTree, read_urdf
from sms_handover.types import Array, Pose

_EXACTLY_AS_WRITTEN = {  # nothing that MuJoCo's compiler would change or add of its own accord
    "alignfree": "false",
    "autolimits": "false",
    "balanceinertia": "false",
    "boundinertia": "0",
    "boundmass": "0",
    "fusestatic": "false",
    "inertiafromgeom": "false",
    "settotalmass": "-1",
}
_STILL = {"gravity": "0 0 0", "wind": "0 0 0", "density": "0", "viscosity": "0"}


@dataclass(frozen=True, eq=False)
class Solid:
    """A solid of a link: ``kind`` as MJCF names it, with MJCF's half sizes in m; a mesh has ``vertices``.

    ``vertices`` (V, 3) m are those of a convex hull, in the frame of the solid.
    """

    name: str
    link: str
    kind: str
    size: tuple[float, ...]
    pose_in_link: Pose
    vertices: Array | None = None


@dataclass(frozen=True, eq=False)
class Payload:
    """A body that a link carries: its inertia in its own axes, and its pose in the link."""

    name: str
    link: str
    inertia: Inertia
    pose_in_link: Pose


def to_mjcf(
    urdf: str,
    rotor_inertia: Mapping[str, float] | None = None,
    *,
    floating: bool = True,
    limited: bool = True,
    solids: Iterable[Solid] = (),
    may_touch: Iterable[tuple[str, str]] = (),
    payload: Payload | None = None,
) -> str:
    """Return the robot of URDF text as MJCF, without damping and gravity.

    A link is a body of the same name; one without mass and shape at the end of a chain is a site.
    ``rotor_inertia`` kg m^2 by joint is what motors add, which a URDF cannot say. The root moves freely if
    ``floating`` and is fixed to the world otherwise; joints have their limits if ``limited``. Between the
    links of ``may_touch`` solids do not collide. A ``payload`` is a child of the body that carries it. Raises
    RobotDescriptionError if the text is no URDF.
    """
    tree = read_urdf(urdf)
    root = ET.Element("mujoco", model=tree.name)
    ET.SubElement(root, "compiler", _EXACTLY_AS_WRITTEN, angle="radian", eulerseq="XYZ")
    option = ET.SubElement(root, "option", _STILL, integrator="RK4")
    ET.SubElement(option, "flag", filterparent="disable")  # what may touch is stated
    writer = _Writer(tree, rotor_inertia or {}, limited, tuple(solids), payload)
    writer.meshes(root)
    body = ET.SubElement(ET.SubElement(root, "worldbody"), "body", name=tree.root)
    if floating:
        ET.SubElement(body, "freejoint", name="floating")
    writer.fill(body, tree.links[tree.root])
    if pairs := tuple(may_touch):
        contact = ET.SubElement(root, "contact")
        for one, other in pairs:
            ET.SubElement(contact, "exclude", body1=one, body2=other)
    writer.motors(root)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


class _Writer:
    """Writes the bodies of a tree, each inside the one that carries it."""

    def __init__(
        self,
        tree: UrdfTree,
        rotor_inertia: Mapping[str, float],
        limited: bool,
        solids: tuple[Solid, ...],
        payload: Payload | None,
    ) -> None:
        self._tree, self._rotor, self._limited = tree, rotor_inertia, limited
        self._solids, self._payload = solids, payload

    def meshes(self, root: ET.Element) -> None:
        """Add the vertices of all convex hulls."""
        asset = ET.Element("asset")
        for solid in self._solids:
            if solid.vertices is not None:
                vertices = _text(np.ravel(solid.vertices))
                ET.SubElement(asset, "mesh", name=solid.name, vertex=vertices, inertia="convex")
        if len(asset):
            root.append(asset)

    def fill(self, body: ET.Element, link: TreeLink) -> None:
        """Give a body its inertia, its solids, and the bodies that it carries."""
        if link.inertia is not None:
            _inertial(body, link.inertia, link.inertia_rpy)
        if self._payload is not None and self._payload.link == link.name:
            place = _at(self._payload.pose_in_link)
            _inertial(ET.SubElement(body, "body", place, name=self._payload.name), self._payload.inertia)
        for solid in self._solids:
            if solid.link == link.name:
                _geom(body, solid)
        for joint in self._tree.below(link.name):
            child = self._tree.links[joint.child]
            if self._is_frame(joint, child):
                ET.SubElement(body, "site", _place(joint.origin), name=child.name)
                continue
            carried = ET.SubElement(body, "body", _place(joint.origin), name=child.name)
            if joint.kind != FIXED:
                self._joint(carried, joint)
            self.fill(carried, child)

    def motors(self, root: ET.Element) -> None:
        """Add a motor per joint, which gives no more than the joint's limit."""
        moving = [joint for joint in self._tree.joints if joint.kind != FIXED and not joint.is_passive]
        actuator = ET.SubElement(root, "actuator")
        for joint in moving:
            known = isfinite(joint.effort)
            bounds = (
                {"ctrllimited": "true", "ctrlrange": _text([-joint.effort, joint.effort])} if known else {}
            )
            ET.SubElement(actuator, "motor", bounds, name=joint.name, joint=joint.name)

    def _is_frame(self, joint: TreeJoint, link: TreeLink) -> bool:
        """Whether a link is nothing but a frame at the end of a chain."""
        carries = self._payload is not None and self._payload.link == link.name
        bare = link.inertia is None and not link.has_shape and not carries
        return joint.kind == FIXED and bare and not self._tree.below(link.name)

    def _joint(self, body: ET.Element, joint: TreeJoint) -> None:
        """Let a body move along the axis of its joint, without friction."""
        armature = self._rotor.get(joint.name, 0.0)
        motor = {"armature": _text([armature]), "damping": "0", "frictionloss": "0", "stiffness": "0"}
        bounds = {}
        if joint.is_passive:
            motor |= {"stiffness": _text([joint.stiffness]), "damping": _text([joint.damping])}
        elif self._limited and isfinite(joint.lower) and isfinite(joint.upper):
            bounds = {"limited": "true", "range": _text([joint.lower, joint.upper])}
        kind = "slide" if joint.kind == "prismatic" else "hinge"
        ET.SubElement(body, "joint", motor | bounds, name=joint.name, type=kind, axis=_text(joint.axis))


def _inertial(body: ET.Element, inertia: Inertia, rpy: Floats = (0.0, 0.0, 0.0)) -> None:
    """Give a body its inertia, of which the axes are turned by ``rpy``, by its principal axes.

    They are found here: MuJoCo 3.10 stops its own search for them at about 1e-7 rad.
    """
    moments, axes = np.linalg.eigh(inertia.matrix)
    if any(rpy):
        axes = pin.rpy.rpyToMatrix(np.array(rpy)) @ axes
    place = {"pos": _text(inertia.com), "xyaxes": _text([*axes[:, 0], *axes[:, 1]])}
    ET.SubElement(body, "inertial", place, mass=_text([inertia.mass]), diaginertia=_text(moments))


def _geom(body: ET.Element, solid: Solid) -> None:
    """Add a solid to a body."""
    what = {"mesh": solid.name} if solid.vertices is not None else {"size": _text(solid.size)}
    ET.SubElement(body, "geom", _at(solid.pose_in_link) | what, name=solid.name, type=solid.kind)


def _at(pose: Pose) -> dict[str, str]:
    """Return the attributes of something at a pose in what carries it."""
    x, y, z, w = pose.quaternion_xyzw
    return {"pos": _text(pose.position), "quat": _text([w, x, y, z])}


def _place(origin: Origin) -> dict[str, str]:
    """Return the attributes of something at ``origin`` in what carries it."""
    return {"pos": _text(origin.xyz), "euler": _text(origin.rpy)}


def _text(values: Iterable[float] | Array) -> str:
    """Return the values with as many digits as it takes to read them back exactly."""
    return " ".join(repr(float(value)) for value in values)
