"""What README.md and docs/*.md show: fenced blocks, the commands in them, commands in the text, links."""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from .workspace import ROOT

DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
SHELL = ("sh", "bash", "shell", "console")

_FENCE = re.compile(r"^```(\w*|\{\w+\}[^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
_HEADING = re.compile(r"^#+ +(.*)$", re.MULTILINE)
_INLINE = re.compile(r"`([^`]+)`")
_SEPARATORS = {"&&", "||", ";", "|", "&", "(", ")"}
_ASSIGNMENT = re.compile(r"\w+=.*")
_PREFIXES = {"time", "nice"}


@dataclass(frozen=True)
class Block:
    """One fenced block: where it is, its language and its text."""

    place: str
    language: str
    text: str


def blocks(path: Path) -> Iterator[Block]:
    """Yield the fenced blocks of a document."""
    text = path.read_text(encoding="utf-8")
    for found in _FENCE.finditer(text):
        line = text.count("\n", 0, found.start()) + 1
        yield Block(f"{path.name}:{line}", found[1], found[2])


def inline_code(path: Path) -> list[str]:
    """Return what stands between backticks in the text of a document."""
    text = _FENCE.sub("", path.read_text(encoding="utf-8"))
    return [" ".join(code.split()) for code in _INLINE.findall(text)]


def links(path: Path) -> list[str]:
    """Return where the links of a document lead that stay within the repository."""
    found = _LINK.findall(_INLINE.sub("code", _FENCE.sub("", path.read_text(encoding="utf-8"))))
    return [link for link in found if not re.match(r"\w+:", link)]


def anchors(path: Path) -> set[str]:
    """Return the anchors that GitHub gives the headings of a document."""
    headings = _HEADING.findall(_FENCE.sub("", path.read_text(encoding="utf-8")))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def commands(script: str) -> Iterator[list[str]]:
    """Yield the simple commands of a script as words, without comments, assignments and redirections."""
    for line in script.replace("\\\n", " ").splitlines():
        lexer = shlex.shlex(line.removeprefix("$ "), posix=True, punctuation_chars=True)
        lexer.whitespace_split = True
        words: list[str] = []
        for token in [*lexer, ";"]:
            if token in _SEPARATORS:
                command = _without_prefix(words)
                if command:
                    yield command
                words = []
            else:
                words.append(token)


def _without_prefix(words: list[str]) -> list[str]:
    """Return a command without what stands before the program, and without redirections."""
    while words and (words[0] in _PREFIXES or _ASSIGNMENT.fullmatch(words[0])):
        words = words[1:]
    for redirection in (">", ">>", "<"):
        if redirection in words:
            words = words[: words.index(redirection)]
    return words
