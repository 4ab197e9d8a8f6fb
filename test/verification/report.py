"""Render docs/verification.md from what the verification tests measured and what the breaks showed.

Run by ``make verify``; nothing in the report is written by hand. It is a script of its own, so that
the report can be rendered again without measuring again.
"""

import ast
import json
import platform
import sys
from argparse import ArgumentParser
from collections.abc import Iterable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("numpy", "pin", "casadi", "mujoco", "mink", "pytest")
TARGET = ROOT / "docs" / "verification.md"

Entry = Mapping[str, Any]

_INTRODUCTION = """\
# Verification

What the simulator was measured against, with the bound beside each figure. This file is written by
`make verify` from what it measures; nothing in it is written by hand. A figure keeps its bound if it is
not above it. Every row names its test: `pytest test/verification test/core -k <name>` repeats it.
[equations.md](equations.md) tells where the paper's printed equations differ from what holds."""

_BREAKS = """\
The package is copied and broken in one place; then the fast tests run until one fails, first those that
are likely to notice. A break that no test notices makes `make verify` fail."""


def report(
    entries: Sequence[Entry], tables: Mapping[str, str], breaks: Sequence[Entry], machine: Sequence[str]
) -> str:
    """Return the whole report as Markdown."""
    sections = list(dict.fromkeys([*(entry["section"] for entry in entries), *tables]))
    parts = [_INTRODUCTION, "\n".join(f"- {line}" for line in machine), _summary(sections, entries, breaks)]
    for section in sections:
        own = [entry for entry in entries if entry["section"] == section]
        parts.append(f"## {_title(section)}")
        parts += _prose(own)
        if own:
            parts.append(_rows(_HEADING, map(_evidence_row, own)))
        if section in tables:
            parts.append(tables[section].strip())
    parts += ["## Breaks on purpose", _BREAKS]
    parts.append(_rows(_BREAK_HEADING, map(_break_row, breaks)) if breaks else "Not run.")
    return "\n\n".join(parts) + "\n"


_HEADING = ("claim", "measured", "bound", "unit", "against", "test")
_BREAK_HEADING = ("law broken", "file", "instead of", "it reads", "first test that fails")


def kept(entry: Entry) -> bool:
    """Whether a figure keeps its bound; NaN keeps none."""
    return bool(entry["value"] <= entry["bound"])


def _summary(sections: Sequence[str], entries: Sequence[Entry], breaks: Sequence[Entry]) -> str:
    """Return how many figures there are per section and how many bounds are missed."""
    rows = []
    for section in sections:
        own = [entry for entry in entries if entry["section"] == section]
        missed = sum(not kept(entry) for entry in own)
        rows.append((_title(section), str(len(own)), str(missed)))
    missed = sum(not kept(entry) for entry in entries)
    rows.append(("all", str(len(entries)), str(missed)))
    survived = sum(not item["test"] for item in breaks)
    rows.append(("breaks on purpose (missed: those that survived)", str(len(breaks)), str(survived)))
    return _rows(("section", "figures", "missed"), rows)


def _title(section: str) -> str:
    """Return the title of a section, without the full stop of a docstring."""
    return section.rstrip(".")


def _prose(entries: Sequence[Entry]) -> list[str]:
    """Return what the docstring of the section's test file says after its first line."""
    for entry in entries:
        path = ROOT / str(entry["test"]).partition("::")[0]
        text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        return [text.partition("\n")[2].strip()] if "\n" in text else []
    return []


def _evidence_row(entry: Entry) -> tuple[str, ...]:
    """Return the cells of one figure."""
    measured = number(entry["value"])
    test = str(entry["test"]).rpartition("/")[2].partition("[")[0].replace(".py", "")
    cells = (measured if kept(entry) else f"**{measured}, missed**", number(entry["bound"]), entry["unit"])
    return (entry["claim"], *cells, entry["against"], f"`{test}`")


def _break_row(item: Entry) -> tuple[str, ...]:
    """Return the cells of one break."""
    test = str(item["test"]).rpartition("/")[2]
    noticed = f"`{test}`" if test else "**none: it survived**"
    return (item["name"], f"`{item['file']}`", f"`{_line(item['old'])}`", f"`{_line(item['new'])}`", noticed)


def _line(text: str) -> str:
    """Return code as one line."""
    return " ".join(text.split())


def number(value: float) -> str:
    """Return a figure with three digits."""
    return "0" if value == 0 else f"{value:.3g}"


def _rows(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [heading, ["---"] * len(heading), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def machine() -> list[str]:
    """Return what the figures were measured on."""
    versions = ", ".join(f"{name} {_version(name)}" for name in PACKAGES)
    return [
        f"Machine: {_processor()}, {platform.system()} {platform.machine()}",
        f"Software: Python {platform.python_version()}, {versions}",
    ]


def _processor() -> str:
    """Return the name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{names[0]}, {len(names)} cores" if names else platform.processor() or "unknown processor"


def _version(name: str) -> str:
    """Return the version of a package."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"


def main() -> int:
    """Render the report; the exit code is 1 if a bound is missed or a break survived."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("evidence", type=Path, help="JSON that pytest test/verification --evidence wrote")
    parser.add_argument("--breaks", type=Path, help="JSON that mutations.py wrote")
    parser.add_argument("--output", type=Path, default=TARGET)
    options = parser.parse_args()
    found = json.loads(options.evidence.read_text(encoding="utf-8"))
    breaks = json.loads(options.breaks.read_text(encoding="utf-8")) if options.breaks else []
    options.output.write_text(report(found["evidence"], found["tables"], breaks, machine()), encoding="utf-8")
    missed = [entry["claim"] for entry in found["evidence"] if not kept(entry)]
    survived = [item["name"] for item in breaks if not item["test"]]
    print(f"{len(found['evidence'])} figures, {len(missed)} bounds missed", *missed, sep="\n  ")
    print(f"{len(breaks)} breaks, {len(survived)} survived", *survived, sep="\n  ")
    return 1 if missed or survived else 0


if __name__ == "__main__":
    sys.exit(main())
