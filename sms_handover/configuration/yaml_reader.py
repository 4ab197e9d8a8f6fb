"""YAML from users, read safely: bounded, every key once, every error with its line.

It is YAML as ROS 2 reads it: 1e-3 and 1.5e3 are numbers, also without a decimal point or a sign. What
is in a file is data; no tag makes anything else of it.
"""

import re
from collections.abc import Iterator
from errno import EINVAL, EISDIR
from os import strerror
from pathlib import Path
from typing import Any

import yaml
from yaml.constructor import ConstructorError

LARGEST_FILE = 2**18  # [byte], some thirty times the schedule of the paper
_LARGEST = 2**19  # characters and nodes of a text, with every alias written out
_DEEPEST = 32  # mappings and lists inside one another


class Mapping(dict[str | float, Any]):
    """A mapping that remembers the line of each of its keys, counted from 1."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: dict[str | float, int] = {}


class YamlLoader(yaml.SafeLoader):
    """Loads plain data; raises yaml.YAMLError with the line where something else stands."""

    def __init__(self, stream: str, largest: int = _LARGEST) -> None:
        """Read a text of at most so many characters and nodes, with every alias written out."""
        super().__init__(stream)
        self._largest = largest
        self._depth = 0
        self._size = 0  # of what has been read, with every alias written out
        self._sizes: dict[int, int] = {}  # of the nodes, by their identity

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Return the next node; refuse what is too deep for a description, and aliases without end."""
        mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
        is_alias = self.check_event(yaml.AliasEvent)
        before = self._size
        self._depth += 1
        if self._depth > _DEEPEST:
            raise ConstructorError(None, None, f"there are more than {_DEEPEST} levels", mark)
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
            raise ConstructorError(None, None, "with its aliases written out it is too large", mark)
        return node

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """Return the value of a node; one that its tag does not allow is an error with its line."""
        try:
            return super().construct_object(node, deep)
        except (ValueError, OverflowError, LookupError, AttributeError, TypeError) as error:
            text = f"{str(node.value)[:40]!r} is not a value of its kind: {error}"
            raise ConstructorError(None, None, text, node.start_mark) from error


def _mapping(loader: YamlLoader, node: yaml.MappingNode) -> Iterator[Mapping]:
    """Yield a mapping, then fill it, as a constructor of yaml does; refuse a key given twice."""
    mapping = Mapping()
    yield mapping
    for key_node, value_node in node.value:
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, str | int | float):
            raise ConstructorError(None, None, "a key must be a word or a number", key_node.start_mark)
        if key in mapping:
            raise ConstructorError(None, None, f"key {key!r} is given twice", key_node.start_mark)
        mapping[key] = loader.construct_object(value_node, deep=True)
        mapping.lines[key] = key_node.start_mark.line + 1


YamlLoader.add_constructor("tag:yaml.org,2002:map", _mapping)
yaml.SafeDumper.add_representer(Mapping, yaml.SafeDumper.represent_dict)
YamlLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)


def read_text(path: Path, largest: int = LARGEST_FILE) -> str:
    """Return the text of a file; raises OSError, UnicodeDecodeError, or ValueError where it is too large."""
    if path.is_dir():
        raise IsADirectoryError(EISDIR, strerror(EISDIR))
    if path.exists() and not path.is_file():
        raise OSError(EINVAL, "not a file of bytes")  # a pipe would be waited for without end
    with path.open("rb") as stream:
        content = stream.read(largest + 1)
    if len(content) > largest:
        raise ValueError(f"it has more than {largest} bytes")
    return content.decode("utf-8")


def load(text: str, largest: int = _LARGEST) -> Any:
    """Return what a YAML text holds, mappings as :class:`Mapping`; raises yaml.YAMLError.

    ``largest`` bounds its characters and nodes, with every alias written out.
    """
    loader = YamlLoader(text, largest)
    try:
        return loader.get_single_data()
    finally:
        loader.dispose()


def compose(text: str) -> yaml.Node | None:
    """Return the nodes of a YAML text, None if it is empty; raises yaml.YAMLError."""
    node: yaml.Node | None = yaml.compose(text, YamlLoader)
    return node


def line_in(value: object, key: str) -> str:
    """Return ``:line`` of a key where a mapping knows it, else ''."""
    line = value.lines.get(key) if isinstance(value, Mapping) else None
    return f":{line}" if line else ""


def reason(error: Exception) -> str:
    """Return the text of an error, which has the line of the file if it knows one, in one line."""
    return " ".join(str(error).split())
