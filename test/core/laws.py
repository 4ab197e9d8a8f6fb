"""Packages that offer control laws by entry points, as if they were installed."""

from pathlib import Path

GROUP = "sms_handover.control_laws"


def offer(folder: Path, package: str, **laws: str) -> Path:
    """Return a folder to search for packages, with one that offers laws: name = module:object."""
    info = folder / f"{package}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n", encoding="ascii"
    )
    lines = [f"[{GROUP}]", *(f"{name} = {place}" for name, place in laws.items())]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n", encoding="ascii")
    return folder
