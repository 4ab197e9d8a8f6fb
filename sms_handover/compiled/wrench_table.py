"""Wrench table: the wrenches from outside as the compiled steps have them."""

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from sms_handover.conditions.constant_wrench import ConstantWrench
from sms_handover.conditions.orbit import GravityGradient, Orbit, RelativeOrbit
from sms_handover.conditions.thruster_misfire import ThrusterMisfire
from sms_handover.conditions.wrench import WrenchModel, cross
from sms_handover.conditions.wrench_history import WrenchHistory
from sms_handover.configuration.conditions_fields import BODY
from sms_handover.types import Array
from sms_handover.units import NS_PER_S, ns_to_seconds

# Kinds, as in native/effects.c.
_IN_WORLD, _IN_BODY, _MISFIRE, _GRADIENT, _RELATIVE, _TOLD_IN_WORLD, _TOLD_IN_BODY = range(7)
_LAYOUT = np.dtype([("numbers", "f8", 11), ("rows", "i8"), ("kind", "i8")])  # wrench_t
Form = tuple[int, tuple[Any, ...]]  # kind, and arrays of its numbers


class WrenchTable:
    """Wrenches as an array of ``wrench_t`` of native/effects.c, whose functions know these kinds alone."""

    @staticmethod
    def knows(models: Iterable[WrenchModel]) -> bool:
        """Whether all of the wrenches are of kinds that C has."""
        return all(type(model) in _FORMS for model in models)

    def __init__(self, models: Iterable[WrenchModel], tick_ns: int) -> None:
        """Make the table; the models are to be of known kinds."""
        self._models, self._tick_ns = tuple(models), tick_ns
        self.rows = np.zeros(len(self._models), _LAYOUT)
        for row, model in zip(self.rows, self._models, strict=True):
            row["kind"], numbers = _FORMS[type(model)](model)
            flat = np.concatenate([np.atleast_1d(part) for part in numbers]) if numbers else np.zeros(0)
            row["numbers"][: flat.size] = flat
        self._kept: list[Array] = []

    def __len__(self) -> int:
        """Return the number of wrenches."""
        return len(self._models)

    def tell(self, first: int, ticks: int) -> None:
        """Prepare what changes from tick to tick by rows, for some ticks from a first one on."""
        self._kept = []
        for row, model in zip(self.rows, self._models, strict=True):
            if isinstance(model, WrenchHistory):
                starts = self._tick_ns * np.arange(first, first + ticks)
                told = np.ascontiguousarray(model.at(starts / NS_PER_S + 0.5 * ns_to_seconds(self._tick_ns)))
                row["rows"] = told.ctypes.data
                self._kept.append(told)


def _constant(model: ConstantWrench) -> Form:
    if model.axes == BODY:
        return _IN_BODY, (model.force, model.torque + cross(model.point, model.force))
    return _IN_WORLD, (model.force, model.torque, model.point)


def _misfire(model: ThrusterMisfire) -> Form:
    torque, end = cross(model.point, model.force), model.start + model.duration
    return _MISFIRE, (model.force, torque, model.start, end)


def _told(model: WrenchHistory) -> Form:
    return _TOLD_IN_BODY if model.axes == BODY else _TOLD_IN_WORLD, ()


def _of_orbit(orbit: Orbit) -> tuple[Any, ...]:
    return orbit.radial, cross(orbit.normal, orbit.radial), orbit.rate


_FORMS: Mapping[type, Callable[[Any], Form]] = MappingProxyType(
    {
        ConstantWrench: _constant,
        ThrusterMisfire: _misfire,
        WrenchHistory: _told,
        GravityGradient: lambda model: (_GRADIENT, (*_of_orbit(model.orbit), 3.0 * model.orbit.rate**2)),
        RelativeOrbit: lambda model: (
            _RELATIVE,
            (*_of_orbit(model.orbit), model.orbit.rate**2, model.reference),
        ),
    }
)
