"""Sensor messages as CDR bytes: what a gyro, a star tracker and a camera give."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from sms_handover.conditions.sensors.sensor import Reading
from sms_handover.frames import BASE, WORLD
from sms_handover.graph.topics import GYRO, SENSOR_TYPES, STAR_TRACKER, VISION
from sms_handover.messages.message_types import MessageTypes
from sms_handover.ros.codecs.loop_messages import StampedCodec, geometry, pose_message
from sms_handover.types import BASE_NQ, Array

_MATRIX = 9  # numbers of a covariance about three axes
_COVARIANCE = 36  # of one of a pose
_UNKNOWN = -1.0  # first number of the covariance of what is not measured, by the definition of Imu


class ReadingCodec(Protocol):
    """Packs what a sensor gives."""

    def pack_reading(self, stamp_ns: int, reading: Reading) -> bytes:
        """Return the bytes of a message with the stamp of the measurement."""


class ImuCodec(StampedCodec):
    """Packs Imu messages of a gyro alone: orientation and acceleration are said not to be measured."""

    def __init__(self, topic: str, frame: str) -> None:
        super().__init__(SENSOR_TYPES[topic], frame, 10 + 3 * _MATRIX, _imu_fields)

    def pack_reading(self, stamp_ns: int, reading: Reading) -> bytes:
        """Return the bytes of a message with the stamp of the measurement."""
        unmeasured = np.zeros(_MATRIX)
        unmeasured[0] = _UNKNOWN
        orientation, acceleration = np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3)
        covariance = np.diag(reading.variance).ravel()
        parts = (orientation, unmeasured, reading.values, covariance, acceleration, unmeasured)
        return self.pack(stamp_ns, np.concatenate(parts))


class PoseWithCovarianceCodec(StampedCodec):
    """Packs PoseWithCovarianceStamped messages in one frame."""

    def __init__(self, topic: str, frame: str) -> None:
        super().__init__(SENSOR_TYPES[topic], frame, BASE_NQ + _COVARIANCE, _pose_fields)

    def pack_reading(self, stamp_ns: int, reading: Reading) -> bytes:
        """Return the bytes of a message with the stamp of the measurement."""
        covariance = np.diag(reading.variance).ravel()
        return self.pack(stamp_ns, np.concatenate([reading.values, covariance]))


def sensor_codecs() -> Mapping[str, ReadingCodec]:
    """Return what packs the messages of each topic of a sensor."""
    return MappingProxyType(
        {
            GYRO: ImuCodec(GYRO, BASE),
            STAR_TRACKER: PoseWithCovarianceCodec(STAR_TRACKER, WORLD),
            VISION: PoseWithCovarianceCodec(VISION, BASE),
        }
    )


def _imu_fields(types: MessageTypes, numbers: Array) -> dict[str, Any]:
    """Return the fields of an Imu of zeros beside its header."""
    matrix = np.zeros(_MATRIX)
    return {
        "orientation": geometry(types, "Quaternion", np.zeros(4)),
        "orientation_covariance": matrix,
        "angular_velocity": geometry(types, "Vector3", np.zeros(3)),
        "angular_velocity_covariance": matrix,
        "linear_acceleration": geometry(types, "Vector3", np.zeros(3)),
        "linear_acceleration_covariance": matrix,
    }


def _pose_fields(types: MessageTypes, numbers: Array) -> dict[str, Any]:
    """Return the fields of a PoseWithCovarianceStamped of zeros beside its header."""
    pose, name = pose_message(types, np.zeros(BASE_NQ)), "geometry_msgs/msg/PoseWithCovariance"
    return {"pose": types.make(name, pose=pose, covariance=np.zeros(_COVARIANCE))}
