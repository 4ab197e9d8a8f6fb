"""The machine and the software of a measurement."""

import os
import platform
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

PACKAGES = (
    "numpy",
    "pin",
    "casadi",
    "mcap",
    "rosbags",
    "ros-jazzy-rclpy",
    "mujoco",
    "mink",
    "drake",
    "pin-pink",
)


def machine() -> list[str]:
    """Return machine and software, a line each."""
    return [
        f"Machine: {processor()}, {platform.system()} {platform.machine()}",
        f"Software: Python {platform.python_version()}, {versions(PACKAGES)}",
    ]


def load_average() -> float:
    """Return how many processes wanted to run over the last minute, by the kernel's count."""
    return os.getloadavg()[0]


def processor() -> str:
    """Return the name of the processor and how many of its cores this process may use."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{names[0] if names else platform.processor() or 'unknown processor'}, {os.cpu_count()} cores"


def versions(packages: Iterable[str]) -> str:
    """Return name and version of every package that is installed."""
    found = []
    for name in packages:
        try:
            found.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            continue
    return ", ".join(found)
