"""Values of YAML documents by dotted path, such as ``robot.base.mass:=300``, set before any check."""

import json
import re
from collections.abc import Mapping as AnyMapping
from collections.abc import Sequence
from copy import copy
from reprlib import repr as shortened
from typing import Any

from sms_handover.configuration.yaml_reader import Mapping, load_value
from sms_handover.errors import ConfigurationError, UnknownNameError

ROBOT, DEPUTY, SCHEDULE = "robot", "deputy", "schedule"
DOCUMENTS = (ROBOT, DEPUTY, SCHEDULE)  # the deputy is a section of the schedule
_STEP = re.compile(r"[^.\[\]]+")


def written(document: str, values: AnyMapping[str, object]) -> list[str]:
    """Return values of a document by path as texts that :func:`with_values` takes."""
    return [f"{document}.{path}:={json.dumps(value, default=str)}" for path, value in values.items()]


def with_values(content: Mapping, document: str, values: Sequence[str]) -> Mapping:
    """Return the content of a document with those of the values set that are its own.

    An item of a list is named by its ``name`` or its index; ``null`` removes a key. Raises
    ConfigurationError; keys and values that a document may not have are left to its own checks.
    """
    for text in values:
        path, assigned, value = text.partition(":=")
        first, *steps = _STEP.findall(path)
        if not assigned or not steps or first not in DOCUMENTS:
            known = ", ".join(DOCUMENTS)
            raise ConfigurationError(
                f"value {text!r} must be of the form PATH:=VALUE, PATH beginning with {known}"
            )
        if first == DEPUTY:
            first, steps = SCHEDULE, [DEPUTY, *steps]
        if first == document:
            content = _set(content, steps, load_value(value, text), text)
    return content


def _set(node: Any, steps: Sequence[str], value: object, text: str) -> Any:
    """Return a copy of a node with a value set; what aliases share with it stays as it is."""
    if not steps:
        return value
    step, *rest = steps
    if isinstance(node, list):
        index = _index(node, step, text)
        return [*node[:index], _set(node[index], rest, value, text), *node[index + 1 :]]
    if not isinstance(node, Mapping):
        raise ConfigurationError(f"{text}: {shortened(node)} has no {step!r}")
    changed = copy(node)
    if not rest and value is None:
        changed.pop(step, None)
        return changed
    child = node.get(step, Mapping(node.line))
    changed[step] = _set(child, rest, value, text)
    inner = child if isinstance(child, list) else [child]
    if not rest or step not in node or not any(isinstance(item, Mapping) for item in inner):
        changed.origins = {**node.origins, step: text}
    return changed


def _index(items: list[Any], step: str, text: str) -> int:
    """Return the index of an item that is given by its name or its index."""
    names = [
        str(item.get("name", index)) if isinstance(item, Mapping) else str(index)
        for index, item in enumerate(items)
    ]
    if step in names:
        return names.index(step)
    if step.isdecimal() and int(step) < len(items):
        return int(step)
    raise UnknownNameError("name", step, names, text)
