"""Sensed plant: a plant with sensors, which measure as it is advanced and change nothing of it."""

from dataclasses import dataclass, replace

from sms_handover.conditions.sensors.sensor import Truth
from sms_handover.conditions.sensors.suite import Measured, SensorsState, SensorSuite
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.dynamics import MakeDynamics
from sms_handover.plant.effects import PlantEffects
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.plant.parameters import PlantParameters
from sms_handover.plant.plant_state import InitialState, PlantState
from sms_handover.types import Array, Pose, RobotState


@dataclass(frozen=True, eq=False)
class KnownState:
    """Robot and deputy at an instant as they are known; the efforts are those that acted."""

    state: RobotState
    deputy_in_world: Pose


class SensedPlant(FreeFloatingPlant):
    """A plant whose sensors measure the state of every tick; ``measured`` is what they make known of it."""

    measured: Measured

    def __init__(
        self,
        robot: RobotModel,
        parameters: PlantParameters,
        initial: InitialState,
        tick_ns: int,
        sensors: SensorSuite,
        make_dynamics: MakeDynamics | None = None,
        effects: PlantEffects | None = None,
    ) -> None:
        """Place robot and deputy; raises ConfigurationError on a joint outside its limits."""
        self.sensors, self.tick_ns = sensors, tick_ns
        super().__init__(robot, parameters, initial, tick_ns, make_dynamics, effects)

    def reset(self) -> None:
        """Go back to the initial state at time zero."""
        super().reset()
        self.sensors.reset()
        self._measure()

    def seed(self, seed: int) -> None:
        """Let every random stream of the conditions follow from a seed, from the start of a run on."""
        super().seed(seed)
        self.sensors.seed(seed)

    def snapshot(self) -> PlantState:
        """Return the state to :meth:`restore`."""
        return replace(super().snapshot(), sensors=self.sensors.state(self.measured))

    def restore(self, state: PlantState) -> None:
        """Go back to a former state; raises ConfigurationError if it is that of another robot or sensors."""
        super().restore(state)
        self.measured = self.sensors.restore(state.sensors or SensorsState())

    def apply(self, asked: Array) -> None:
        """Integrate one tick under read-only efforts (n,), and measure the state that it leads to."""
        super().apply(asked)
        self._measure()

    def _measure(self) -> None:
        """Let the sensors measure the present state."""
        truth = Truth(self.tick, self.q, self.v, lambda: self.deputy.deputy_in_world)
        self.measured = self.sensors.measure(truth)


def known_of(plant: SensedPlant) -> KnownState:
    """Return what is known at the present instant; a deputy that no sensor sees is known as it is."""
    now, truth = plant.measured, plant.state
    state = RobotState(truth.stamp_ns, now.q, now.v, truth.joint_effort)
    return KnownState(state, now.deputy_in_world or plant.deputy.deputy_in_world)
