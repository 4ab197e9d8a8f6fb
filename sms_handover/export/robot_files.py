"""Robot files for other programs: URDF, SRDF for MoveIt and MJCF for MuJoCo, from one description."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import coal
import pinocchio as pin

from sms_handover.clearance.allowed_pairs import counted_pairs, joined
from sms_handover.clearance.bodies import bodies_of
from sms_handover.clearance.solids import read_solids
from sms_handover.errors import RobotDescriptionError
from sms_handover.model.floating_model import floating_model
from sms_handover.model.mjcf import Solid, to_mjcf
from sms_handover.model.poses import pose_of
from sms_handover.model.shape_elements import read_contacts
from sms_handover.model.shapes import ContactPairs
from sms_handover.model.srdf import DisabledPair, DisabledReason, to_srdf

URDF_FILE, SRDF_FILE, MJCF_FILE = "robot.urdf", "robot.srdf", "robot.xml"


@dataclass(frozen=True)
class RobotFiles:
    """The texts of a robot by the name of their file, and how many pairs of links need not be checked."""

    texts: Mapping[str, str]
    disabled: int


def robot_files(urdf: str, rotor_inertia: Mapping[str, float] | None = None) -> RobotFiles:
    """Return the files of a robot that URDF text describes.

    ``rotor_inertia`` kg m^2 by joint goes to MJCF. Links do not collide in MJCF, and need not be checked by
    the SRDF, where their clearance does not count. Raises RobotDescriptionError if the text is no robot.
    """
    model = floating_model(urdf)
    solids = read_solids(model, urdf)
    disabled = _disabled(model, solids, read_contacts(urdf))
    mjcf = to_mjcf(
        urdf,
        rotor_inertia,
        solids=[
            _solid(model, item, body.name)
            for item, body in zip(solids.geometryObjects, bodies_of(model, solids, ()), strict=True)
        ],
        may_touch=[(pair.first, pair.second) for pair in disabled],
    )
    texts = {URDF_FILE: urdf, SRDF_FILE: to_srdf(urdf, disabled), MJCF_FILE: mjcf}
    return RobotFiles(texts, len(disabled))


def _disabled(model: pin.Model, solids: pin.GeometryModel, stated: ContactPairs) -> list[DisabledPair]:
    """Return the pairs of links of which solids do not count with each other, in the order of the solids.

    SRDF knows links only: where one pair of solids always touches, its links would never be apart.
    """
    links = [model.frames[item.parentFrame].name for item in solids.geometryObjects]
    counted = set(counted_pairs(model, solids, stated))
    found: dict[frozenset[str], DisabledPair] = {}
    for a, b in combinations(range(len(links)), 2):
        if links[a] != links[b] and (a, b) not in counted:
            pair = DisabledPair(links[a], links[b], _reason(model, solids, a, b, stated))
            found.setdefault(frozenset((links[a], links[b])), pair)
    return list(found.values())


def _reason(
    model: pin.Model, solids: pin.GeometryModel, a: int, b: int, stated: ContactPairs
) -> DisabledReason:
    """Return why two solids do not count: stated, neighbours, fixed to each other, or always touching."""
    one, other = solids.geometryObjects[a], solids.geometryObjects[b]
    if stated.allows(model.frames[one.parentFrame].name, model.frames[other.parentFrame].name):
        return DisabledReason.USER
    if not joined(model, solids, a, b):
        return DisabledReason.ALWAYS
    frames = {one.parentFrame, other.parentFrame}
    carriers = {_carrier(model, one.parentFrame), _carrier(model, other.parentFrame)}
    apart = one.parentJoint == other.parentJoint and not frames & carriers
    return DisabledReason.NEVER if apart else DisabledReason.ADJACENT


def _carrier(model: pin.Model, link: int) -> int:
    """Return the link that carries a link, through its joint."""
    above = model.frames[link].parentFrame
    while above != 0 and model.frames[above].type != pin.FrameType.BODY:
        above = model.frames[above].parentFrame
    return int(above)


def _solid(model: pin.Model, item: pin.GeometryObject, name: str) -> Solid:
    """Return a geometry object, which Pinocchio places relative to the parent joint, in its link's frame."""
    frame = model.frames[item.parentFrame]
    pose, shape = pose_of(frame.placement.actInv(item.placement)), item.geometry
    if isinstance(shape, coal.Box):
        return Solid(name, frame.name, "box", tuple(map(float, shape.halfSide)), pose)
    if isinstance(shape, coal.Sphere):
        return Solid(name, frame.name, "sphere", (float(shape.radius),), pose)
    for kind, of_kind in (("cylinder", coal.Cylinder), ("capsule", coal.Capsule)):
        if isinstance(shape, of_kind):
            return Solid(name, frame.name, kind, (float(shape.radius), float(shape.halfLength)), pose)
    if isinstance(shape, coal.ConvexBase):
        return Solid(name, frame.name, "mesh", (), pose, shape.points())
    allowed = "a box, sphere, cylinder, capsule or convex hull"
    raise RobotDescriptionError(
        f"link {frame.name!r} has a {type(shape).__name__} as a solid, must be {allowed}"
    )
