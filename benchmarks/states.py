"""States of the robot in two engines: how far apart they are, and with which order that falls."""

import numpy as np

from sms_handover.engines.mujoco_robot import State, rotation_matrix
from sms_handover.types import Array


def apart(a: State, b: State) -> tuple[float, float, float]:
    """Return the largest joint difference rad, the base distance m and the base angle rad of two states."""
    turned = rotation_matrix(a[0][3:7]).T @ rotation_matrix(b[0][3:7])
    sine = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
    angle = np.arctan2(0.5 * np.linalg.norm(sine), 0.5 * (np.trace(turned) - 1.0))
    joints = np.max(np.abs(a[0][7:] - b[0][7:]))
    return float(joints), float(np.linalg.norm(a[0][:3] - b[0][:3])), float(angle)


def order(errors: Array) -> Array:
    """Return the order per column: the mean log2 of the ratio of errors (rows) as the step is halved."""
    ratios: Array = np.log2(errors[:-1] / errors[1:])
    return np.asarray(ratios.mean(axis=0))
