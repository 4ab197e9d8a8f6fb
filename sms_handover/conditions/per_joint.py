"""Values per joint: one number for all of them, or a list with one for each."""

import numpy as np

from sms_handover.configuration.sections import Section
from sms_handover.types import Array


def per_joint(section: Section, key: str, joints: int, missing: float = 0.0) -> Array:
    """Return the value of every joint (n,): one number for all, or a list with one for each."""
    if key not in section:
        return np.full(joints, missing)
    if isinstance(section.value(key), list):
        return np.array(section.vector(key, joints))
    return np.full(joints, section.word(key))
