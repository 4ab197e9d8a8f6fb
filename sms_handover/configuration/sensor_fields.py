"""Fields of the sensors in a file of conditions: what is measured, and how well."""

from sms_handover.configuration.field_specification import FLOATS, EitherSpec, MappingSpec, ValueSpec, vector

_LONGEST_S = 10.0  # [s]


def _of_joints(description: str, unit: str, *, minimum: float | None = None) -> EitherSpec:
    """Return the specification of one number for every joint, or of a list with one for each."""
    said = f"{description}; one number, or one for each joint"
    number = ValueSpec(said, unit, minimum=minimum)
    return EitherSpec(number, ValueSpec(said, unit, minimum=minimum, kind=FLOATS))


def _time(description: str) -> ValueSpec:
    return ValueSpec(f"{description}, in whole ticks", "s", minimum=0.0, maximum=_LONGEST_S)


_PERIOD = _time("time between two measurements; 0: every tick")
_LATENCY = _time("time from a measurement until it is given")
_ENCODERS = MappingSpec(
    "encoders of the joints: angles in steps, rates by a filtered difference",
    optional={
        "step": _of_joints("step of the angle; 0: none", "rad", minimum=0.0),
        "offset": _of_joints("what the angle is given more than it is", "rad"),
        "bandwidth": ValueSpec(
            "of the low pass of the rates; without it they are bare differences", "1/s", above=0.0
        ),
    },
)
_GYRO = MappingSpec(
    "gyro of the base: its angular velocity",
    optional={
        "noise_density": ValueSpec(
            "noise: square root of its two-sided power spectral density, the angle random walk",
            "rad/s/sqrt(Hz)",
            minimum=0.0,
        ),
        "bias": vector(3, "bias in axes of base_link", "rad/s"),
        "period": _PERIOD,
    },
)
_STAR_TRACKER = MappingSpec(
    "star tracker of the base: its orientation",
    optional={
        "noise": ValueSpec("standard deviation about each axis", "rad", minimum=0.0),
        "bias": vector(3, "bias as a rotation vector in axes of base_link", "rad"),
        "period": _PERIOD,
        "latency": _LATENCY,
    },
)
_VISION = MappingSpec(
    "camera on the base: the pose of the deputy",
    optional={
        "position_noise": ValueSpec(
            "standard deviation along each axis, per metre of range", "m/m", minimum=0.0
        ),
        "angle_noise": ValueSpec(
            "standard deviation about each axis, per metre of range", "rad/m", minimum=0.0
        ),
        "position_bias": vector(3, "bias in axes of base_link", "m"),
        "angle_bias": vector(3, "bias as a rotation vector in axes of base_link", "rad"),
        "period": _PERIOD,
        "latency": _LATENCY,
        "dropped": ValueSpec("probability that a measurement gives nothing", "1", minimum=0.0, maximum=1.0),
        "camera": vector(3, "where the camera is in base_link, from which the range counts", "m"),
    },
)
SENSOR_FIELDS = MappingSpec(
    "what is measured of robot and deputy, for parameter source: measured",
    optional={
        "encoders": _ENCODERS,
        "gyro": _GYRO,
        "star_tracker": _STAR_TRACKER,
        "vision": _VISION,
    },
)
