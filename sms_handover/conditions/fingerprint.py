"""Fingerprint of conditions: the same for the same values, so that a snapshot knows its own."""

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from sms_handover.conditions.conditions import Conditions


def fingerprint(conditions: Conditions) -> str:
    """Return SHA-256 of every value of what acts in the plant, as hexadecimal digits; no sensor does."""
    digest = hashlib.sha256()
    _add(digest, replace(conditions, sensors={}))
    return digest.hexdigest()


def _add(digest: Any, value: Any) -> None:
    """Add a value, with the names of what is in it."""
    if is_dataclass(value):
        digest.update(type(value).__name__.encode())
        for item in fields(value):
            _add(digest, getattr(value, item.name))
    elif isinstance(value, Mapping):
        for name, item in value.items():
            digest.update(name.encode())
            _add(digest, item)
    elif isinstance(value, np.ndarray):
        digest.update(value.tobytes())
    else:
        digest.update(repr(value).encode())
