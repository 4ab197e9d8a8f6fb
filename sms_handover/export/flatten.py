"""Flatten messages of any type into rows, with a column per primitive field."""

import keyword
from collections.abc import Callable
from operator import attrgetter
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from sms_handover.bag.schemas import SchemaTypes
from sms_handover.errors import BagError
from sms_handover.export.table import Column, Kind, ListOf, StructOf

_MOST_COLUMNS = 64  # elements of a fixed-size array that become columns
_INTEGERS = tuple(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
_KINDS = frozenset((*_INTEGERS, "float32", "float64", "bool", "string"))
_NUMBERS = {"byte": "uint8", "octet": "uint8", "char": "uint8"}

Getter = Callable[[Any], Any]


class Flattener:
    """The columns of one type, and the row of a message.

    A nested message adds its columns under its name and a dot; a fixed-size array of at most 64
    primitives has a column per element, ``covariance[0]``; any other array is one cell: bytes as
    binary, others as a list, of structs if it holds messages.
    """

    def __init__(self, types: SchemaTypes) -> None:
        """Plan the columns of the type of a schema; raises BagError on a type without a definition."""
        self._types = types
        self.columns: list[Column] = []
        self._getters: list[tuple[Getter, Kind]] = []
        self._add(types.name, "", (), ())

    def row(self, message: Any) -> list[Any]:
        """Return a decoded message as a row."""
        return [_value(getter(message), kind) for getter, kind in self._getters]

    def _add(self, type_name: str, prefix: str, path: tuple[str, ...], above: tuple[str, ...]) -> None:
        """Add the columns of a type below a path of attributes."""
        if type_name in above:
            raise BagError(f"{type_name} contains itself")
        for name, (node, content) in self._types.fields(type_name):
            full, where = f"{prefix}{name}", (*path, _attribute(name))
            if node == Nodetype.NAME:
                self._add(content, f"{full}.", where, (*above, type_name))
            elif node == Nodetype.BASE:
                self._column(full, _base(content[0]), attrgetter(".".join(where)))
            else:
                self._add_array(full, where, node, content)

    def _add_array(self, name: str, path: tuple[str, ...], node: Nodetype, content: Any) -> None:
        """Add an array as columns or as one cell."""
        (item, detail), length = content
        get = attrgetter(".".join(path))
        if item == Nodetype.NAME:
            self._column(name, ListOf(self._struct(detail, ())), get)
            return
        kind = _base(detail[0])
        if node == Nodetype.ARRAY and length <= _MOST_COLUMNS:
            for place in range(length):
                self._column(f"{name}[{place}]", kind, _element(get, place))
        else:
            self._column(name, "binary" if kind == "uint8" else ListOf(kind), get)

    def _column(self, name: str, kind: Kind, getter: Getter) -> None:
        """Add one column."""
        self.columns.append(Column(name, kind))
        self._getters.append((getter, kind))

    def _struct(self, type_name: str, above: tuple[str, ...]) -> StructOf:
        """Return the kind of a nested message."""
        if type_name in above:
            raise BagError(f"{type_name} contains itself")
        inner = (*above, type_name)
        fields = [(name, self._kind(field, inner)) for name, field in self._types.fields(type_name)]
        return StructOf(tuple(fields))

    def _kind(self, field: Any, above: tuple[str, ...]) -> Kind:
        """Return the kind of a field within a cell."""
        node, content = field
        if node == Nodetype.NAME:
            return self._struct(content, above)
        if node == Nodetype.BASE:
            return _base(content[0])
        return ListOf(self._kind(content[0], above))


def _base(name: str) -> str:
    """Return the kind of a primitive type; raises BagError on one that tables do not have."""
    kind = _NUMBERS.get(name, name)
    if kind not in _KINDS:
        raise BagError(f"fields of type {name} cannot be exported")
    return kind


def _attribute(name: str) -> str:
    """Return the attribute of a field; rosbags appends an underscore to keywords of Python."""
    return f"{name}_" if keyword.iskeyword(name) else name


def _element(get: Getter, place: int) -> Getter:
    """Return a getter of one element of an array."""
    return lambda message: get(message)[place]


def _value(value: Any, kind: Kind) -> Any:
    """Return what a message holds as lists, dicts, numbers and strings of a kind.

    ``byte`` is unsigned here as in ROS; rosbags reads it as signed.
    """
    if isinstance(kind, StructOf):
        return {name: _value(getattr(value, _attribute(name)), item) for name, item in kind.fields}
    if isinstance(kind, ListOf):
        if not isinstance(value, np.ndarray):
            return [_value(item, kind.item) for item in value]
        value = value.view(np.uint8) if kind.item == "uint8" else value
        return value.tolist()
    if kind == "binary":
        return bytes(value)
    plain = value.item() if isinstance(value, np.generic) else value
    return plain & 0xFF if kind == "uint8" else plain
