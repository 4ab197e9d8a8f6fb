"""Findings of a check, in words."""

from dataclasses import dataclass
from enum import Enum
from pathlib import Path


class Severity(Enum):
    """Kind of a finding."""

    DAMAGED = "damaged"  # bytes are not as they were written, or parts contradict each other
    MISSING = "missing"  # something recorded or published is not there
    NOTE = "note"  # no fault of the bag


@dataclass(frozen=True)
class Finding:
    """One finding, as a sentence."""

    severity: Severity
    text: str


@dataclass(frozen=True)
class CheckResult:
    """The findings in the bag at ``path``; ``counts`` are the messages by topic."""

    path: Path
    files: tuple[Path, ...]
    counts: dict[str, int]
    is_ours: bool
    findings: tuple[Finding, ...]

    @property
    def complete(self) -> bool:
        """Whether nothing is damaged or missing."""
        return all(finding.severity is Severity.NOTE for finding in self.findings)

    @property
    def damaged(self) -> bool:
        """Whether something is damaged, so that ``recover`` helps."""
        return any(finding.severity is Severity.DAMAGED for finding in self.findings)


class Findings:
    """Collects findings."""

    def __init__(self) -> None:
        self._found: list[Finding] = []

    def damaged(self, text: str) -> None:
        """Add a finding of damage."""
        self._found.append(Finding(Severity.DAMAGED, text))

    def missing(self, text: str) -> None:
        """Add a finding that something is missing."""
        self._found.append(Finding(Severity.MISSING, text))

    def note(self, text: str) -> None:
        """Add a note."""
        self._found.append(Finding(Severity.NOTE, text))

    @property
    def all(self) -> tuple[Finding, ...]:
        """Return the findings, the worst first."""
        order = list(Severity)
        return tuple(sorted(self._found, key=lambda finding: order.index(finding.severity)))
