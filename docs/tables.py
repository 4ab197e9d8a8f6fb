"""Markdown of the pages that are written from the code."""

from collections.abc import Iterable, Sequence

WRITTEN_BY = "This page is written by `make reference`; a test fails when it is not up to date."


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table."""
    cells = [head, ["---"] * len(head), *([cell.replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join("| " + " | ".join(row) + " |" for row in cells)


def plain(text: str) -> str:
    """Return text that means itself: no tag, no emphasis."""
    return text.replace("<", r"\<").replace("*", r"\*")
