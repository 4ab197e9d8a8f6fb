"""Measured outputs of the plant: what its sensors tell, beside the truth."""

from collections.abc import Callable, Collection
from typing import Any

from sms_handover.conditions.sensors.encoders import ENCODERS
from sms_handover.frames import BASE, WORLD
from sms_handover.graph.topics import (
    MEASURED_BASE_ODOMETRY,
    MEASURED_DEPUTY_POSE,
    MEASURED_JOINT_STATES,
    MEASURED_SAMPLED_BASE_ODOMETRY,
    MEASURED_SAMPLED_JOINT_STATES,
    sensor_topic,
)
from sms_handover.model.poses import pose_row
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.sensed_plant import SensedPlant, known_of
from sms_handover.ros.codecs.loop_messages import PoseCodec, StateCodec
from sms_handover.ros.codecs.sensor_messages import sensor_codecs
from sms_handover.ros.node.endpoints import CountedPublisher

_STATE = (
    *(MEASURED_JOINT_STATES, MEASURED_BASE_ODOMETRY),
    *(MEASURED_SAMPLED_JOINT_STATES, MEASURED_SAMPLED_BASE_ODOMETRY, MEASURED_DEPUTY_POSE),
)


class MeasuredOutputs:
    """The publishers of what is known of robot and deputy, and of what each sensor gives."""

    def __init__(
        self, robot: RobotModel, publisher: Callable[[str], CountedPublisher], sensors: Collection[str]
    ) -> None:
        """Make the publishers for sensors of these names; encoders have no topic besides the joint states."""
        own = [sensor_topic(name) for name in sensors if name != ENCODERS]
        self._publish: dict[str, Callable[[Any], None]] = {
            name: publisher(name).publish for name in (*_STATE, *own)
        }
        self._state_codec, self._pose_codec = StateCodec(robot.joint_names, WORLD, BASE), PoseCodec(WORLD)
        self._codecs = sensor_codecs()

    def publish_loop(self, plant: SensedPlant, *, with_reference: bool) -> None:
        """Publish what is known, which other nodes may wait for."""
        publish, now_ns, measured = self._publish, plant.stamp_ns, plant.measured
        effort = plant.joint_effort
        joints, odometry = self._state_codec.pack_arrays(now_ns, measured.q, measured.v, effort)
        if with_reference:
            publish[MEASURED_SAMPLED_JOINT_STATES](joints)
            publish[MEASURED_SAMPLED_BASE_ODOMETRY](odometry)
            deputy = known_of(plant).deputy_in_world
            publish[MEASURED_DEPUTY_POSE](self._pose_codec.pack(now_ns, pose_row(deputy)))
        publish[MEASURED_JOINT_STATES](joints)
        publish[MEASURED_BASE_ODOMETRY](odometry)

    def publish_readings(self, plant: SensedPlant) -> None:
        """Publish what sensors have given in this tick, with the stamps of their measurements."""
        for reading in plant.measured.readings:
            topic, stamp_ns = sensor_topic(reading.sensor), reading.tick * plant.tick_ns
            self._publish[topic](self._codecs[topic].pack_reading(stamp_ns, reading))
