"""Dotted paths of all values of a document or a parameter group, each with its value, unit and range."""

import re
from collections.abc import Iterator, Sequence
from collections.abc import Mapping as AnyMapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import reduce
from typing import Any, get_args

from sms_handover.configuration.conditions_fields import CONDITIONS_FIELDS
from sms_handover.configuration.field_specification import (
    EitherSpec,
    ListSpec,
    MappingSpec,
    NamedSpec,
    Spec,
    ValueSpec,
)
from sms_handover.configuration.parameters import specs_of
from sms_handover.configuration.robot_fields import ROBOT_FIELDS
from sms_handover.configuration.schedule_fields import SCHEDULE_FIELDS
from sms_handover.configuration.values import CONDITIONS, DEPUTY, ROBOT, SCHEDULE, path_of
from sms_handover.errors import ConfigurationError, UnknownNameError

_NAME = re.compile(r"[^.\[\]]+")
FIELDS: dict[str, MappingSpec] = {
    ROBOT: ROBOT_FIELDS,
    SCHEDULE: SCHEDULE_FIELDS,
    CONDITIONS: CONDITIONS_FIELDS,
}


@dataclass(frozen=True)
class ValuePath:
    """A value that can be set by path, its present value, and unit, range and meaning as text.

    ``value`` is None for a key that may be given and is not.
    """

    path: str
    value: object
    unit: str
    allowed: str
    description: str


def value_paths(document: str, content: AnyMapping[str, Any]) -> tuple[ValuePath, ...]:
    """Return the values of a document by path, in the order of its specification.

    ``content`` is that of the file, which its reader has accepted. The values of the deputy, which is a
    section of the schedule, begin with ``deputy``.
    """
    return tuple(_walk(document, FIELDS[document], content))


def require_known(values: Sequence[str], document: str, content: AnyMapping[str, Any]) -> None:
    """Raise UnknownNameError with the nearest path on a value at one that a document cannot have."""
    for text in values:
        role, of_document, steps = path_of(text)
        spec = FIELDS.get(document) if of_document == document else None
        right = steps if spec is None else _corrected(spec, steps)
        if right == steps:
            continue
        begin = f"{role}." if role else ""
        all_paths = [item.path for item in value_paths(document, content)]
        known = all_paths if right is None else [reduce(_below, right, document)]
        path, listed_by = text.partition(":=")[0], "sms-handover list paths"
        raise UnknownNameError("path", path, [f"{begin}{one}" for one in known], listed_by=listed_by)


def _corrected(spec: Spec, steps: Sequence[str]) -> list[str] | None:
    """Return steps with the nearest key in place of each unknown one; None where there is none."""
    if isinstance(spec, EitherSpec):
        spec = spec.other
    if not steps or isinstance(spec, ValueSpec):
        return list(steps)
    step, *rest = steps
    if isinstance(spec, MappingSpec):
        nearest = get_close_matches(step, spec.fields, n=1) if step not in spec.fields else [step]
        if not nearest:
            return None
        step = nearest[0]
    below = _corrected(spec.fields[step] if isinstance(spec, MappingSpec) else spec.each, rest)
    return None if below is None else [step, *below]


def spec_of(path: str) -> Spec | None:
    """Return the specification of a value of a document by its path, None where there is none."""
    try:
        _, document, steps = path_of(f"{path}:=")
    except ConfigurationError:
        return None
    spec: Spec | None = FIELDS[document]
    for step in steps:
        spec = _inner(spec, step)
    return spec


def _inner(spec: Spec | None, step: str) -> Spec | None:
    """Return the specification of a key or an entry, None where there is none."""
    if isinstance(spec, EitherSpec):
        spec = spec.other
    if isinstance(spec, MappingSpec):
        return spec.fields.get(step)
    if isinstance(spec, NamedSpec | ListSpec):
        return spec.each
    if isinstance(spec, ValueSpec) and (kinds := get_args(spec.kind)) and step.isdecimal():
        return replace(spec, kind=kinds[0], size=None)
    return None


def parameter_paths(node: str, cls: type[object], values: AnyMapping[str, object]) -> tuple[ValuePath, ...]:
    """Return the parameters of a group by path ``node.name``, with their values by name."""
    specs = specs_of(cls).items()
    return tuple(_value_path(f"{node}.{name}", values[name], spec) for name, spec in specs)


def _value_path(path: str, value: object, spec: ValueSpec) -> ValuePath:
    """Return a value with what its specification says of it."""
    return ValuePath(path, value, spec.unit, spec.allowed, spec.description)


def _walk(path: str, spec: Spec, value: Any) -> Iterator[ValuePath]:
    """Yield the values below a path; a word, or what is not given, is one value."""
    if isinstance(spec, EitherSpec):
        spec = spec.words if value is None or isinstance(value, str) else spec.other
    if isinstance(spec, ValueSpec):
        yield _value_path(path, value, spec)
    elif isinstance(spec, MappingSpec):
        for key, inner in spec.fields.items():
            if key in value or (isinstance(inner, ValueSpec | EitherSpec) and key not in spec.one_of):
                yield from _walk(_below(path, key), inner, value.get(key))
            elif isinstance(inner, MappingSpec) and not inner.required and key not in spec.one_of:
                yield from _walk(_below(path, key), inner, {})
    elif isinstance(spec, NamedSpec):
        for name, item in value.items():
            yield from _walk(_below(path, name), spec.each, item)
    else:
        for index, item in enumerate(value):
            name = str(item.get("name", ""))
            place = _below(path, name) if _NAME.fullmatch(name) else f"{path}[{index}]"
            yield from _walk(place, spec.each, item)


def _below(path: str, key: str) -> str:
    """Return the path of a key below a path."""
    return key if (path, key) == (SCHEDULE, DEPUTY) else f"{path}.{key}"
