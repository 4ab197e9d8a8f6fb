"""Plant outputs: each tick what the loop waits for, each period what goes with it."""

from collections.abc import Callable
from typing import Any

import numpy as np

from sms_handover.conditions.conditions import Conditions
from sms_handover.frames import BASE, DEPUTY, WORLD
from sms_handover.graph.topics import (
    ANGULAR_IMPULSE,
    ANGULAR_MOMENTUM,
    APPLIED_BASE_WRENCH,
    BASE_ODOMETRY,
    CLOCK,
    CLOCK_PERIOD_NS,
    DEPUTY_ODOMETRY,
    DEPUTY_POSE,
    ENERGY,
    JOINT_STATES,
    LINEAR_IMPULSE,
    LINEAR_MOMENTUM,
    SAMPLED_BASE_ODOMETRY,
    SAMPLED_JOINT_STATES,
    tool_pose,
)
from sms_handover.messages.layout import head
from sms_handover.model.poses import pose_row, twist_in_deputy
from sms_handover.model.robot_model import RobotModel
from sms_handover.nodes.parts.measured_outputs import MeasuredOutputs
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.plant.sensed_plant import SensedPlant
from sms_handover.ros.codecs.base_wrench import wrench_message
from sms_handover.ros.codecs.loop_messages import (
    OdometryCodec,
    PoseCodec,
    StateCodec,
    energy_codec,
    vector_codec,
)
from sms_handover.ros.node.endpoints import CountedPublisher
from sms_handover.simulation.parameters import LOCKSTEP, CommonParameters

_LOOP = (JOINT_STATES, BASE_ODOMETRY, SAMPLED_JOINT_STATES, SAMPLED_BASE_ODOMETRY, DEPUTY_POSE)
_PERIOD = (DEPUTY_ODOMETRY, LINEAR_MOMENTUM, ANGULAR_MOMENTUM, ENERGY)
_OUTSIDE = (LINEAR_IMPULSE, ANGULAR_IMPULSE, APPLIED_BASE_WRENCH)


class PlantOutputs:
    """The publishers of the plant's state, and the layout of their messages."""

    def __init__(
        self,
        robot: RobotModel,
        publisher: Callable[[str], CountedPublisher],
        common: CommonParameters,
        conditions: Conditions,
    ) -> None:
        """Make the publishers; ``publisher`` returns the one of a topic."""
        self._lockstep, self._by_measurement = common.mode == LOCKSTEP, common.uses_measurements
        names = (
            *_LOOP,
            *_PERIOD,
            *_OUTSIDE,
            CLOCK,
            *(tool_pose(arm) for arm in robot.arms),
        )
        sensors = conditions.sensors
        self._measured = MeasuredOutputs(robot, publisher, sensors) if sensors else None
        self._publish: dict[str, Callable[[Any], None]] = {name: publisher(name).publish for name in names}
        hinges = tuple(panel.joint for panel in robot.description.flexible_panels)
        self._state_codec = StateCodec((*robot.joint_names, *hinges), WORLD, BASE)
        self._pose_codec, self._vector_codec = PoseCodec(WORLD), vector_codec(WORLD)
        self._energy_codec = energy_codec(WORLD)
        self._deputy_codec = OdometryCodec(WORLD, DEPUTY)

    def publish_loop(self, plant: FreeFloatingPlant, *, with_reference: bool) -> None:
        """Publish what the other nodes of the loop wait for.

        At a reference period in lock step what the trajectory waits for goes first, because more has to be
        done with it. In real time the controller is the one who must not wait.
        """
        if self._by_measurement:
            self._publish_measured(plant, with_reference=with_reference)
        self._publish_truth(plant, with_reference=with_reference)
        if not self._by_measurement:
            self._publish_measured(plant, with_reference=with_reference)

    def _publish_measured(self, plant: FreeFloatingPlant, *, with_reference: bool) -> None:
        """Publish what sensors tell, if there are any."""
        if self._measured and isinstance(plant, SensedPlant):
            self._measured.publish_loop(plant, with_reference=with_reference)

    def _publish_truth(self, plant: FreeFloatingPlant, *, with_reference: bool) -> None:
        """Publish the state as it is."""
        publish = self._publish
        q, v, effort = plant.q, plant.v, plant.joint_effort
        if panels := plant.panels:
            beside = (panels.angle, panels.rate, panels.torque)
            q, v, effort = map(np.concatenate, zip((q, v, effort), beside, strict=True))
        joints, odometry = self._state_codec.pack_arrays(plant.stamp_ns, q, v, effort)
        if with_reference and self._lockstep:
            self._publish_sample(plant, joints, odometry)
        publish[JOINT_STATES](joints)
        publish[BASE_ODOMETRY](odometry)
        if with_reference and not self._lockstep:
            self._publish_sample(plant, joints, odometry)

    def _publish_sample(self, plant: FreeFloatingPlant, joints: bytes, odometry: bytes) -> None:
        """Publish what the trajectory waits for: the state of a reference period, and the deputy."""
        publish = self._publish
        publish[SAMPLED_JOINT_STATES](joints)
        publish[SAMPLED_BASE_ODOMETRY](odometry)
        publish[DEPUTY_POSE](self._pose_codec.pack(plant.stamp_ns, pose_row(plant.deputy.deputy_in_world)))

    def publish_rest(self, plant: FreeFloatingPlant, *, with_reference: bool) -> None:
        """Publish what nobody in the loop waits for: tools, momenta, energy, the clock."""
        now_ns, publish = plant.stamp_ns, self._publish
        if plant.pushed:
            publish[APPLIED_BASE_WRENCH](wrench_message(plant.pushed))
        if self._measured and isinstance(plant, SensedPlant):
            self._measured.publish_readings(plant)
        if with_reference:
            conserved = plant.conserved
            for arm, pose in plant.tools_in_world.items():
                publish[tool_pose(arm)](self._pose_codec.pack(now_ns, pose_row(pose)))
            energy = np.array([conserved.kinetic_energy, plant.work, plant.external_work, plant.losses])
            deputy = plant.deputy
            twist = twist_in_deputy(pose_row(deputy.deputy_in_world), deputy.twist_deputy_in_world.row)
            publish[DEPUTY_ODOMETRY](self._deputy_codec.pack(now_ns, pose_row(deputy.deputy_in_world), twist))
            publish[LINEAR_MOMENTUM](self._vector_codec.pack(now_ns, conserved.linear_momentum))
            publish[ANGULAR_MOMENTUM](self._vector_codec.pack(now_ns, conserved.angular_momentum))
            publish[ENERGY](self._energy_codec.pack(now_ns, energy))
            given = plant.external_impulse
            if given:
                publish[LINEAR_IMPULSE](self._vector_codec.pack(now_ns, given.linear_impulse))
                publish[ANGULAR_IMPULSE](self._vector_codec.pack(now_ns, given.angular_impulse))
        if now_ns % CLOCK_PERIOD_NS == 0:
            publish[CLOCK](head(now_ns))
