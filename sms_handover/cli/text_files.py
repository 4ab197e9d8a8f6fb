"""Text files that a command writes."""

import os
from pathlib import Path

from sms_handover.errors import ConfigurationError


def write_text(path: Path, text: str, *, parents: bool = False) -> None:
    """Write a file whole or not at all, with its ``parents`` if asked for; raises ConfigurationError."""
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        if parents:
            path.parent.mkdir(parents=True, exist_ok=True)
        try:
            unfinished.write_text(text, encoding="utf-8")
            unfinished.replace(path)
        finally:
            unfinished.unlink(missing_ok=True)
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be written: {error.strerror}") from error
