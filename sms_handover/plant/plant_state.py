"""Plant state: where a run starts, and all that its later motion depends on."""

from collections.abc import Mapping
from dataclasses import dataclass

import pinocchio as pin

from sms_handover.conditions.sensors.suite import SensorsState
from sms_handover.plant.deputy import DeputyMotion
from sms_handover.plant.effects import EffectsState
from sms_handover.plant.joint_limits import Excess
from sms_handover.types import Array, Pose, Twist


@dataclass(frozen=True, eq=False)
class InitialState:
    """Where a run starts: base pose in ``world`` and joint angles (n,) rad, at rest, and the deputy.

    The deputy floats with a twist of its origin in ``world`` axes; its inertia is in its own axes, None if
    it has no mass.
    """

    base_in_world: Pose
    joint_position: Array
    deputy_in_world: Pose
    deputy_grasp_frames: Mapping[str, Pose]
    deputy_twist_in_world: Twist | None = None
    deputy_inertia: pin.Inertia | None = None


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
