"""Results of a benchmark: tables under a question, on the screen, as JSON and as Markdown."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "bench"
DIAGRAMS = ROOT / "docs" / "images"


@dataclass(frozen=True)
class Table:
    """Rows of text below a heading; units stand in the heading."""

    heading: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""

    def __post_init__(self) -> None:
        """Raise ValueError where a row has more or fewer cells than the heading."""
        for row in self.rows:
            if len(row) != len(self.heading):
                raise ValueError(f"{len(self.heading)} columns, but a row has {len(row)}: {row}")

    def markdown(self) -> str:
        """Return the table in Markdown, its caption above it."""
        lines = [self.heading, ["---"] * len(self.heading), *self.rows]
        cells = "\n".join("| " + " | ".join(x.replace("|", "\\|") for x in line) + " |" for line in lines)
        return f"{self.caption}\n\n{cells}" if self.caption else cells

    def text(self) -> str:
        """Return the table with aligned columns, its caption above it."""
        lines = [self.heading, *self.rows]
        widths = [max(len(line[column]) for line in lines) for column in range(len(self.heading))]
        body = [
            "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
            for line in lines
        ]
        body.insert(1, "-" * max(map(len, body)))
        return "\n".join(([self.caption, ""] if self.caption else []) + body)


@dataclass(frozen=True)
class Result:
    """The answer of one script.

    ``name`` is the script's module name, ``values`` are the figures themselves for other programs,
    ``diagrams`` the files below docs/images that show them, ``notes`` what a reader must know.
    """

    name: str
    question: str
    tables: Sequence[Table]
    notes: Sequence[str] = ()
    diagrams: Sequence[str] = ()
    values: Mapping[str, object] = field(default_factory=dict)

    def markdown(self) -> str:
        """Return the section of this script in docs/performance.md."""
        parts = [f"## {self.question}", f"`python -m benchmarks.{self.name}`", *self.notes]
        parts += [table.markdown() for table in self.tables]
        parts += [f"![{self.question}](images/{name})" for name in self.diagrams]
        return "\n\n".join(parts)


def publish(result: Result, folder: Path = FOLDER) -> None:
    """Print a result and write it to ``folder`` as JSON."""
    print(f"\n{result.question}\n", *result.notes, sep="\n")
    for table in result.tables:
        print(f"\n{table.text()}")
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{result.name}.json"
    path.write_text(json.dumps(asdict(result), indent=2) + "\n", encoding="utf-8")


def load(path: Path) -> Result:
    """Return the result that :func:`publish` wrote."""
    fields = json.loads(path.read_text(encoding="utf-8"))
    return Result(**{**fields, "tables": [Table(**table) for table in fields["tables"]]})


def number(value: float, digits: int = 3) -> str:
    """Return a figure with ``digits`` significant digits, without an exponent where it reads well."""
    if 1e-3 <= abs(value) < 1e6:
        decimals = max(0, digits - 1 - int(f"{value:e}".partition("e")[2]))
        return f"{value:.{decimals}f}"
    return "0" if value == 0 else f"{value:.{digits - 1}e}"


def row(*cells: str | float | int) -> tuple[str, ...]:
    """Return the cells of a row: text as it is, numbers with three digits."""
    return tuple(cell if isinstance(cell, str) else number(float(cell)) for cell in cells)


def bullets(lines: Iterable[str]) -> str:
    """Return lines as a Markdown list."""
    return "\n".join(f"- {line}" for line in lines)
