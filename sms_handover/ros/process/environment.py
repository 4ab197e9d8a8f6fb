"""Environment of the user before ROS starts: what would break it is handled, or named with the remedy.

It has to be asked before rclpy is imported, which ends the process where it does not find its middleware.
"""

import os
import sys
import tempfile
from collections.abc import Iterator, MutableMapping, Sequence
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

from sms_handover.errors import ConfigurationError

Environment = MutableMapping[str, str]

_MIDDLEWARE = "rmw_fastrtps_cpp"  # the one whose profiles keep a graph to itself (docs/security.md)
_LOG_FOLDER = "ROS_LOG_DIR"
_SERVER = "ROS_DISCOVERY_SERVER"
_SEARCH = "PYTHONPATH"


def prepare_environment(*, private: bool, environment: Environment = os.environ) -> list[str]:
    """Change the environment so that ROS starts, and return what was changed in words.

    ``private`` is a graph that has no nodes but those of one run. Raises ConfigurationError on what
    cannot be changed from here.
    """
    _require_fitting_rclpy(environment)
    return [*_changes(private, environment)]


def draw_to_files(environment: Environment = os.environ) -> None:
    """Let Matplotlib write files, whatever a notebook or a desktop has chosen: no command opens a window."""
    environment["MPLBACKEND"] = "agg"


def drop_current_folder(path: list[str], environment: Environment = os.environ) -> None:
    """Remove the empty entries of PYTHONPATH, each the folder the user stands in, here and for children."""
    entries = environment.get(_SEARCH, "").split(os.pathsep)
    if _SEARCH in environment and "" in entries:
        environment[_SEARCH] = os.pathsep.join(filter(None, entries))
        path[1:] = [entry for entry in path[1:] if entry not in ("", os.getcwd())]


def require_utf8(texts: Sequence[str]) -> None:
    """Raise ConfigurationError on an argument that ROS cannot take."""
    for text in texts:
        try:
            text.encode()
        except UnicodeEncodeError:
            raise ConfigurationError(
                f"{text!a} is not UTF-8, which ROS needs: rename it, or give a symbolic link to it"
            ) from None


def _changes(private: bool, environment: Environment) -> Iterator[str]:
    """Change one thing after the other."""
    if environment.get("RMW_IMPLEMENTATION", _MIDDLEWARE) != _MIDDLEWARE:
        yield f"RMW_IMPLEMENTATION is {environment['RMW_IMPLEMENTATION']}; {_MIDDLEWARE} is used instead"
        environment["RMW_IMPLEMENTATION"] = _MIDDLEWARE
    if environment.get(_SERVER) and private:
        yield f"{_SERVER} is ignored: the nodes of a run find each other without it"
        del environment[_SERVER]
    elif environment.get(_SERVER):
        yield f"{_SERVER} is {environment[_SERVER]}: only nodes that it knows are found; unset it for others"
    if environment.get(_LOG_FOLDER) and not _writable(Path(environment[_LOG_FOLDER])):
        yield f"{_LOG_FOLDER} {environment[_LOG_FOLDER]} cannot be written and is ignored"
        del environment[_LOG_FOLDER]
    if not private and not environment.get(_LOG_FOLDER) and not _writable(_default_logs(environment)):
        environment[_LOG_FOLDER] = tempfile.mkdtemp(prefix="ros_log_")
        yield f"there is no home folder to log to: ROS logs to {environment[_LOG_FOLDER]}"


def _default_logs(environment: Environment) -> Path | None:
    """Return where ROS logs without ROS_LOG_DIR, None if it cannot."""
    if environment.get("ROS_HOME"):
        return Path(environment["ROS_HOME"]) / "log"
    return Path(environment["HOME"]) / ".ros" / "log" if environment.get("HOME") else None


def _writable(folder: Path | None) -> bool:
    """Whether a folder is there, or can be made, and can be written."""
    if folder is None:
        return False
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


def _require_fitting_rclpy(environment: Environment) -> None:
    """Raise ConfigurationError if PYTHONPATH leads to an rclpy that was built for another Python."""
    for entry in filter(None, environment.get(_SEARCH, "").split(os.pathsep)):
        folder = Path(entry) / "rclpy"
        if folder.is_dir():
            fits = any((folder / f"_rclpy_pybind11{suffix}").exists() for suffix in EXTENSION_SUFFIXES)
            if not fits:
                here = f"{sys.version_info.major}.{sys.version_info.minor}"
                raise ConfigurationError(
                    f"PYTHONPATH leads to {folder}, which was not built for this Python {here}: use a shell "
                    "in which no ROS is sourced, or unset PYTHONPATH and LD_LIBRARY_PATH"
                )
            return
