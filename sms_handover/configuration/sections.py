"""YAML mappings and lists that remember the line they start at, for errors that point at it."""

from collections.abc import Sequence
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any

import yaml

from sms_handover.configuration import yaml_reader as yaml_files
from sms_handover.configuration.parameters import as_float
from sms_handover.errors import ScheduleError, UnknownNameError


class Section:
    """A mapping of a YAML file: typed access to its keys, with the line in every error."""

    def __init__(self, path: Path, node: yaml.MappingNode) -> None:
        """Index the keys; raises ScheduleError on a key given twice."""
        self._path = path
        self.line = node.start_mark.line + 1
        self._nodes: dict[str, yaml.Node] = {}
        self._lines: dict[str, int] = {}
        for key_node, value_node in node.value:
            key = str(key_node.value)
            if key in self._nodes:
                raise self.error(f"key {key!r} is given twice", key_node.start_mark.line + 1)
            self._nodes[key] = value_node
            self._lines[key] = key_node.start_mark.line + 1

    def error(self, text: str, line: int | None = None) -> ScheduleError:
        """Return an error that names the file and a line, by default that of this section."""
        return ScheduleError(f"{self._path}:{line or self.line}: {text}")

    @property
    def keys(self) -> tuple[str, ...]:
        """Return the keys in the order of the file."""
        return tuple(self._nodes)

    def line_of(self, key: str) -> int:
        """Return the line of a key."""
        return self._lines[key]

    def where(self, key: str) -> str:
        """Return file and line of a key, as errors name them."""
        return f"{self._path}:{self.line_of(key)}"

    def reject_unknown(self, known: Sequence[str]) -> None:
        """Raise ScheduleError on a key that is not among the known ones."""
        for key in self._nodes:
            if key not in known:
                raise ScheduleError(str(UnknownNameError("key", key, known, self.where(key))))

    def has(self, key: str) -> bool:
        """Whether a key is given."""
        return key in self._nodes

    def section(self, key: str) -> "Section":
        """Return the mapping under a key."""
        node = self._get(key)
        if not isinstance(node, yaml.MappingNode):
            raise self.error(f"{key!r} must be a mapping", self.line_of(key))
        return Section(self._path, node)

    def sections(self, key: str) -> list["Section"]:
        """Return the mappings in the list under a key."""
        node = self._get(key)
        if not isinstance(node, yaml.SequenceNode):
            raise self.error(f"{key!r} must be a list", self.line_of(key))
        for item in node.value:
            if not isinstance(item, yaml.MappingNode):
                raise self.error(f"every item of {key!r} must be a mapping", item.start_mark.line + 1)
        return [Section(self._path, item) for item in node.value]

    def is_text(self, key: str) -> bool:
        """Whether the value of a key is a single word or number."""
        return isinstance(self._get(key), yaml.ScalarNode)

    def value(self, key: str) -> Any:
        """Return the plain value under a key."""
        loader = yaml_files.YamlLoader("")
        try:
            return loader.construct_object(self._get(key), deep=True)
        except yaml.YAMLError as error:
            raise self.error(f"{key!r}: {yaml_files.reason(error)}", self.line_of(key)) from error

    def text(self, key: str) -> str:
        """Return the text under a key."""
        value = self.value(key)
        if not isinstance(value, str) or not value:
            raise self.error(f"{key!r} is {value!r}, expected text", self.line_of(key))
        return value

    def number(self, key: str, unit: str, minimum: float = -inf) -> float:
        """Return the finite number under a key."""
        return self._number(self.value(key), key, unit, minimum)

    def count(self, key: str, minimum: int, maximum: int) -> int:
        """Return the whole number under a key."""
        value = self.value(key)
        if not isinstance(value, int) or isinstance(value, bool) or not minimum <= value <= maximum:
            raise self.error(
                f"{key!r} is {value!r}, expected a whole number from {minimum} to {maximum}",
                self.line_of(key),
            )
        return value

    def vector(self, key: str, size: int, unit: str) -> list[float]:
        """Return the list of ``size`` finite numbers under a key."""
        values = self.value(key)
        if not isinstance(values, list) or len(values) != size:
            raise self.error(f"{key!r} is {values!r}, expected {size} numbers in {unit}", self.line_of(key))
        return [self._number(value, key, unit, -inf) for value in values]

    def _number(self, value: object, key: str, unit: str, minimum: float) -> float:
        """Return ``value`` as a float if it is a finite number not below ``minimum``."""
        number = as_float(value) if isinstance(value, int | float) and not isinstance(value, bool) else nan
        if not isfinite(number) or number < minimum:
            allowed = f"a number of at least {minimum:g}" if minimum > -inf else "a finite number"
            raise self.error(f"{key!r} is {value!r}, expected {allowed} in {unit}", self.line_of(key))
        return number

    def _get(self, key: str) -> yaml.Node:
        """Return the node under a key, which must be given."""
        if key not in self._nodes:
            raise self.error(f"key {key!r} is missing")
        return self._nodes[key]


def read_section(path: Path) -> tuple[Section, str]:
    """Return the top-level mapping of a YAML file and the file's text; raises ScheduleError."""
    try:
        text = yaml_files.read_text(path)
        node = yaml_files.compose(text)
    except OSError as error:
        raise ScheduleError(f"cannot read the schedule {path}: {error.strerror}") from error
    except (yaml.YAMLError, ValueError) as error:
        raise ScheduleError(f"{path} is not valid YAML: {yaml_files.reason(error)}") from error
    if not isinstance(node, yaml.MappingNode):
        raise ScheduleError(f"{path}: expected a mapping at the top level")
    return Section(path, node), text
