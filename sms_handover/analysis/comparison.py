"""Comparison of several runs, with the paper's claims where they are a pair of NMPC and PID."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from sms_handover.analysis.base_motion import BaseMotion
from sms_handover.analysis.claims import Claim, judge
from sms_handover.analysis.clearance import TaskTexts
from sms_handover.analysis.metrics import RunMetrics, common_settling, measure
from sms_handover.bag.run.loop_record import LoopRecord
from sms_handover.errors import UnknownNameError
from sms_handover.run_data import RunData

NMPC = "nmpc"
PID = "pid"


@dataclass(frozen=True, eq=False)
class Comparison:
    """The metrics of every run by name; the drift of the base per run and phase; the claims.

    ``phase_names`` has every phase of any run. The drift of a phase is taken over the same window for
    all runs, which begins when the slowest of those that settle has settled. ``claims`` is empty unless
    exactly one run is under NMPC and one under PID.
    """

    runs: Mapping[str, RunMetrics]
    phase_names: tuple[str, ...]
    drift: Mapping[str, Mapping[str, BaseMotion]]
    claims: tuple[Claim, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "runs", MappingProxyType(dict(self.runs)))
        drift = {name: MappingProxyType(dict(phases)) for name, phases in self.drift.items()}
        object.__setattr__(self, "drift", MappingProxyType(drift))


def compare(
    runs: Mapping[str, RunData],
    laws: Mapping[str, str] | None = None,
    loops: Mapping[str, LoopRecord] | None = None,
    texts: Mapping[str, TaskTexts] | None = None,
) -> Comparison:
    """Return the comparison of runs by name.

    ``laws`` has the control law of each run; without it a run whose name contains the word ``nmpc`` or
    ``pid`` is taken to be under that law. ``loops`` has the wall-clock records of runs, and
    ``texts`` what each was made with, by which clearance and joint limits are judged. Raises UnknownNameError
    for a law, a record or texts of an unknown run.
    """
    for given, what in ((laws, "control laws"), (loops, "loops"), (texts, "texts")):
        for name in given or {}:
            if name not in runs:
                raise UnknownNameError("run", name, runs, what)
    metrics = {
        name: measure(run, (loops or {}).get(name), (texts or {}).get(name)) for name, run in runs.items()
    }
    names = tuple(dict.fromkeys(item.phase.name for run in metrics.values() for item in run.phases))
    begins = {name: common_settling(metrics.values(), name) for name in names}
    drift = {
        run: {name: item.drift(name, begin) for name, begin in begins.items()}
        for run, item in metrics.items()
    }
    law_of = {name: (laws or {}).get(name, _law_in(name)) for name in runs}
    pair = [[item for name, item in metrics.items() if law_of[name] == law] for law in (NMPC, PID)]
    claims = judge(pair[0][0], pair[1][0]) if all(len(found) == 1 for found in pair) else ()
    return Comparison(metrics, names, drift, claims)


def _law_in(name: str) -> str:
    """Return the control law in a run's name, '' if there is none or both are."""
    words = set(re.split(r"[^a-z0-9]+", name.casefold())) & {NMPC, PID}
    return words.pop() if len(words) == 1 else ""
