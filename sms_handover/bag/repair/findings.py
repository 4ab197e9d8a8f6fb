"""What a look at a bag has found, in words."""

from dataclasses import dataclass
from enum import Enum
from pathlib import Path


class Severity(Enum):
    """What a finding says about the bag."""

    DAMAGED = "damaged"  # bytes are not as they were written, or parts contradict each other
    MISSING = "missing"  # something that was to be recorded is not there
    NOTE = "note"  # worth knowing, and no fault of the bag


@dataclass(frozen=True)
class Finding:
    """One thing found, as a sentence."""

    severity: Severity
    text: str


@dataclass(frozen=True)
class CheckResult:
    """All that was found in the bag at ``path``; ``counts`` are the messages by topic."""

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
        """Whether something is damaged, so that a recovery may help."""
        return any(finding.severity is Severity.DAMAGED for finding in self.findings)


class Findings:
    """Collects findings."""

    def __init__(self) -> None:
        self._found: list[Finding] = []

    def damaged(self, text: str) -> None:
        """Add that something is not as it was written."""
        self._found.append(Finding(Severity.DAMAGED, text))

    def missing(self, text: str) -> None:
        """Add that something is not there."""
        self._found.append(Finding(Severity.MISSING, text))

    def note(self, text: str) -> None:
        """Add something worth knowing."""
        self._found.append(Finding(Severity.NOTE, text))

    @property
    def all(self) -> tuple[Finding, ...]:
        """Return what was found, the worst first."""
        order = list(Severity)
        return tuple(sorted(self._found, key=lambda finding: order.index(finding.severity)))
