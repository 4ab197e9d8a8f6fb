"""Plan of a campaign before it runs: its draws, their ranges, and what it takes by its first case."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

from sms_handover.analysis.layout import Row, Section, layout
from sms_handover.campaign.cases.case import CaseResult, Cases
from sms_handover.campaign.cases.case_row import Row as CaseRow
from sms_handover.campaign.cases.case_row import Status, Task
from sms_handover.campaign.cases.first_cases import require_runnable
from sms_handover.campaign.cases.retained import trajectory
from sms_handover.campaign.definition.campaign_file import Campaign, Keep
from sms_handover.campaign.definition.distributions import range_in_words
from sms_handover.campaign.definition.fields import ALL, BAG, NONE, SOBOL
from sms_handover.campaign.definition.frozen import freeze
from sms_handover.errors import ConfigurationError
from sms_handover.run_data import RunData
from sms_handover.simulation.save import write_arrays

_S_PER_H = 3600.0  # [s/h]
_MB = 1e6  # [byte]
_BAG, _BAG_TICK = 133_000, 680  # [byte] of a bag without a tick, and of each of two arms with seven joints


@dataclass
class _Cost:
    """What one case takes under all laws in all scenarios: CPU seconds, and bytes of what is kept of it."""

    cpu: float = 0.0
    row: int = 0
    trajectory: int = 0
    whole: int = 0

    def add(self, result: CaseResult, keep: Keep) -> None:
        """Count a run."""
        self.cpu += result.beside.cpu
        self.row += len(result.row.text)
        if result.run is not None:
            self.trajectory += len(trajectory(result.run)) if keep.trajectories != NONE else 0
            self.whole += _size(result.run, keep) if keep.worst else 0

    def in_words(self, cases: int, keep: Keep) -> str:
        """Return what so many cases take."""
        kept = min(keep.worst, cases)
        said = [
            f"CPU time about {(cases + kept) * self.cpu / _S_PER_H:.3g} h, by the first case",
            f"journal about {cases * self.row / _MB:.3g} MB",
        ]
        if self.trajectory:
            at_most = "" if keep.trajectories == ALL else ", if all fail"
            said.append(f"trajectories {cases * self.trajectory / _MB:.3g} MB{at_most}")
        if self.whole:
            said.append(f"worst {kept} of each law as {keep.worst_as} {kept * self.whole / _MB:.3g} MB")
        return "; ".join(said)


def _size(run: RunData, keep: Keep) -> int:
    """Return the bytes that a whole run takes as it is to be kept."""
    if keep.worst_as == BAG:
        return _BAG + _BAG_TICK * len(run.tick_ns)
    stream = BytesIO()
    write_arrays(run, stream)
    return len(stream.getvalue())


def plan_in_words(path: Path) -> str:
    """Return draws, ranges, and the CPU time and disk that a campaign takes, as text.

    The first case of each scenario runs under each law. Raises ConfigurationError where the campaign cannot
    be run: a value that no scenario has, or that cannot be read back, an unknown metric.
    """
    frozen, number = freeze(path)
    require_runnable(frozen, number, path)
    cost, broken = _Cost(), list[str]()
    with tempfile.TemporaryDirectory(prefix="sms_handover_check_") as folder:
        cases = Cases(frozen, number, Path(folder))
        campaign, count = cases.campaign, cases.samples.count
        for scenario in campaign.scenarios:
            for law in campaign.laws:
                result = cases.run(Task(0, scenario, law))
                _require_run(result.row, path)
                if result.row.status is Status.NUMERIC_FAILURE:
                    broken.append(f"{result.row.task} is a numeric failure: {result.row.cause}")
                cost.add(result, campaign.keep)
    runs = count * campaign.runs_per_case
    table = Section("Drawn value", tuple(_draws(campaign)))
    lines = [
        *layout(("distribution", "from 0.1 % to 99.9 %"), [table])[1:],
        "",
        f"{count} cases x {len(campaign.scenarios)} scenarios x {len(campaign.laws)} laws = {runs} runs",
        cost.in_words(count, campaign.keep),
        *broken,
    ]
    if campaign.sampler.kind == SOBOL and count & (count - 1):
        less = 1 << count.bit_length() - 1
        lines.append(f"sobol spreads powers of two evenly: take {less} or {2 * less} cases")
    return "\n".join(lines)


def _draws(campaign: Campaign) -> Iterator[Row]:
    """Yield each drawn value with its distribution and range."""
    for path, one in campaign.draws.items():
        yield Row(path, (str(one), range_in_words(one)))
    for group in campaign.groups:
        for path, normal in group.normals.items():
            yield Row(path, (f"{normal}, correlated", range_in_words(normal)))
    if campaign.sampler.rows:
        for path in campaign.paths:
            numbers = [row[path] for row in campaign.sampler.rows]
            span = [value for value in numbers if isinstance(value, int | float)]
            yield Row(path, ("of a table", f"{min(span):.6g} to {max(span):.6g}" if span else "texts"))


def _require_run(row: CaseRow, path: Path) -> None:
    """Raise ConfigurationError if the first case could not be run, or not to its end."""
    if row.status in (Status.REJECTED, Status.ERROR, Status.LIMIT):
        raise ConfigurationError(f"{path}: {row.task}: {row.cause}")
