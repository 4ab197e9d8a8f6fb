"""Hinges of panels in URDF text, as a recording carries it."""

import numpy as np

from sms_handover.model.springs import Springs
from sms_handover.model.urdf_tree import read_urdf
from sms_handover.model.urdf_values import STIFFNESS

NO_SPRINGS = Springs(np.zeros(0), np.zeros(0))


def hinges_in(urdf: str | None) -> tuple[tuple[str, ...], Springs]:
    """Return the names of the joints with a spring, and their springs; raises RobotDescriptionError."""
    if urdf is None or STIFFNESS not in urdf:
        return (), NO_SPRINGS
    joints = [joint for joint in read_urdf(urdf).joints if joint.is_passive]
    springs = Springs(np.array([j.stiffness for j in joints]), np.array([j.damping for j in joints]))
    return tuple(joint.name for joint in joints), springs
