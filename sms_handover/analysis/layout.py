"""Layout of plain-text tables with a column per run, split into blocks where they would be too wide."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import inf, isnan
from typing import TypeVar

T = TypeVar("T")

WIDTH = 100  # [characters] of the longest line
MISSING = "-"
_LONGEST_NAME = 24  # [characters] of a run; a longer one is shortened to its end
_GAP = "  "


@dataclass(frozen=True)
class Row:
    """A label with its unit, and one cell per run; a subheading has no cells.

    ``better`` has the indices of the cells with the best value, none if they are all equal.
    """

    label: str
    cells: tuple[str, ...] = ()
    better: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Section:
    """Rows under a title; the names of the runs are printed beside the title."""

    title: str
    rows: tuple[Row, ...]


def number(value: float, missing: str = MISSING) -> str:
    """Return a number with four significant digits."""
    return missing if isnan(value) else f"{value:.4g}"


def row(
    label: str,
    items: Iterable[T | None],
    value: Callable[[T], float],
    missing: str = MISSING,
    *,
    smaller_is_better: bool = False,
) -> Row:
    """Return a row with a number for every item; ``missing`` stands for NaN, a dash for no item.

    With ``smaller_is_better`` a NaN with its own text, such as *never*, is worse than any number.
    """
    values = [None if item is None else value(item) for item in items]
    cells = tuple(MISSING if each is None else number(each, missing) for each in values)
    if not smaller_is_better:
        return Row(label, cells)
    costs = [inf if each is None or isnan(each) else each for each in values]
    return Row(label, cells, _best(cells, costs))


def _best(cells: Sequence[str], costs: Sequence[float]) -> frozenset[int]:
    """Return the indices of the smallest cost, none if all known cells read the same."""
    known = [cell for cell in cells if cell != MISSING]
    if len(set(known)) <= 1:
        return frozenset()
    best = cells[min(range(len(cells)), key=costs.__getitem__)]
    return frozenset(place for place, cell in enumerate(cells) if cell == best)


def layout(names: Sequence[str], sections: Sequence[Section]) -> list[str]:
    """Return the lines of the sections, with as many runs side by side as the width allows."""
    short = [name if len(name) <= _LONGEST_NAME else f"...{name[3 - _LONGEST_NAME :]}" for name in names]
    rows = [item for section in sections for item in section.rows]
    labels = [*(section.title for section in sections), *(item.label for item in rows if item.cells)]
    label = max(map(len, labels), default=0)
    cell = max(map(len, [*short, *(text for item in rows for text in item.cells)]), default=0)
    at_once = max(1, (WIDTH - label) // (cell + len(_GAP)))
    lines = []
    for first in range(0, max(len(short), 1), at_once):
        columns = slice(first, first + at_once)
        for section in sections:
            head = _line(Row(section.title, tuple(short[columns])), label, cell)
            lines += ["", head, "-" * len(head)]
            lines += [_line(Row(item.label, item.cells[columns]), label, cell) for item in section.rows]
    return lines


def _line(item: Row, label: int, cell: int) -> str:
    return (item.label.ljust(label) + "".join(_GAP + text.rjust(cell) for text in item.cells)).rstrip()
