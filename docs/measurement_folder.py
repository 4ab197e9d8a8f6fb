"""Folder of a measurement that goes on where it was stopped, and the rows in it.

Each version of the sources has a folder of its own, so that no page mixes figures of two.
"""

import hashlib
import json
import os
from functools import cache
from pathlib import Path
from typing import Any

_ROOT = Path(__file__).resolve().parent.parent
_PLACES = ("sms_handover", "config", "docs")  # what runs, what it reads, and what measures
_KINDS = (".py", ".c", ".yaml")
_DIGITS = 8  # hexadecimal


def measurement_folder(name: str) -> Path:
    """Return the folder of a measurement with the sources as they are, below ``build/``."""
    return _ROOT / "build" / name / source_digest()


@cache
def source_digest() -> str:
    """Return the first digits of SHA-256 of every source by name."""
    digest = hashlib.sha256()
    for place in _PLACES:
        for path in sorted((_ROOT / place).rglob("*")):
            if path.suffix in _KINDS:
                digest.update(f"{path.relative_to(_ROOT)}\0".encode() + path.read_bytes() + b"\0")
    return digest.hexdigest()[:_DIGITS]


class KeptRows:
    """Rows of a measurement, a JSON object a line, each on disk before the next is worked out."""

    def __init__(self, file: Path) -> None:
        """Take a file, made with its folder if it is not there; a last line that was cut off is dropped."""
        file.parent.mkdir(parents=True, exist_ok=True)
        self._file = file
        data = file.read_bytes() if file.exists() else b""
        whole = data[: data.rfind(b"\n") + 1]
        if whole != data:
            os.truncate(file, len(whole))
        self.rows: list[dict[str, Any]] = [json.loads(line) for line in whole.splitlines()]

    def add(self, row: dict[str, Any]) -> None:
        """Append a row."""
        with self._file.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(row) + "\n")
            stream.flush()
            os.fsync(stream.fileno())
        self.rows.append(row)
