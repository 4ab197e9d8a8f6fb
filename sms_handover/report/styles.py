"""Line styles of the runs: NMPC solid, PID dashed, and no two runs alike."""

from collections.abc import Sequence
from dataclasses import dataclass

from sms_handover.analysis.comparison import NMPC, PID

DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")  # plotly's names
COLOURS = 6  # number of them in report.css
_OF_LAW = {NMPC: 0, PID: 1}  # index of a law's dash


@dataclass(frozen=True)
class RunStyle:
    """The line style of a run: ``colour`` is an index from 0, ``dash`` one of plotly's names."""

    name: str
    law: str
    colour: int
    dash: str


def run_styles(names: Sequence[str], laws: Sequence[str]) -> tuple[RunStyle, ...]:
    """Return the line style of every run; the first under a law gets the dash of that law."""
    places: list[int | None] = [
        _OF_LAW.get(law) if law not in laws[:place] else None for place, law in enumerate(laws)
    ]
    free = [place for place in range(len(names) + len(_OF_LAW)) if place not in places]
    chosen = [free.pop(0) if place is None else place for place in places]
    return tuple(
        RunStyle(name, law, place % COLOURS, DASHES[(place + place // COLOURS) % len(DASHES)])
        for name, law, place in zip(names, laws, chosen, strict=True)
    )
