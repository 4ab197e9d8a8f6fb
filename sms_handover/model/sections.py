"""Checks on the shape of a description file: which keys it has, and what kind of value stands where."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from sms_handover.configuration.yaml_reader import line_in
from sms_handover.errors import RobotDescriptionError, UnknownNameError
from sms_handover.model.parts import Origin
from sms_handover.model.validation import vector

Section = Mapping[str, object]

_LINE = re.compile(r"^line \d+: ")  # that of the section around the key


def read_section(value: object, where: str, required: Sequence[str], optional: Sequence[str] = ()) -> Section:
    """Return ``value`` as a mapping with all required and no unknown keys; raises RobotDescriptionError."""
    if not isinstance(value, dict):
        raise RobotDescriptionError(f"{where} is {value!r}, expected a mapping")
    known = (*required, *optional)
    for key in value:
        if key not in known:
            raise unknown("key", key, known, at(value, key, where))
    for key in required:
        if key not in value:
            raise RobotDescriptionError(f"{where}: key {key!r} is missing")
    return value


def at(section: Section, key: str, what: str) -> str:
    """Return what is named, with the line of a key before it where the section knows it."""
    line = line_in(section, key)
    if not line:
        return what
    return f"line {line[1:]}: {_LINE.sub('', what)}"


def read_list(value: object, where: str) -> list[object]:
    """Return ``value`` as a list; raises RobotDescriptionError."""
    if not isinstance(value, list):
        raise RobotDescriptionError(f"{where} is {value!r}, expected a list")
    return value


def read_text(value: object, where: str) -> str:
    """Return ``value`` as text that is not empty; raises RobotDescriptionError."""
    if not isinstance(value, str) or not value:
        raise RobotDescriptionError(f"{where} is {value!r}, expected text")
    return value


def unknown(kind: str, name: str, known: Sequence[str], where: str) -> RobotDescriptionError:
    """Return the error on a name that is not known, with the nearest one that is."""
    return RobotDescriptionError(str(UnknownNameError(kind, name, known, where)))


def read_origin(value: object, where: str) -> Origin:
    """Return a mapping of ``xyz`` m and ``rpy`` rad as an Origin; raises RobotDescriptionError."""
    section = read_section(value, where, ("xyz", "rpy"))
    xyz = vector(section["xyz"], 3, at(section, "xyz", f"{where}: xyz"), "m")
    return Origin(xyz, vector(section["rpy"], 3, at(section, "rpy", f"{where}: rpy"), "rad"))


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Put the file's path before the text of an error raised inside."""
    try:
        yield
    except RobotDescriptionError as error:
        raise RobotDescriptionError(f"{path}: {error}") from error
