"""Values of YAML documents by dotted path, such as ``robot.base.mass:=300``, set before any check."""

import json
import re
from collections.abc import Iterator, Sequence
from collections.abc import Mapping as AnyMapping
from copy import copy
from reprlib import repr as shortened
from typing import Any

from sms_handover.configuration.yaml_reader import Mapping, load_value
from sms_handover.errors import ConfigurationError, UnknownNameError

ROBOT, DEPUTY, SCHEDULE, CONDITIONS = "robot", "deputy", "schedule", "conditions"
DOCUMENTS = (ROBOT, DEPUTY, SCHEDULE, CONDITIONS)  # the deputy is a section of the schedule
TRUTH, MODEL = "truth", "model"
ROLES = (TRUTH, MODEL)  # what the plant has, and what every other node has
_OF_ROLES = (ROBOT, DEPUTY)
_STEP = re.compile(r"[^.\[\]]+")


def written(first: str, values: AnyMapping[str, object]) -> list[str]:
    """Return values below the first step of their path as texts that :func:`with_values` takes."""
    texts = list[str]()
    for path, value in values.items():
        if first in ROLES and isinstance(value, AnyMapping):  # a document, which is never set as a whole
            texts += written(f"{first}.{path}", value)
        else:
            texts.append(f"{first}.{path}:={json.dumps(value, default=str)}")
    return texts


def with_values(content: Mapping, document: str, values: Sequence[str], role: str = "") -> Mapping:
    """Return the content of a document with those of the values set that are its own.

    These are the values that hold for everybody, or those of one role, whose paths begin with its name. An
    item of a list is named by its ``name`` or its index; ``null`` removes a key or an item. Raises
    ConfigurationError; keys and values that a document may not have are left to its own checks.
    """
    for text in values:
        of_role, of_document, steps = path_of(text)
        if (of_role, of_document) == (role, document):
            content = _set(content, steps, load_value(text.partition(":=")[2], text), text)
    return content


def roles_of(values: Sequence[str]) -> Iterator[str]:
    """Yield the roles of the values that are set for one role alone; raises ConfigurationError."""
    yield from (role for role, _, _ in map(path_of, values) if role)


def path_of(text: str) -> tuple[str, str, list[str]]:
    """Return role ('' for everybody), document, and the steps below it, of an assignment ``path:=value``."""
    path, assigned, _ = text.partition(":=")
    role, steps = "", _STEP.findall(path)
    if steps and steps[0] in ROLES:
        role, *steps = steps
    known = _OF_ROLES if role else DOCUMENTS
    if not assigned or len(steps) < 2 or steps[0] not in known:  # a document and something in it
        begin = " or ".join(f"{role}.{name}" if role else name for name in known)
        raise ConfigurationError(
            f"value {text!r} must be of the form PATH:=VALUE, PATH beginning with {begin}"
        )
    first, *rest = steps
    return (role, SCHEDULE, [DEPUTY, *rest]) if first == DEPUTY else (role, first, rest)


def _set(node: Any, steps: Sequence[str], value: object, text: str) -> Any:
    """Return a copy of a node with a value set; what aliases share with it stays as it is."""
    if not steps:
        return value
    step, *rest = steps
    if isinstance(node, list):
        index = _index(node, step, text)
        inner = [] if not rest and value is None else [_set(node[index], rest, value, text)]
        return [*node[:index], *inner, *node[index + 1 :]]
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
