"""YAML reader: bounded input, plain data, every key once, every error with its line.

Numbers are written as ROS 2 and YAML 1.2 write them: 1e-3 is one, without a decimal point or a sign too;
010 and 1:30 are text, not the 8 and 90 of YAML 1.1.
"""

import re
from collections.abc import Iterator
from errno import EINVAL, EISDIR
from os import strerror
from pathlib import Path
from typing import Any

import yaml
from yaml.constructor import ConstructorError

from sms_handover.errors import ConfigurationError

LARGEST_FILE = 2**18  # [byte], some thirty times the schedule of the paper
_LARGEST = 2**19  # characters and nodes of a text, with aliases expanded
_DEEPEST = 32  # nested mappings and lists
_TAG = "tag:yaml.org,2002:"
_INT = re.compile(r"^[-+]?(0|[1-9][0-9_]*|0x[0-9a-fA-F_]+|0b[01_]+)$")
_FLOAT = re.compile(
    r"^[-+]?(([0-9][0-9_]*\.[0-9_]*|\.[0-9][0-9_]*)([eE][-+]?[0-9]+)?|[0-9][0-9_]*[eE][-+]?[0-9]+"
    r"|\.(inf|Inf|INF))$|^\.(nan|NaN|NAN)$"
)


class Mapping(dict[Any, Any]):
    """A mapping that knows its line and those of its keys, counted from 1.

    ``file`` is None where it is that of the mapping around it.
    """

    def __init__(self, line: int = 0, file: Path | None = None) -> None:
        super().__init__()
        self.line, self.file = line, file
        self.lines: dict[Any, int] = {}
        self.origins: dict[Any, str] = {}  # of values that were set from elsewhere


class YamlLoader(yaml.SafeLoader):
    """Loads plain data; raises yaml.YAMLError with the line of anything else."""

    def __init__(self, stream: str, largest: int = _LARGEST) -> None:
        """Read a text of at most ``largest`` characters and nodes, with aliases expanded."""
        super().__init__(stream)
        self._largest = largest
        self._depth = 0
        self._size = 0  # of what has been read, with aliases expanded
        self._sizes: dict[int, int] = {}  # of the nodes, by their identity

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Return the next node; rejects deep nesting and aliases that expand without end."""
        mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
        is_alias = self.check_event(yaml.AliasEvent)
        before = self._size
        self._depth += 1
        if self._depth > _DEEPEST:
            raise ConstructorError(None, None, f"more than {_DEEPEST} nested levels", mark)
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        if is_alias and id(node) not in self._sizes:
            raise ConstructorError(None, None, "an alias refers to what it is in", mark)
        if is_alias:
            self._size += self._sizes[id(node)]
        else:
            self._size += 1 + (len(node.value) if isinstance(node, yaml.ScalarNode) else 0)
            self._sizes[id(node)] = self._size - before
        if self._size > self._largest:
            raise ConstructorError(None, None, "too large with its aliases expanded", mark)
        return node

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """Return the value of a node; one that its tag does not allow is an error with its line."""
        try:
            return super().construct_object(node, deep)
        except (ValueError, OverflowError, LookupError, AttributeError, TypeError) as error:
            kind = node.tag.removeprefix(_TAG)
            text = f"{str(node.value)[:40]!r} is not a valid {kind}: {error}"
            raise ConstructorError(None, None, text, node.start_mark) from error


def _mapping(loader: YamlLoader, node: yaml.MappingNode) -> Iterator[Mapping]:
    """Yield a mapping, then fill it, as yaml's own constructors do; rejects a key given twice."""
    mapping = Mapping(node.start_mark.line + 1)
    yield mapping
    for key_node, value_node in node.value:
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, str | int | float):
            raise ConstructorError(None, None, "a key must be text or a number", key_node.start_mark)
        if key in mapping:
            raise ConstructorError(None, None, f"key {key!r} is given twice", key_node.start_mark)
        mapping[key] = loader.construct_object(value_node, deep=True)
        mapping.lines[key] = key_node.start_mark.line + 1


def _float(text: str) -> float:
    """Return a number as Python reads it, and as YAML writes infinity and NaN."""
    return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))


YamlLoader.add_constructor(f"{_TAG}map", _mapping)
YamlLoader.add_constructor(f"{_TAG}int", lambda loader, node: int(node.value, 0))
YamlLoader.add_constructor(f"{_TAG}float", lambda loader, node: _float(node.value))
YamlLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag not in (f"{_TAG}int", f"{_TAG}float")]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
YamlLoader.add_implicit_resolver(f"{_TAG}int", _INT, list("-+0123456789"))
YamlLoader.add_implicit_resolver(f"{_TAG}float", _FLOAT, list("-+.0123456789"))
yaml.SafeDumper.add_representer(Mapping, yaml.SafeDumper.represent_dict)


def read_text(path: Path, largest: int = LARGEST_FILE) -> str:
    """Return the text of a file; raises OSError, UnicodeDecodeError, or ValueError if it is too large.

    A pipe is rejected: it can be read once, and a run reads its files several times.
    """
    if path.is_dir():
        raise IsADirectoryError(EISDIR, strerror(EISDIR))
    if path.exists() and not path.is_file():
        raise OSError(EINVAL, "must be a regular file, not a pipe or device")
    with path.open("rb") as stream:
        content = stream.read(largest + 1)
    if len(content) > largest:
        raise ValueError(f"more than {largest} bytes")
    return content.decode("utf-8")


def load(text: str, largest: int = _LARGEST) -> Any:
    """Return the data of a YAML text, mappings as :class:`Mapping`; raises yaml.YAMLError.

    ``largest`` bounds its characters and nodes, with aliases expanded.
    """
    loader = YamlLoader(text, largest)
    try:
        return loader.get_single_data()
    finally:
        loader.dispose()


def load_value(text: str, assignment: str) -> Any:
    """Return the value in an assignment ``name:=value``; raises ConfigurationError."""
    try:
        return load(text)
    except (yaml.YAMLError, ValueError) as error:
        raise ConfigurationError(f"the value of {assignment!r} is not YAML: {_reason(error)}") from error


def load_mapping(text: str, path: Path) -> Mapping:
    """Return the mapping in the text of a file; raises ConfigurationError with the line."""
    try:
        document = load(text)
    except yaml.MarkedYAMLError as error:
        line = f":{error.problem_mark.line + 1}" if error.problem_mark else ""
        raise ConfigurationError(f"{path}{line}: not valid YAML: {_reason(error)}") from error
    except yaml.YAMLError as error:
        raise ConfigurationError(f"{path}: not valid YAML: {_reason(error)}") from error
    if not isinstance(document, Mapping):
        raise ConfigurationError(f"{path}: must be a mapping at the top level")
    document.file = path
    return document


def read_file(path: Path) -> str:
    """Return the text of a file; raises ConfigurationError."""
    try:
        return read_text(path)
    except OSError as error:
        raise ConfigurationError(f"cannot read {path}: {error.strerror}") from error
    except ValueError as error:
        raise ConfigurationError(f"cannot read {path}: {error}") from error


def read_yaml(path: Path) -> Mapping:
    """Return the mapping in a YAML file; raises ConfigurationError."""
    return load_mapping(read_file(path), path)


def _reason(error: Exception) -> str:
    """Return what is wrong as one line; the line of the file is that of ``problem_mark``."""
    if not isinstance(error, yaml.MarkedYAMLError):
        return " ".join(str(error).split())
    begun = f" (line {error.context_mark.line + 1})" if error.context_mark else ""
    return f"{error.context}{begun}: {error.problem}" if error.context else str(error.problem)
