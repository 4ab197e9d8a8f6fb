"""Targets of values: whether what is drawn is set a second time, by another path or by another draw."""

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from sms_handover.configuration.scenario_file import SHORT
from sms_handover.configuration.values import DEPUTY, ROLES, SCHEDULE, TRUTH

_STEP = re.compile(r"[^.\[\]]+")


class Target(NamedTuple):
    """Where a value goes: the role that alone has it, '' for all, and the steps to it."""

    role: str
    steps: tuple[str, ...]


def target_of(path: str) -> Target:
    """Return where the value at a dotted path goes, the same for all ways to write the path.

    That an item of a list is named by its index here and by its name there only the scenario knows.
    """
    if path in SHORT:
        return Target("", (SHORT[path], path))
    steps = tuple(_STEP.findall(path))
    role, steps = (steps[0], steps[1:]) if steps and steps[0] in ROLES else ("", steps)
    return Target(role, steps[1:] if steps[:2] == (SCHEDULE, DEPUTY) else steps)


def paths_of(values: Mapping[str, object]) -> Iterator[str]:
    """Yield the paths that values set; a document is never set as a whole, but what is in it."""
    for path, value in values.items():
        if isinstance(value, Mapping) and len(target_of(path).steps) == 1:
            yield from (f"{path}.{key}" for key in value)
        else:
            yield path


def set_twice(drawn: Iterable[str], values: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield each drawn path that another draw or a value sets too, and the path of that."""
    seen: dict[Target, str] = {}
    for path in drawn:
        if (target := target_of(path)) in seen:
            yield path, seen[target]
        seen[target] = path
    others = {target_of(path): path for path in values}
    for target, path in seen.items():
        if target in others:
            yield path, others[target]
        for other, by in {**seen, **others}.items():  # what is for the plant alone lies over what is for all
            begins_with = target.steps[: len(other.steps)] == other.steps
            if not target.role and other.role == TRUTH and begins_with:
                yield path, by
