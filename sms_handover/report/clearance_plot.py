"""Plot of clearance over time: the least distance between the groups of bodies that come nearest."""

from collections.abc import Sequence

from sms_handover.analysis.clearance import RunClearance
from sms_handover.analysis.clearance_series import ClearanceSeries
from sms_handover.report.plots import Level, Line, Plot, PlotGroup, cuts_of, thin
from sms_handover.run_data import RunData
from sms_handover.units import MM_PER_M, NS_PER_S

MOST_GROUPS = 5  # [-] lines of each run
CEILING = 200.0  # [mm] of the axis: what is farther apart needs no attention


def clearance_plots(runs: Sequence[RunData], found: Sequence[RunClearance | None]) -> PlotGroup:
    """Return the plot of the groups with the least margin in any run; ``found`` is None if it is unknown."""
    series = [item.series if item else None for item in found]
    names = _worst_groups([item for item in series if item])
    lines = []
    for place, (run, item) in enumerate(zip(runs, series, strict=True)):
        if item is None:
            continue
        time, cuts = item.stamp_ns / NS_PER_S, cuts_of(run)
        for group in item.groups:
            if group.name in names:
                kept, distance = thin(time, MM_PER_M * group.distance, cuts)
                lines.append(Line(place, names.index(group.name), kept, distance))
    return PlotGroup(
        "Clearance",
        "Least signed distance between bodies, each reference period, of the groups that come nearest. Below "
        "zero bodies are in each other; the lower line is what is allowed to a gripper and the deputy where "
        f"contact is declared. The axis ends at {CEILING:g} mm.",
        (
            Plot(
                "clearance",
                "Least signed distance",
                "mm",
                tuple(names),
                tuple(lines),
                magnitude=False,
                levels=_levels([item for item in series if item]),
                ceiling=CEILING,
            ),
        ),
    )


def _worst_groups(series: Sequence[ClearanceSeries]) -> list[str]:
    """Return the names of the groups with the least margin of any run, the worst first."""
    margins: dict[str, float] = {}
    for group in (group for item in series for group in item.groups):
        margins[group.name] = min(group.margin, margins.get(group.name, group.margin))
    return sorted(margins, key=margins.__getitem__)[:MOST_GROUPS]


def _levels(series: Sequence[ClearanceSeries]) -> tuple[Level, ...]:
    """Return the lines that distances should stay above: zero, and the depth of a declared contact."""
    depths = sorted({item.allowed * MM_PER_M for item in series if item.allowed}, reverse=True)
    return (Level(0.0, "contact"), *(Level(depth, f"{depth:g} mm, declared contact") for depth in depths))
