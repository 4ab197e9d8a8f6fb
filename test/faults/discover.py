"""Finds the families: every file of this folder that has a TITLE and FAULTS."""

import ast
from collections.abc import Sequence
from fnmatch import fnmatch
from importlib import import_module
from itertools import groupby
from pathlib import Path
from random import Random
from typing import Any

from .fault import Family, Fault

_ASKED = {"TITLE", "FAULTS"}


def families() -> tuple[Family, ...]:
    """Return all families by name; raises ValueError where two faults of one have the same name."""
    found = []
    for file in sorted(Path(__file__).parent.glob("*.py")):
        if _assigned(file) >= _ASKED:
            module = import_module(f".{file.stem}", __package__)
            found.append(Family(file.stem, module.TITLE, tuple(module.FAULTS)))
    for family in found:
        names = [fault.name for fault in family.faults]
        twice = {name for name in names if names.count(name) > 1}
        if twice:
            raise ValueError(f"{family.name}.py has several faults named {', '.join(sorted(twice))}")
    return tuple(found)


def chosen(
    among: Sequence[Family], names: Sequence[str], patterns: Sequence[str]
) -> list[tuple[Family, Fault[Any]]]:
    """Return the faults of families of these names that fit a pattern; () lets all through.

    A pattern is FAMILY/NAME or a part of it with ``*``; raises ValueError for one that fits nothing.
    """
    everything = [(family, fault) for family in among for fault in family.faults]
    for name in names:
        if name not in {family.name for family in among}:
            raise ValueError(f"there is no family {name!r}; there are {', '.join(f.name for f in among)}")
    for pattern in patterns:
        if not any(_fits(family, fault, pattern) for family, fault in everything):
            raise ValueError(f"no fault fits {pattern!r}; --list shows all")
    return [
        (family, fault)
        for family, fault in everything
        if (not names or family.name in names)
        and (not patterns or any(_fits(family, fault, pattern) for pattern in patterns))
    ]


def sample(jobs: Sequence[tuple[Family, Fault[Any]]], seed: int) -> list[tuple[Family, Fault[Any]]]:
    """Return one of the faults of each family, which the seed decides."""
    random = Random(seed)
    by_family = groupby(jobs, key=lambda job: job[0].name)
    return [random.choice(list(of_family)) for _, of_family in by_family]


def _fits(family: Family, fault: Fault[Any], pattern: str) -> bool:
    """Whether a fault fits a pattern, with or without the name of its family."""
    return fnmatch(f"{family.name}/{fault.name}", pattern) or fnmatch(fault.name, pattern)


def _assigned(file: Path) -> set[str]:
    """Return the names that a file gives a value to at its top, without importing it."""
    names: set[str] = set()
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        names.update(target.id for target in targets if isinstance(target, ast.Name))
    return names
