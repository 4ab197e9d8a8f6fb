"""Conditions of a run, read from their content and checked against the robot."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from sms_handover.conditions.constant_wrench import ConstantWrench
from sms_handover.conditions.joint_values import CommandErrors, FrictionValues, TorqueErrors
from sms_handover.conditions.model_error import BodySpread, ModelError, MountSpread
from sms_handover.conditions.orbit import GravityGradient, Orbit, RelativeOrbit
from sms_handover.conditions.per_joint import per_joint
from sms_handover.conditions.sensors.registry import sensors_of
from sms_handover.conditions.sensors.sensor import SensorValues
from sms_handover.conditions.thruster_misfire import ThrusterMisfire
from sms_handover.conditions.wrench import WrenchModel
from sms_handover.conditions.wrench_history import WrenchHistory
from sms_handover.configuration.checks import check_vector
from sms_handover.configuration.conditions_fields import (
    AXES,
    BODIES,
    CONDITIONS_FIELDS,
    ON_BASE,
    SENSORS,
    WORLD,
)
from sms_handover.configuration.sections import Section
from sms_handover.configuration.yaml_reader import Mapping as YamlMapping
from sms_handover.model.robot_model import RobotModel

_STRIBECK_SPEED = 0.01  # [rad/s] where none is given; without stiction it has no effect
_ROW = 7  # [-] time, force, torque
_ORIGIN = (0.0, 0.0, 0.0)  # [m]


@dataclass(frozen=True, eq=False)
class Conditions:
    """What is not ideal about a run in its plant; None or empty is ideal.

    ``wrenches`` act on the base, ``deputy_wrenches`` on the deputy, by name. The error of the model is part
    of the true robot already.
    """

    friction: FrictionValues | None = None
    torque: TorqueErrors | None = None
    command: CommandErrors | None = None
    wrenches: Mapping[str, WrenchModel] = field(default_factory=dict)
    deputy_wrenches: Mapping[str, WrenchModel] = field(default_factory=dict)
    sensors: Mapping[str, SensorValues] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("wrenches", "deputy_wrenches", "sensors"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    @property
    def acts(self) -> bool:
        """Whether something acts in the plant that an ideal one has not."""
        any_wrench = self.wrenches or self.deputy_wrenches
        return bool(self.friction or self.torque or self.command or any_wrench)

    @property
    def ideal(self) -> bool:
        """Whether the plant is an ideal one, of which nothing is measured."""
        return not (self.acts or self.sensors)


IDEAL = Conditions()


def conditions_of(content: YamlMapping, robot: RobotModel) -> Conditions:
    """Return the conditions that their content describes, for a robot.

    Raises ConfigurationError on a key or value that they cannot have, and where an effect needs the inertia
    of rotors that the robot has not.
    """
    root = Section(content, Path(), spec=CONDITIONS_FIELDS)
    on_base, on_deputy = (
        _wrenches(root.section("wrenches"), body) if "wrenches" in root else {} for body in BODIES
    )
    conditions = Conditions(
        _friction(root, robot.n_joints),
        _torque(root, robot.n_joints),
        _command(root),
        on_base,
        on_deputy,
        sensors_of(root.section(SENSORS), robot.n_joints) if SENSORS in root else {},
    )
    _require_rotors(root, conditions, robot)
    return IDEAL if conditions.ideal else conditions


def model_error_of(content: YamlMapping) -> ModelError | None:
    """Return how far a robot is from what is known of it, None if it is as known."""
    root = Section(content, Path(), spec=CONDITIONS_FIELDS)
    if "model_error" not in root:
        return None
    section = root.section("model_error")

    def body(key: str) -> BodySpread:
        return BodySpread(*_numbers(section, key, "mass", "com", "inertia"))

    error = ModelError(
        body("base"), body("links"), MountSpread(*_numbers(section, "mounts", "position", "angle"))
    )
    return error if error.any else None


def _numbers(section: Section, key: str, *names: str) -> tuple[float, ...]:
    """Return numbers in the section of a key, 0 for those that are not given."""
    inner = section.section(key) if key in section else None
    return tuple(inner.number(name, 0.0) if inner else 0.0 for name in names)


def _friction(root: Section, joints: int) -> FrictionValues | None:
    if "friction" not in root:
        return None
    section = root.section("friction")
    coulomb = per_joint(section, "coulomb", joints)
    stiction = per_joint(section, "stiction", joints) if "stiction" in section else coulomb
    speed = per_joint(section, "stribeck_speed", joints, _STRIBECK_SPEED)
    viscous = per_joint(section, "viscous", joints)
    with section.located():
        values = FrictionValues(viscous, coulomb, stiction, speed)
    return values if values.any else None


def _torque(root: Section, joints: int) -> TorqueErrors | None:
    if "torque" not in root:
        return None
    section = root.section("torque")
    names = ("gain", "offset", "step", "noise_density")
    errors = TorqueErrors(*(per_joint(section, name, joints) for name in names))
    return errors if errors.any else None


def _command(root: Section) -> CommandErrors | None:
    if "command" not in root:
        return None
    delay, dropped = _numbers(root, "command", "delay", "dropped")
    errors = CommandErrors(delay, dropped)
    return errors if errors.any else None


def _wrenches(section: Section, body: str) -> dict[str, WrenchModel]:
    """Return the wrenches on a body by name."""
    found = {}
    for name in section.keys:
        wrench = section.section(name)
        if (wrench.name("acts_on", "body", BODIES) if "acts_on" in wrench else ON_BASE) != body:
            continue
        kind = wrench.one_of(f"wrench {name!r}")
        inner = wrench.section(kind)
        with inner.located():
            found[name] = WRENCHES[kind](inner)
    return found


def _constant(section: Section) -> WrenchModel:
    point = section.vector("point", missing=_ORIGIN)
    force, torque = section.vector("force"), section.vector("torque")
    return ConstantWrench(np.array(force), np.array(torque), np.array(point), _axes(section))


def _axes(section: Section) -> str:
    return section.name("axes", "axes", AXES) if "axes" in section else WORLD


def _misfire(section: Section) -> WrenchModel:
    force, point = np.array(section.vector("force")), np.array(section.vector("point"))
    return ThrusterMisfire(force, point, section.number("start"), section.number("duration"))


def _history(section: Section) -> WrenchModel:
    rows: Any = section.value("rows")
    if not isinstance(rows, list) or not rows:
        raise section.error("rows must be a list of rows", "rows")
    checked = [check_vector(row, _ROW, f"row {index}") for index, row in enumerate(rows)]
    return WrenchHistory(np.array(checked), _axes(section))


def _orbit(section: Section) -> Orbit:
    return Orbit(
        section.number("radius"), np.array(section.vector("radial")), np.array(section.vector("normal"))
    )


def _relative_orbit(section: Section) -> WrenchModel:
    reference = section.vector("reference", missing=_ORIGIN)
    return RelativeOrbit(_orbit(section), np.array(reference))


WRENCHES: Mapping[str, Callable[[Section], WrenchModel]] = MappingProxyType(
    {
        "constant": _constant,
        "thruster_misfire": _misfire,
        "history": _history,
        "gravity_gradient": lambda section: GravityGradient(_orbit(section)),
        "relative_orbit": _relative_orbit,
    }
)


def _require_rotors(root: Section, conditions: Conditions, robot: RobotModel) -> None:
    """Raise ConfigurationError where friction, noise or steps of torque meet a joint without a rotor."""
    torque = conditions.torque
    needs = (
        ("friction", "friction", conditions.friction is not None),
        ("torque", "torque.noise_density", torque is not None and bool(np.any(torque.noise_density))),
        ("torque", "torque.step", torque is not None and bool(np.any(torque.step))),
    )
    joints = [joint for arm in robot.description.arms for joint in arm.joints if joint.rotor_inertia == 0.0]
    for key, name, needed in needs:
        if needed and joints:
            raise root.error(
                f"{name} needs the inertia of rotors, and that of {joints[0].name} is 0 kg m^2: set "
                "conditions.rotor_inertia, or rotor_inertia of each arm of the robot",
                key,
            )
