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
    bandwidth = section.number("bandwidth") if "bandwidth" in section else inf
    return EncoderValues(per_joint(section, "step", joints), per_joint(section, "offset", joints), bandwidth)


def _gyro(section: Section, joints: int) -> SensorValues:
    density, period = _number(section, "noise_density"), _number(section, "period")
    return GyroValues(density, _vector(section, "bias"), period)


def _star_tracker(section: Section, joints: int) -> SensorValues:
    noise, bias = _number(section, "noise"), _vector(section, "bias")
    return StarTrackerValues(noise, bias, _number(section, "period"), _number(section, "latency"))


def _vision(section: Section, joints: int) -> SensorValues:
    return VisionValues(
        position_noise=_number(section, "position_noise"),
        angle_noise=_number(section, "angle_noise"),
        position_bias=_vector(section, "position_bias"),
        angle_bias=_vector(section, "angle_bias"),
        period=_number(section, "period"),
        latency=_number(section, "latency"),
        dropped=_number(section, "dropped"),
        camera=_vector(section, "camera"),
    )


def _number(section: Section, key: str) -> float:
    """Return a number, 0 where it is not given."""
    return section.number(key) if key in section else 0.0


def _vector(section: Section, key: str) -> Array:
    """Return a vector (3,), zero where it is not given."""
    return np.array(section.vector(key)) if key in section else np.zeros(3)


SENSORS: Mapping[str, Callable[[Section, int], SensorValues]] = MappingProxyType(
    {ENCODERS: _encoders, GYRO: _gyro, STAR_TRACKER: _star_tracker, VISION: _vision}
)
