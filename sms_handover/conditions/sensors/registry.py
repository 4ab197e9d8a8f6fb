"""Registry of the sensors, in the order in which they measure, and the readers of their values."""

from collections.abc import Callable, Mapping
from math import inf
from types import MappingProxyType

import numpy as np

from sms_handover.conditions.per_joint import per_joint
from sms_handover.conditions.sensors.encoders import ENCODERS, EncoderValues
from sms_handover.conditions.sensors.gyro import GYRO, GyroValues
from sms_handover.conditions.sensors.sensor import SensorValues
from sms_handover.conditions.sensors.star_tracker import STAR_TRACKER, StarTrackerValues
from sms_handover.conditions.sensors.vision import VISION, VisionValues
from sms_handover.configuration.sections import Section
from sms_handover.types import Array


def sensors_of(section: Section, joints: int) -> dict[str, SensorValues]:
    """Return the values of the sensors that a section has, for a robot with so many joints."""
    return {name: read(section.section(name), joints) for name, read in SENSORS.items() if name in section}


def _encoders(section: Section, joints: int) -> SensorValues:
    bandwidth = section.number("bandwidth", inf)
    return EncoderValues(per_joint(section, "step", joints), per_joint(section, "offset", joints), bandwidth)


def _gyro(section: Section, joints: int) -> SensorValues:
    density, period = section.number("noise_density", 0.0), section.number("period", 0.0)
    return GyroValues(density, _vector(section, "bias"), period)


def _star_tracker(section: Section, joints: int) -> SensorValues:
    noise, bias = section.number("noise", 0.0), _vector(section, "bias")
    return StarTrackerValues(noise, bias, section.number("period", 0.0), section.number("latency", 0.0))


def _vision(section: Section, joints: int) -> SensorValues:
    return VisionValues(
        position_noise=section.number("position_noise", 0.0),
        angle_noise=section.number("angle_noise", 0.0),
        position_bias=_vector(section, "position_bias"),
        angle_bias=_vector(section, "angle_bias"),
        period=section.number("period", 0.0),
        latency=section.number("latency", 0.0),
        dropped=section.number("dropped", 0.0),
        camera=_vector(section, "camera"),
    )


def _vector(section: Section, key: str) -> Array:
    """Return a vector (3,), zero where it is not given."""
    return np.array(section.vector(key, missing=(0.0, 0.0, 0.0)))


SENSORS: Mapping[str, Callable[[Section, int], SensorValues]] = MappingProxyType(
    {ENCODERS: _encoders, GYRO: _gyro, STAR_TRACKER: _star_tracker, VISION: _vision}
)
