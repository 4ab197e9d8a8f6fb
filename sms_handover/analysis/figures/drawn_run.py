"""Drawn run: the data of a run that figures need."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from sms_handover.analysis.phases import PhaseSpan, phase_spans
from sms_handover.analysis.signals import Signal, signals_of
from sms_handover.run_data import RunData
from sms_handover.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class DrawnRun:
    """A run under the name for the legend.

    ``scene`` has the shapes; without it there are no snapshots of the run.
    """

    name: str
    data: RunData
    scene: Scene | None = None
    signals: Mapping[str, Signal] = field(init=False)
    phases: tuple[PhaseSpan, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "signals", MappingProxyType(signals_of(self.data)))
        object.__setattr__(self, "phases", phase_spans(self.data))
