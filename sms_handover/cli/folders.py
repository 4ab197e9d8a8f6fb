"""What the output folder of a run holds."""

from pathlib import Path

BAG, LOGS = "bag", "log"


def bag_of(path: Path) -> Path:
    """Return the bag in the output folder of a run, or ``path`` itself if it is a bag."""
    return path / BAG if (path / BAG).is_dir() else path
