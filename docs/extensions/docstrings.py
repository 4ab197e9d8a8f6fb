"""Docstrings and signatures as they are meant.

Docstrings are plain text: a bar in them is an absolute value, not a substitution of reStructuredText. The
type of an array has a short name in the code, which a signature should have too.
"""

import re

from sphinx.application import Sphinx

_ARRAY = "~numpy.ndarray[tuple[~typing.Any, ...], ~numpy.dtype[~numpy.float64]]"
_BAR_OR_LITERAL = re.compile(r"(``.*?``)|\|")


def without_substitutions(line: str) -> str:
    """Return a line with its bars escaped, but those in literals."""
    return _BAR_OR_LITERAL.sub(lambda found: found[1] or r"\|", line)


def _process(app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Change the lines of one docstring in place."""
    lines[:] = map(without_substitutions, lines)


def _shorten(
    app: Sphinx,
    what: str,
    name: str,
    thing: object,
    options: object,
    signature: str | None,
    returned: str | None,
) -> tuple[str | None, str | None]:
    """Return a signature with Array for the type that this stands for."""
    return signature and signature.replace(_ARRAY, "Array"), returned and returned.replace(_ARRAY, "Array")


def setup(app: Sphinx) -> dict[str, bool]:
    """Take every docstring and every signature."""
    app.connect("autodoc-process-docstring", _process)
    app.connect("autodoc-process-signature", _shorten)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
