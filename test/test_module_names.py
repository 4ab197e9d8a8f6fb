"""Module names: the first docstring line of each module contains a noun of its file name."""

import ast
import re
from pathlib import Path

from .workspace import PACKAGE, ROOT

SPELLED_OUT = {  # a line may spell out these words of file names
    "cli": "command",
    "ik": "kinematics",
    "mpc": "predictive",
    "info": "information",
    "main": "command",
    "nmpc": "predictive",
    "pid": "proportional",
    "qos": "quality",
}
SUFFIXES = ("ation", "ment", "ings", "ing", "ers", "er", "ion", "ies", "es", "ed", "s", "e", "y")
SHORTEST = 3  # [letters] of a stem

EXCEPTIONS: dict[str, str] = {}  # file in the package: reason


def stem(word: str) -> str:
    """Return a word without its ending."""
    ending = next((end for end in SUFFIXES if word.endswith(end) and len(word) - len(end) >= SHORTEST), "")
    return word.removesuffix(ending)


def same(one: str, other: str) -> bool:
    """Whether two words have the same stem, or long stems that differ at the end: conversion, convert."""
    stems = stem(one), stem(other)
    length = max(4, min(map(len, stems)) - 1)
    return stems[0][:length] == stems[1][:length]


def offence(file: str, source: str) -> str:
    """Return the first docstring line if it contains no noun of the file name, '' if it does."""
    path = Path(PACKAGE, file)
    name = path.parent.name if path.stem == "__init__" else path.stem.strip("_")
    words = [word for part in name.split("_") for word in (part, SPELLED_OUT.get(part, part))]
    first = (ast.get_docstring(ast.parse(source)) or "no docstring").splitlines()[0]
    found = any(same(word, other) for word in words for other in re.findall(r"[a-z0-9]+", first.lower()))
    return "" if found else f"{file}: {first}"


def offences() -> dict[str, str]:
    """Return the offence of every module that commits one."""
    found = {}
    for path in sorted((ROOT / PACKAGE).rglob("*.py")):
        file = path.relative_to(ROOT / PACKAGE).as_posix()
        found[file] = offence(file, path.read_text(encoding="utf-8"))
    return {file: line for file, line in found.items() if line}


def test_each_module_says_what_its_name_says() -> None:
    found = offences()
    lines = [line for file, line in found.items() if file not in EXCEPTIONS]
    assert not lines, "\n".join(["no noun of the file name in the first line of", *lines])
    assert EXCEPTIONS.keys() <= found.keys(), "there are exceptions that are not needed"


def test_nouns_are_found() -> None:
    assert not offence("bag/repair/recover.py", '"""Recovery of what a damaged bag holds."""')
    assert not offence("bag/mcap/__init__.py", '"""MCAP records, byte by byte."""')
    assert not offence("cli/main.py", '"""The command line."""')
    assert not offence("ik/residual.py", '"""Residuals of both arms."""')
    assert not offence("ros/codecs/convert.py", '"""Conversion of values to messages."""')
    assert not offence("simulation/save.py", '"""Saving a run."""')
    assert offence("control/base.py", '"""The contract of a law."""')
    assert offence("ros/door.py", '"""Messages that come in."""') == "ros/door.py: Messages that come in."
    assert offence("plant/base.py", "x = 1\n") == "plant/base.py: no docstring"
