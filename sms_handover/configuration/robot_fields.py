"""Fields of the files that describe a robot: robot.yaml, and the file of an arm that it names."""

from sms_handover.configuration.clearance_fields import clearance_fields
from sms_handover.configuration.field_specification import (
    FLOATS,
    EitherSpec,
    ListSpec,
    MappingSpec,
    NamedSpec,
    ValueSpec,
    text,
    vector,
)

UNIFORM_BOX = "uniform_box"

_MASS = ValueSpec("mass", "kg", above=0.0)
COM = vector(3, "centre of mass in the frame of the body", "m")
MOMENTS = vector(6, "ixx, ixy, ixz, iyy, iyz, izz about the centre of mass, axes of the body", "kg m^2")
_EDGES = vector(3, "edges along x, y, z", "m", above=0.0)
_LIMITS = {
    "position": vector(2, "lower and upper limit of the angle", "rad"),
    "velocity": ValueSpec("limit of the speed", "rad/s", above=0.0),
    "effort": ValueSpec("limit of the torque", "N m", above=0.0),
}


def pose(description: str) -> MappingSpec:
    """Return the specification of a pose in URDF's terms."""
    turned = vector(3, f"{description}: angles about the fixed x, then y, then z axis", "rad")
    return MappingSpec(description, {"xyz": vector(3, f"{description}: position", "m"), "rpy": turned})


BOX_OR_MOMENTS = EitherSpec(
    text("moments of inertia; uniform_box: those of a box of this mass and size", (UNIFORM_BOX,)),
    MOMENTS,
)
_FLEXIBLE = MappingSpec(
    "a hinge with a spring and a damper that carries the panel, which then has mass",
    {
        "mass": _MASS,
        "hinge": vector(3, "a point of the axis in base_link", "m"),
        "axis": vector(3, "unit vector in base_link"),
        "stiffness": ValueSpec("torque of the spring by angle", "N m/rad", above=0.0),
    },
    {"damping": ValueSpec("torque of the damper by rate", "N m s/rad", minimum=0.0)},
)
_PANEL = MappingSpec(
    "a box that is drawn on the spacecraft, without mass unless it is flexible",
    {"xyz": vector(3, "centre in base_link", "m"), "size": _EDGES},
    {"flexible": _FLEXIBLE},
)
_BASE = MappingSpec(
    "the spacecraft",
    {
        "mass": _MASS,
        "size": _EDGES,
        "com": COM,
        "inertia": BOX_OR_MOMENTS,
    },
    {"panels": ListSpec("solar panels", _PANEL)},
)
_LINK = MappingSpec(
    "the body that the joint moves",
    {
        "mass": _MASS,
        "com": COM,
        "inertia": MOMENTS,
        "radius": ValueSpec("radius of the cylinder drawn for it", "m", above=0.0),
    },
)
_JOINT = MappingSpec(
    "a revolute joint and its link",
    {
        "origin": pose("frame of the joint in the link before it"),
        "axis": vector(3, "unit vector in the frame of the joint"),
        "limits": MappingSpec("limits of the joint", _LIMITS),
        "link": _LINK,
    },
)
ARM_FIELDS = MappingSpec(
    "an arm from its mount to its flange",
    {
        "joints": ListSpec("joints from the mount outwards", _JOINT, shortest=1),
        "flange": pose("frame of the flange in the last link"),
    },
)
_GRIPPER = MappingSpec(
    "a rigid uniform cylinder on the flange, the tool frame at its far end",
    {
        "mass": _MASS,
        "radius": ValueSpec("radius of the cylinder", "m", above=0.0),
        "length": ValueSpec("length from the flange to the tool frame", "m", above=0.0),
    },
)
_ARM = MappingSpec(
    "an arm of the robot",
    {
        "name": text("name of the arm: lower-case letters, digits and _"),
        "description": EitherSpec(text("file of the arm, its path relative to this one"), ARM_FIELDS),
        "mount": pose("root frame of the arm in base_link"),
        "gripper": _GRIPPER,
        "rotor_inertia": ValueSpec(
            "inertia of each rotor at its joint: times gear ratio squared", "kg m^2", kind=FLOATS
        ),
    },
    {
        "limits": NamedSpec(
            "limits in place of those of the file of the arm, by joint_<number>",
            MappingSpec("limits of one joint", optional=_LIMITS),
        )
    },
)
ROBOT_FIELDS = MappingSpec(
    "a free-floating spacecraft with arms",
    {"name": text("name of the robot"), "base": _BASE, "arms": ListSpec("the arms, one or more", _ARM)},
    {"clearance": clearance_fields(pose("frame of the shape in its link"))},
)
