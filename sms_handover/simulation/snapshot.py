"""Snapshots of the loop, and their exact JSON form."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from sms_handover.clearance.monitor import MonitorState
from sms_handover.control.protocol import Controller, Guidance, Resumable, inner_of
from sms_handover.errors import ConfigurationError, ControllerError
from sms_handover.plan_report import PlanStatus
from sms_handover.plant.plant_state import PlantState
from sms_handover.trajectory.generator import GeneratorState
from sms_handover.types import read_only


@dataclass(frozen=True, eq=False)
class Snapshot:
    """All that the rest of a run depends on besides its scenario, before a tick.

    ``controller`` is the state of the controller under ``law``, as plain data; ``clearance`` is None where
    clearance is not measured during the run. ``plan`` is what came of the latest solve of a predictive law.
    """

    seed: int
    plant: PlantState
    trajectory: GeneratorState
    law: str
    controller: Any
    guidance: Guidance
    finished: bool
    clearance: MonitorState | None
    plan: PlanStatus = PlanStatus.SOLVED

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the JSON form: read-only mappings have no pickled form of their own."""
        return structured, (Snapshot, plain(self))


def save_snapshot(snapshot: Snapshot, path: Path) -> None:
    """Write a snapshot as JSON; raises ConfigurationError if the file exists or cannot be written."""
    try:
        with path.open("x", encoding="utf-8") as file:
            json.dump(plain(snapshot), file, indent=1)
    except FileExistsError:
        raise ConfigurationError(f"{path} exists; choose another file") from None
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be written: {error.strerror}") from error


def load_snapshot(path: Path) -> Snapshot:
    """Return the snapshot in a file, bit for bit; raises ConfigurationError if there is none."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        snapshot: Snapshot = structured(Snapshot, data)
    except OSError as error:
        raise ConfigurationError(f"cannot read {path}: {error.strerror}") from error
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ConfigurationError(f"{path} is no snapshot of this version: {error}") from error
    return snapshot


def controller_data(controller: Controller, law: str) -> Any:
    """Return the state of a controller as plain data; raises ControllerError if it does not tell it."""
    inner = inner_of(controller)
    if not isinstance(inner, Resumable):
        raise ControllerError(f"{law} has no state to keep: give it 'state' and 'restore' (docs/control.md)")
    return plain(inner.state)


def restore_controller(controller: Controller, data: Any) -> None:
    """Take a controller that has been reset back to the state in ``data``."""
    inner = inner_of(controller)
    if isinstance(inner, Resumable):
        inner.restore(structured(type(inner.state), data))


def plain(value: Any) -> Any:
    """Return a value as JSON has it; numbers keep every bit."""
    if is_dataclass(value):
        return {item.name: plain(getattr(value, item.name)) for item in fields(value)}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, tuple | list) else value


def structured(kind: Any, data: Any) -> Any:
    """Return plain data as a value of a type: a dataclass, an array, a tuple, a mapping, an enum."""
    origin, inner = get_origin(kind), get_args(kind)
    if is_dataclass(kind) and isinstance(kind, type):
        hints = get_type_hints(kind)
        return kind(**{item.name: structured(hints[item.name], data[item.name]) for item in fields(kind)})
    if origin in (Union, UnionType):
        some = next(one for one in inner if one is not NoneType)
        return None if data is None else structured(some, data)
    if origin is np.ndarray:
        return read_only(data)
    if origin is tuple:
        kinds = [inner[0]] * len(data) if inner[-1] is Ellipsis else inner
        return tuple(structured(one, item) for one, item in zip(kinds, data, strict=True))
    if origin is not None and issubclass(origin, Mapping):
        return {name: structured(inner[1], item) for name, item in data.items()}
    return kind(data) if isinstance(kind, type) and issubclass(kind, Enum) else data
