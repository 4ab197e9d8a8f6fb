"""Tables as they go to a file: columns with kinds and units, and rows in batches."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class ListOf:
    """A cell that holds a list of values of one kind."""

    item: "Kind"


@dataclass(frozen=True)
class StructOf:
    """A cell that holds named values."""

    fields: tuple[tuple[str, "Kind"], ...]


Kind = str | ListOf | StructOf  # int8 .. uint64, float32, float64, bool, string, binary

INTEGER, FLOAT, TEXT = "int64", "float64", "string"


@dataclass(frozen=True)
class Column:
    """One column; ``unit`` is "" where the source does not tell any."""

    name: str
    kind: Kind
    unit: str = ""


class TableFile(ABC):
    """An open table."""

    @abstractmethod
    def write(self, rows: Sequence[Sequence[Any]]) -> None:
        """Append rows, each with a plain Python value per column."""

    @abstractmethod
    def close(self) -> None:
        """Complete the file."""


class Format(ABC):
    """A kind of file."""

    suffix: str

    @abstractmethod
    def open(self, stem: str, columns: Sequence[Column]) -> TableFile:
        """Create the file of a table, of which ``stem`` is the name without suffix."""


def kind_text(kind: Kind) -> str:
    """Return a kind as text."""
    if isinstance(kind, ListOf):
        return f"list<{kind_text(kind.item)}>"
    if isinstance(kind, StructOf):
        return "struct<" + ", ".join(f"{name}: {kind_text(item)}" for name, item in kind.fields) + ">"
    return kind
