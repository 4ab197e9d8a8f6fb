"""Style of every figure: sizes of a two-column paper, one font, and a palette for colour-blind readers."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
from matplotlib import style

COLUMN = 3.5  # [in] width of one column
PAGE = 7.16  # [in] width of both columns

# the palette of Okabe and Ito without yellow, which is too light for a line on white
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
# five patterns and seven colours have no common factor: 35 runs look different, five of them without colour
DASHES: tuple[Any, ...] = ("-", (0, (4, 1.5)), (0, (6, 1.5, 1, 1.5)), (0, (1, 1)), (0, (8, 2, 2, 2)))
MUTED = "#555555"  # what is not data: phase names, notes
FAINT = "#BBBBBB"  # lines that are not data

_STYLE: dict[str, Any] = {
    "font.family": "STIXGeneral",  # ships with matplotlib, so figures are the same on every machine
    "mathtext.fontset": "stix",
    "font.size": 8.0,  # [pt], all of these
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 8.0,
    "lines.linewidth": 0.9,
    "axes.linewidth": 0.5,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "grid.linewidth": 0.3,
    "xtick.major.pad": 5.0,  # so that the first numbers of both axes keep apart in the corner
    "ytick.major.pad": 4.5,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "legend.frameon": False,
    "axes.grid": True,
    "grid.color": "#DDDDDD",
    "axes.axisbelow": True,
    "axes.xmargin": 0.0,
    "axes.formatter.useoffset": False,
    "figure.constrained_layout.use": True,
    "pdf.fonttype": 42,  # TrueType, embedded: journals refuse Type 3
    "svg.fonttype": "path",
    "svg.hashsalt": "sms_handover",  # without it the identifiers in an SVG differ each time
    "savefig.dpi": 300,
}


@contextmanager
def figure_style() -> Iterator[None]:
    """Apply this style, whatever the user's settings are, and restore them afterwards."""
    with matplotlib.rc_context(), style.context(["default", _STYLE]):
        yield


def line_style(place: int) -> dict[str, Any]:
    """Return colour and dashes of a run by its index: the first is solid, the second dashed."""
    return {"color": COLOURS[place % len(COLOURS)], "linestyle": DASHES[place % len(DASHES)]}
