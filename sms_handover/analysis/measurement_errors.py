"""Measurement errors over time: what the sensors of a run have told, less what was true."""

import numpy as np

from sms_handover.analysis.joints import joints_of
from sms_handover.analysis.numbers import rotation_vectors
from sms_handover.analysis.signals import AXES, Signal
from sms_handover.run_data import MeasuredRows, RunData
from sms_handover.units import NS_PER_S

_TURN = slice(3, 7)  # of a pose


def measurement_errors(run: RunData) -> dict[str, Signal]:
    """Return every error of a measurement by a key such as ``gyro_error`` or ``arm_a/encoder_error``.

    Joints in rad and rad/s, the base in rad/s and as a rotation vector in rad in ``world`` axes, the deputy
    in m and likewise. A run without sensors has none; what no sensor measures has zeros.
    """
    measured = run.measured
    if measured is None:
        return {}
    found = {}
    for arm in run.arms:
        found.update({f"{arm}/{signal.name}": signal for signal in _of_joints(run, measured, arm)})
    base, deputy = run.tick_ns / NS_PER_S, run.reference_ns / NS_PER_S
    turned = rotation_vectors(run.base_pose[:, _TURN], measured.base_pose[:, _TURN])
    askew = rotation_vectors(run.deputy_pose[:, _TURN], measured.deputy_pose[:, _TURN])
    shift = measured.deputy_pose[:, :3] - run.deputy_pose[:, :3]
    rate = measured.base_twist[:, 3:] - run.base_twist[:, 3:]
    of_robot = (
        Signal("gyro_error", "rad/s", base, rate, AXES),
        Signal("star_tracker_error", "rad", base, turned, AXES),
        Signal("vision_position_error", "m", deputy, shift, AXES),
        Signal("vision_angle_error", "rad", deputy, askew, AXES),
    )
    return {**found, **{signal.name: signal for signal in of_robot}}


def _of_joints(run: RunData, measured: MeasuredRows, arm: str) -> tuple[Signal, Signal]:
    """Return the errors of the angles and of the rates of an arm's joints, each tick."""
    joints = joints_of(run.joint_names, arm)
    labels, time = tuple(run.joint_names[place] for place in joints), run.tick_ns / NS_PER_S
    angle, rate = measured.joint_position - run.joint_position, measured.joint_velocity - run.joint_velocity
    return (
        Signal("encoder_error", "rad", time, np.array(angle[:, joints]), labels),
        Signal("rate_error", "rad/s", time, np.array(rate[:, joints]), labels),
    )
