"""Fields of a file of conditions: what is not ideal about a run. Whatever is not given is ideal."""

from sms_handover.configuration.field_specification import (
    FLOATS,
    EitherSpec,
    MappingSpec,
    NamedSpec,
    ValueSpec,
    text,
    vector,
)
from sms_handover.configuration.sensor_fields import SENSOR_FIELDS

WRENCH_KINDS = ("constant", "thruster_misfire", "history", "gravity_gradient", "relative_orbit")
BODY, WORLD = "body", "world"
AXES = (BODY, WORLD)
ON_BASE, ON_DEPUTY = "base", "deputy"
BODIES = (ON_BASE, ON_DEPUTY)
SENSORS = "sensors"


def _per_joint(
    description: str, unit: str = "", *, minimum: float | None = None, above: float | None = None
) -> EitherSpec:
    """Return the specification of one number for every joint, or of a list with one for each."""
    said = f"{description}; one number, or one for each joint"
    number = ValueSpec(said, unit, minimum=minimum, above=above)
    return EitherSpec(number, ValueSpec(said, unit, minimum=minimum, above=above, kind=FLOATS))


_FRICTION = MappingSpec(
    "friction of the joints",
    optional={
        "viscous": _per_joint("friction by speed", "N m s/rad", minimum=0.0),
        "coulomb": _per_joint("dry friction of a joint that moves", "N m", minimum=0.0),
        "stiction": _per_joint(
            "dry friction that a joint at rest bears at most; by default the Coulomb friction",
            "N m",
            minimum=0.0,
        ),
        "stribeck_speed": _per_joint(
            "speed at which stiction has fallen to Coulomb friction but for a share of 1/e",
            "rad/s",
            above=0.0,
        ),
    },
)
_TORQUE = MappingSpec(
    "errors of the torque of the motors",
    optional={
        "gain": _per_joint("relative error of the torque; -1 would be a dead motor", "1", above=-1.0),
        "offset": _per_joint("torque that is there without a command", "N m"),
        "step": _per_joint("step to which a command is rounded; 0: none", "N m", minimum=0.0),
        "noise_density": _per_joint(
            "noise: square root of its two-sided power spectral density", "N m/sqrt(Hz)", minimum=0.0
        ),
    },
)
_COMMAND = MappingSpec(
    "the way of a command to the motors",
    optional={
        "delay": ValueSpec("time that it takes, in whole ticks", "s", minimum=0.0, maximum=10.0),
        "dropped": ValueSpec(
            "probability that it gets lost; the one before is then held", "1", minimum=0.0, maximum=1.0
        ),
    },
)
_FORCE = vector(3, "force", "N")
_TORQUE_OF_WRENCH = vector(3, "torque", "N m")
_POINT = vector(3, "where the force acts in the axes of the body", "m")
_AXES_OF = text("axes of force and torque", AXES)
_ORBIT = {
    "radius": ValueSpec("radius of the orbit", "m", above=0.0),
    "radial": vector(3, "direction from the Earth at 0 s in world"),
    "normal": vector(3, "direction of the orbital angular momentum in world"),
}
_WRENCH = MappingSpec(
    "a wrench on the base or the deputy",
    optional={
        "acts_on": text("body that it acts on, by default the base; the deputy must have mass", BODIES),
        "constant": MappingSpec(
            "a constant force and torque",
            {"force": _FORCE, "torque": _TORQUE_OF_WRENCH},
            {"point": _POINT, "axes": _AXES_OF},
        ),
        "thruster_misfire": MappingSpec(
            "a thruster that fires by mistake, fixed to the body",
            {
                "force": _FORCE,
                "point": _POINT,
                "start": ValueSpec("when it begins", "s", minimum=0.0),
                "duration": ValueSpec("how long it fires", "s", minimum=0.0),
            },
        ),
        "history": MappingSpec(
            "force and torque about the origin of the body over time",
            optional={
                "file": text(
                    "CSV file without a head, its path relative to this one: time s, force N, torque N m, "
                    "seven numbers a row"
                ),
                "rows": ValueSpec("the same rows", kind=object),
                "axes": _AXES_OF,
            },
            one_of=("file", "rows"),
        ),
        "gravity_gradient": MappingSpec("the torque of gravity on what is not round", _ORBIT),
        "relative_orbit": MappingSpec(
            "gravity as it differs from that at a point of the orbit (Hill)",
            _ORBIT,
            {"reference": vector(3, "that point in world", "m")},
        ),
    },
    one_of=WRENCH_KINDS,
)


def _spread(description: str, unit: str) -> ValueSpec:
    return ValueSpec(f"standard deviation of {description}", unit, minimum=0.0)


_BODY_ERROR = {
    "mass": _spread("the logarithm of the mass", "1"),
    "com": _spread("each coordinate of the centre of mass", "m"),
    "inertia": _spread("the logarithm of the spread of mass along each axis", "1"),
}
_MODEL_ERROR = MappingSpec(
    "how far the robot is from what is known of it, as draws from the seed",
    optional={
        "base": MappingSpec("the spacecraft", optional=_BODY_ERROR),
        "links": MappingSpec("each link", optional=_BODY_ERROR),
        "mounts": MappingSpec(
            "where each arm is bolted on",
            optional={
                "position": _spread("each coordinate", "m"),
                "angle": _spread("each angle", "rad"),
            },
        ),
    },
)
CONDITIONS_FIELDS = MappingSpec(
    "what is not ideal about a run",
    optional={
        "description": text("what these conditions are, in one line"),
        "rotor_inertia": _per_joint(
            "inertia of each rotor at its joint, in place of that of the robot, and known: "
            "times gear ratio squared",
            "kg m^2",
            above=0.0,
        ),
        "friction": _FRICTION,
        "torque": _TORQUE,
        "command": _COMMAND,
        "wrenches": NamedSpec("wrenches from outside by name", _WRENCH),
        "model_error": _MODEL_ERROR,
        SENSORS: SENSOR_FIELDS,
    },
)
