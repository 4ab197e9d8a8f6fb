"""Applied values: what acts in a plant, read back from the objects that it computes with."""

import json
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from sms_handover.conditions.constant_wrench import ConstantWrench
from sms_handover.conditions.orbit import GravityGradient, Orbit, RelativeOrbit
from sms_handover.conditions.sensors.suite import SensorSuite
from sms_handover.conditions.thruster_misfire import ThrusterMisfire
from sms_handover.conditions.wrench import WrenchModel
from sms_handover.conditions.wrench_history import WrenchHistory
from sms_handover.configuration.conditions_fields import ON_BASE, ON_DEPUTY, SENSORS
from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.plant.effects import PlantEffects
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.plant.sensed_plant import SensedPlant

_KINDS: Mapping[type, str] = MappingProxyType(
    {
        ConstantWrench: "constant",
        ThrusterMisfire: "thruster_misfire",
        WrenchHistory: "history",
        GravityGradient: "gravity_gradient",
        RelativeOrbit: "relative_orbit",
    }
)


def applied_text(plant: FreeFloatingPlant, unread: SensorSuite | None = None) -> str:
    """Return the applied values as JSON, with every bit of their numbers: the conditions and ``robot``.

    ``robot`` has ``mass`` kg, ``com`` m and ``inertia`` kg m^2 about that (xx, xy, xz, yy, yz, zz) of every
    body by the joint that moves it, in its own axes, and the inertia of rotors kg m^2 by joint: with the
    errors of the model, panels locked, and without what a hand holds.
    """
    return json.dumps({"robot": _of_robot(plant.robot), **applied_conditions(plant, unread)})


def applied_conditions(plant: FreeFloatingPlant, unread: SensorSuite | None = None) -> dict[str, Any]:
    """Return what acts in a plant as plain data, by the names that files of conditions have.

    ``unread`` are the sensors of a run in which nothing goes by them, so that its plant is without.
    """
    found = _of_effects(plant.effects) if plant.effects else {}
    sensors = plant.sensors if isinstance(plant, SensedPlant) else unread
    if sensors:
        found[SENSORS] = {name: _plain(values) for name, values in sensors.applied.items()}
    return found


def _of_effects(effects: PlantEffects) -> dict[str, Any]:
    """Return joint effects and wrenches."""
    found: dict[str, Any] = {}
    resistance, motor, path = effects.resistance, effects.motor, effects.path
    if resistance.friction:
        found["friction"] = _plain(vars(resistance.friction.values))
    if motor:
        found["torque"] = _plain(motor.applied)
    if path:
        found["command"] = {"delay": effects.delay_s, "dropped": path.dropped}
    wrenches = {
        name: {"acts_on": body, _KINDS[type(model)]: _of_wrench(model)}
        for body, names, models in (
            (ON_BASE, effects.names[0], resistance.wrenches),
            (ON_DEPUTY, effects.names[1], resistance.deputy_wrenches),
        )
        for name, model in zip(names, models, strict=True)
    }
    if wrenches:
        found["wrenches"] = wrenches
    return found


def _of_wrench(model: WrenchModel) -> dict[str, Any]:
    """Return the values of a wrench; those of an orbit stand among them."""
    values: dict[str, Any] = {}
    for name, value in vars(model).items():
        values |= vars(value) if isinstance(value, Orbit) else {name: value}
    return _plain(values)


def _of_robot(robot: RobotModel) -> dict[str, Any]:
    """Return the inertial parameters of a robot."""
    names, armature = list(robot.pin.names), robot.pin.armature[BASE_NV:].tolist()
    bodies = {
        name: {"mass": body.mass, "com": body.lever.tolist(), "inertia": _six(body.inertia)}
        for name, body in zip(names[1:], robot.pin.inertias.tolist()[1:], strict=True)
    }
    return {"bodies": bodies, "rotor_inertia": dict(zip(robot.joint_names, armature, strict=True))}


def _six(moments: np.ndarray) -> list[float]:
    """Return the moments (3, 3) as six numbers."""
    return [float(moments[at]) for at in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))]


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with lists in place of arrays."""
    return {name: v.tolist() if isinstance(v, np.ndarray) else v for name, v in values.items()}
