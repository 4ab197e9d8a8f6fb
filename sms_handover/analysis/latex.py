"""LaTeX table of a comparison: the rows of the plain one, typeset with booktabs."""

import re
from collections.abc import Iterator, Sequence

from sms_handover.analysis.layout import Row, Section

_HEAD = "% needs \\usepackage{booktabs, longtable}"
_INDENT = "  "  # of a label below another
_SPECIAL = {
    **{character: f"\\{character}" for character in "&%$#_{}"},
    "\\": "\\textbackslash{}",
    "~": "\\textasciitilde{}",
    "^": "\\textasciicircum{}",
    "|": "\\textbar{}",
    "<": "\\textless{}",
    ">": "\\textgreater{}",
}
_UNSAFE = re.compile(r"\^(\d)|[" + re.escape("".join(_SPECIAL)) + "]")

_NUMBER = re.compile(r"(-?\d+(?:\.\d+)?)(?:e([+-]\d+))?")


def latex_table(names: Sequence[str], sections: Sequence[Section]) -> str:
    """Return a ``longtable`` with a column per run and a group of rows per section.

    The best value of a row is bold. Every text is escaped, so that a run may have any name.
    """
    head = " & ".join(["", *map(escaped, names)])
    lines = [_HEAD, f"\\begin{{longtable}}{{l{'r' * len(names)}}}", "\\toprule"]
    lines += [f"{head} \\\\", "\\midrule", "\\endhead", "\\bottomrule", "\\endfoot"]
    for place, section in enumerate(sections):
        lines += ["\\addlinespace"] if place else []
        lines += _section(section, len(names) + 1)
    return "\n".join([*lines, "\\end{longtable}", ""])


def escaped(text: str) -> str:
    """Return a text as LaTeX prints it; a power such as ``^2`` is raised."""
    shown = "".join(character if character.isprintable() else " " for character in text)
    return _UNSAFE.sub(lambda found: _raised(found[1]) if found[1] else _SPECIAL[found[0]], shown)


def _raised(digit: str) -> str:
    return f"\\textsuperscript{{{digit}}}"


def _section(section: Section, columns: int) -> Iterator[str]:
    """Yield the lines of a section; its title goes over all columns."""
    yield f"\\multicolumn{{{columns}}}{{l}}{{\\emph{{{escaped(section.title)}}}}} \\\\"
    for row in section.rows:
        yield " & ".join([_label(row), *_cells(row, columns - 1)]) + " \\\\"


def _label(row: Row) -> str:
    """Return the label of a row, indented as in the plain table.

    The end of the row above would take a bracket or a star that follows for an option of its own.
    """
    text = escaped(row.label.strip())
    if row.label.startswith(_INDENT):
        return f"\\quad {text}"
    return f"{{}}{text}" if text.startswith(("[", "*")) else text


def _cells(row: Row, count: int) -> Iterator[str]:
    """Yield the cells of a row, empty ones for a subheading."""
    for place in range(count):
        text = row.cells[place] if place < len(row.cells) else ""
        yield _cell(text, best=place in row.better)


def _cell(text: str, *, best: bool) -> str:
    """Return a cell; a number is typeset as mathematics, for its sign and its power of ten."""
    found = _NUMBER.fullmatch(text)
    if not found:
        return f"\\textbf{{{escaped(text)}}}" if best else escaped(text)
    exponent = f" \\times 10^{{{int(found[2])}}}" if found[2] else ""
    value = found[1] + exponent
    return f"$\\mathbf{{{value}}}$" if best else f"${value}$"
