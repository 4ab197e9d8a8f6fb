"""Docstrings are plain text: a bar in them is an absolute value, not a substitution of reStructuredText."""

import re

from sphinx.application import Sphinx

_BAR_OR_LITERAL = re.compile(r"(``.*?``)|\|")


def without_substitutions(line: str) -> str:
    """Return a line with its bars escaped, but those in literals."""
    return _BAR_OR_LITERAL.sub(lambda found: found[1] or r"\|", line)


def _process(app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Change the lines of one docstring in place."""
    lines[:] = map(without_substitutions, lines)


def setup(app: Sphinx) -> dict[str, bool]:
    """Take every docstring."""
    app.connect("autodoc-process-docstring", _process)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
