"""Stored runs of the first edition: digests of every bit, and rows for machines that round otherwise.

The rows and the bags are those of the first edition for good: later code stays within rounding of them. The
digests are taken again, by ``python test/first_edition.py``, only where a change of bits is intended, and the
changelog says so: since the first edition once, for sums of a fixed order.
"""

import hashlib
import json
import platform
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

FOLDER = Path(__file__).resolve().parent / "data" / "first_edition"
LAWS = ("nmpc", "pid")
PARTS = {
    "states": ("tick_ns", "joint_position", "joint_velocity"),
    "commands": ("joint_command", "joint_effort"),
    "references": ("reference_ns", "reference_position", "reference_velocity"),
    "base": ("base_pose", "base_twist"),
}
ROWS = {  # of these one row a second is kept: per tick 1000, per reference period 50
    **dict.fromkeys(("joint_position", "joint_velocity", "joint_command", "base_pose", "base_twist"), 1000),
    **dict.fromkeys(("reference_position", "reference_velocity"), 50),
}


@dataclass(frozen=True)
class Stored:
    """What is kept of a run: the machine it was made on, a digest for each part, and a row a second."""

    machine: dict[str, str]
    digests: dict[str, str]
    rows: dict[str, np.ndarray]


def run_of(law: str) -> RunData:
    """Return the shipped handover under a law, over its whole schedule, with Pinocchio's dynamics."""
    return simulate(load_scenario("colliding", {"controller": {"law": law}}))


def digests_of(run: RunData) -> dict[str, str]:
    """Return the SHA-256 of the bytes of each part of a run."""
    found = {}
    for part, names in PARTS.items():
        digest = hashlib.sha256()
        for name in names:
            digest.update(np.ascontiguousarray(getattr(run, name)).tobytes())
        found[part] = digest.hexdigest()
    return found


def rows_of(run: RunData) -> dict[str, Any]:
    """Return a row a second of the arrays that a run is made of."""
    return {name: getattr(run, name)[::step] for name, step in ROWS.items()}


def machine() -> dict[str, str]:
    """Return what decides how sums round: the processor's class, and the versions of what adds them up."""
    return {
        "processor": _processor_class(),
        "libc": " ".join(platform.libc_ver()),
        "numpy": version("numpy"),
        "pin": version("pin"),
    }


def stored(law: str) -> Stored:
    """Return what is kept of the run under a law."""
    text = json.loads((FOLDER / f"{law}.json").read_text(encoding="utf-8"))
    with np.load(FOLDER / f"{law}.npz") as arrays:
        return Stored(text["machine"], text["digests"], {name: arrays[name] for name in ROWS})


def _processor_class() -> str:
    """Return machine, vendor and the widest vectors, by which linear algebra libraries choose their code."""
    vendor, widest = "unknown", "none"
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    for line in lines:
        name, _, value = line.partition(":")
        if name.strip() == "vendor_id":
            vendor = value.strip()
        elif name.strip() == "flags":
            flags = set(value.split())
            widest = next((flag for flag in ("avx512f", "avx2", "avx") if flag in flags), "none")
    return f"{platform.machine()} {vendor} {widest}"


def _store(law: str) -> None:
    """Write the digests of the run under a law."""
    text = {"machine": machine(), "digests": digests_of(run_of(law))}
    (FOLDER / f"{law}.json").write_text(json.dumps(text, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    for name in LAWS:
        _store(name)
        print(f"{name}: stored in {FOLDER}")
