"""Registry of second engines: each by name, its extra, and the module that is imported where it is used."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType

from sms_handover.engines.protocol import Engine
from sms_handover.errors import MissingDependencyError


@dataclass(frozen=True)
class Entry:
    """One engine: what it is, the package it needs, by import name and on PyPI, and our class for it."""

    text: str
    imported: str
    package: str
    module: str
    name: str


ENGINES: Mapping[str, Entry] = MappingProxyType(
    {
        "mujoco": Entry(
            "MuJoCo is given the recorded efforts: base, joints, tools and momenta, each reference period",
            "mujoco",
            "mujoco",
            "in_mujoco",
            "InMujoco",
        ),
        "basilisk": Entry("Basilisk is given them: the same", "Basilisk", "bsk", "in_basilisk", "InBasilisk"),
    }
)


def load_engine(name: str) -> Engine:
    """Return the engine of a name in ``ENGINES``; raises MissingDependencyError without its package."""
    entry = ENGINES[name]
    try:
        module = import_module(f"{__package__}.{entry.module}")
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] != entry.imported:
            raise
        raise MissingDependencyError(f"replays in {name}", entry.package, name) from error
    engine: Engine = getattr(module, entry.name)()
    return engine
