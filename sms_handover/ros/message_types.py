"""Message types: their classes by name."""

from importlib import import_module
from typing import Any

from sms_handover.errors import GraphError


def message_class(type_name: str) -> Any:
    """Return the class of a type such as ``sensor_msgs/msg/JointState``; raises GraphError if it lacks."""
    try:
        package, kind, name = type_name.split("/")
        return getattr(import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise GraphError(f"message type {type_name} is not installed: {error}") from error
