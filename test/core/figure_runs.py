"""Short simulated handovers and what is drawn of them; used by the tests of figures."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text

from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.run_data import RunData
from sms_handover.types import Array

from .test_analysis_runs import changed


def lines_of(figure: Figure) -> dict[str, Array]:
    """Return the data (2 or 3, N) of every line that shows a run, by its identity in the figure."""
    found: dict[str, Array] = {}
    for line in figure.findobj(Line2D):
        assert isinstance(line, Line2D)
        identity = line.get_gid()
        if identity:
            data: Any = getattr(line, "get_data_3d", line.get_data)()
            assert identity not in found
            found[identity] = np.array(data, dtype=np.float64)
    return found


def texts_of(figure: Figure) -> list[str]:
    """Return every text that is to be read."""
    found = figure.findobj(Text)
    return [item.get_text() for item in found if isinstance(item, Text) and item.get_visible()]


def blank(run: RunData, *names: str) -> RunData:
    """Return a run in which these quantities were not recorded."""
    return changed(run, **{name: np.full(getattr(run, name).shape, np.nan) for name in names})


def named(runs: Sequence[RunData]) -> list[DrawnRun]:
    """Return the runs under the names run_1, run_2, ..."""
    return [DrawnRun(f"run_{number}", run) for number, run in enumerate(runs, 1)]
