"""Where the files that ship beside the code (``config/``) are, however the package was installed."""

import os
import sysconfig
from pathlib import Path

from sms_handover.errors import ConfigurationError

_PACKAGE = "sms_handover"


def share_directory() -> Path:
    """Return the folder that holds ``config/``.

    Looked for in this order: the source tree this module runs from, every prefix of a ROS
    workspace (AMENT_PREFIX_PATH), the environment of the interpreter. Raises ConfigurationError.
    """
    prefixes = [p for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    prefixes.append(sysconfig.get_path("data"))
    candidates = [Path(__file__).resolve().parent.parent.parent]
    candidates += [Path(prefix) / "share" / _PACKAGE for prefix in prefixes]
    for candidate in candidates:
        if (candidate / "config" / "robot.yaml").is_file():
            return candidate
    looked = ", ".join(str(c) for c in candidates)
    raise ConfigurationError(f"the package's config folder is not installed; looked in {looked}")


def config_file(name: str) -> Path:
    """Return the path of a file of the shipped ``config/`` folder."""
    return share_directory() / "config" / name
