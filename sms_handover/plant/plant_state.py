"""Plant state: all that a plant takes with it in a snapshot."""

from dataclasses import dataclass

from sms_handover.conditions.sensors.suite import SensorsState
from sms_handover.plant.deputy import DeputyMotion
from sms_handover.plant.effects import EffectsState
from sms_handover.plant.joint_limits import Excess
from sms_handover.types import Array


@dataclass(frozen=True, eq=False)
class PlantState:
    """Everything that the later motion of a plant, its counts and its events depend on."""

    tick: int
    q: Array
    v: Array
    joint_effort: Array
    work: float
    losses: float
    saturated_ticks: tuple[int, ...]
    excesses: tuple[Excess, ...]
    deputy: DeputyMotion
    effects: EffectsState | None
    sensors: SensorsState | None = None
