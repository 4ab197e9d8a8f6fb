"""Package files: where ``config/`` is, however the package was installed."""

import os
import sysconfig
from pathlib import Path

from sms_handover.errors import ConfigurationError

_PACKAGE = "sms_handover"


def share_directory() -> Path:
    """Return the folder that holds ``config/``; raises ConfigurationError.

    Searched in this order: the source tree, every prefix of AMENT_PREFIX_PATH, the environment of the
    interpreter, and where ``pip install --user``, ``--prefix`` and ``--target`` put it.
    """
    found_in = Path(__file__).resolve().parent.parent.parent
    prefixes = [Path(p) for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    prefixes += [Path(sysconfig.get_path("data")), *found_in.parents[2:3], found_in]
    candidates = [found_in, *dict.fromkeys(prefix / "share" / _PACKAGE for prefix in prefixes)]
    for candidate in candidates:
        if (candidate / "config" / "robot.yaml").is_file():
            return candidate
    searched = ", ".join(str(c) for c in candidates)
    raise ConfigurationError(f"the config folder of the package is not installed; searched {searched}")


def config_file(name: str) -> Path:
    """Return the path of a file of the shipped ``config/`` folder."""
    return share_directory() / "config" / name
