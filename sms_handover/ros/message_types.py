"""Message types: their classes by name."""

from importlib import import_module
from typing import Any

from sms_handover.errors import GraphError

_KINDS = ("msg", "srv", "action")  # sub-packages of an interface package; nothing else is imported


def message_class(type_name: str) -> Any:
    """Return the class of a type such as ``sensor_msgs/msg/JointState``; raises GraphError if it lacks.

    ``sensor_msgs/JointState``, as in bags converted from ROS 1, is the same type.
    """
    try:
        package, _, rest = type_name.partition("/")
        kind, _, name = rest.rpartition("/")
        if not package.isidentifier() or (kind or "msg") not in _KINDS:
            raise ValueError("it is not of the form PACKAGE/msg/NAME")
        found = getattr(import_module(f"{package}.{kind or 'msg'}"), name)
        if not hasattr(found, "get_fields_and_field_types"):
            raise ValueError(f"{name} is no message")
    except (ImportError, AttributeError, ValueError) as error:
        raise GraphError(f"message type {type_name} is not installed: {error}") from error
    return found
