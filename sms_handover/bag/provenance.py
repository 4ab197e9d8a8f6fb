"""Provenance of a recording: versions, source revision, seed and start, as texts without paths."""

import platform
import subprocess
from collections.abc import Sequence
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PROVENANCE_RECORD = "sms_handover.provenance"  # name of the metadata record in the bag
PACKAGES = ("sms_handover", "ros-jazzy-rclpy", "pin", "numpy", "mcap", "rosbags")
UNKNOWN = "unknown"

_GIT_TIMEOUT = 5.0  # [s]


def provenance(seed: int | None = None, start: datetime | None = None) -> dict[str, str]:
    """Return what identifies the software of a run; ``start`` defaults to now."""
    revision, state = source_revision(Path(__file__).resolve().parent.parent.parent)
    moment = datetime.now(timezone.utc) if start is None else start.astimezone(timezone.utc)
    return {
        "start": moment.isoformat(timespec="milliseconds"),
        "seed": "none" if seed is None else str(seed),
        "git_revision": revision,
        "git_state": state,
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
        **{f"version.{package}": package_version(package) for package in PACKAGES},
    }


def package_version(package: str) -> str:
    """Return the version of an installed package, or 'unknown'."""
    try:
        return version(package)
    except PackageNotFoundError:
        return UNKNOWN


def source_revision(root: Path) -> tuple[str, str]:
    """Return the git revision of a source tree and 'clean' or 'modified'; both 'unknown' outside of one."""
    if not (root / ".git").exists():
        return UNKNOWN, UNKNOWN
    revision = _git(root, ["rev-parse", "HEAD"])
    status = _git(root, ["status", "--porcelain", "--untracked-files=no"])
    if revision is None or status is None:
        return UNKNOWN, UNKNOWN
    return revision, "modified" if status else "clean"


def _git(root: Path, arguments: Sequence[str]) -> str | None:
    try:
        result = subprocess.run(
            ["git", "-C", str(root), *arguments],
            capture_output=True,
            text=True,
            timeout=_GIT_TIMEOUT,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return result.stdout.strip()
