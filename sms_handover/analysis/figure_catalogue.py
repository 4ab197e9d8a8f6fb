"""Catalogue of the figures, which needs no matplotlib, so that ``--help`` can list them."""

from collections.abc import Sequence
from dataclasses import dataclass

from sms_handover.errors import UnknownNameError

FORMATS = ("pdf", "png", "svg")


@dataclass(frozen=True)
class FigureKind:
    """One kind of figure; ``paper`` has the numbers of the corresponding figures of the paper, or ''."""

    name: str
    text: str
    paper: str = ""


FIGURES = (
    FigureKind("tool_error", "position and orientation error of each tool", "4, 5"),
    FigureKind("base", "position and attitude of the base", "6"),
    FigureKind("joint_error", "error of each joint, per arm", "7, 8"),
    FigureKind("torque", "torque of each joint, per arm", "9, 10"),
    FigureKind("momentum", "change of momenta and energy balance, which must stay zero"),
    FigureKind("base_path", "path of the base in space"),
    FigureKind("snapshots", "the handover in pictures, per run", "3"),
)


def chosen_figures(names: Sequence[str] = ()) -> tuple[FigureKind, ...]:
    """Return the kinds with these names, each once, or all if none is given; raises UnknownNameError."""
    known = {kind.name: kind for kind in FIGURES}
    for name in names:
        if name not in known:
            raise UnknownNameError("figure", name, known)
    return tuple(kind for kind in FIGURES if kind.name in names) if names else FIGURES


def chosen_formats(names: Sequence[str]) -> tuple[str, ...]:
    """Return the formats with these names, each once; raises UnknownNameError."""
    for name in names:
        if name not in FORMATS:
            raise UnknownNameError("figure format", name, FORMATS)
    return tuple(dict.fromkeys(names))
