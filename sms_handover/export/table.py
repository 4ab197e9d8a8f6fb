"""Table files: columns with kinds and units, and rows in batches."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class ListOf:
    """A list of values of one kind."""

    item: "Kind"


@dataclass(frozen=True)
class StructOf:
    """Named values."""

    fields: tuple[tuple[str, "Kind"], ...]


Kind = str | ListOf | StructOf  # int8 .. uint64, float32, float64, bool, string, binary

INTEGER, FLOAT, TEXT = "int64", "float64", "string"


@dataclass(frozen=True)
class Column:
    """One column; ``unit`` is "" if unknown."""

    name: str
    kind: Kind
    unit: str = ""


class TableFile(ABC):
    """An open table file."""

    @abstractmethod
    def write(self, rows: Sequence[Sequence[Any]]) -> None:
        """Append rows, each with a plain Python value per column."""

    @abstractmethod
    def close(self) -> None:
        """Complete the file."""


class Format(ABC):
    """A file format."""

    suffix: str

    @abstractmethod
    def open(self, stem: str, columns: Sequence[Column]) -> TableFile:
        """Create the file of a table, ``stem`` being its name without suffix."""


def kind_text(kind: Kind) -> str:
    """Return a kind as text."""
    if isinstance(kind, ListOf):
        return f"list<{kind_text(kind.item)}>"
    if isinstance(kind, StructOf):
        return "struct<" + ", ".join(f"{name}: {kind_text(item)}" for name, item in kind.fields) + ">"
    return kind
