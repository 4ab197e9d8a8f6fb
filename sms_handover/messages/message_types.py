"""Message definitions by type name: schema text, type hash, and (de)serialisation without ROS.

The standard types are those of Jazzy; every other type is read from its ``.msg`` file.
"""

import os
import sysconfig
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from sms_handover.errors import BagError
from sms_handover.messages.stamps import stamp_place

_SOURCE_PACKAGE = "sms_handover_interfaces"
_ROS2_SYNTAX = 2


@dataclass(frozen=True)
class Schema:
    """The schema of a type in a bag: ``text`` as rosbag2 concatenates it, ``type_hash`` as RIHS01."""

    type: str
    text: str
    type_hash: str


class MessageTypes:
    """The known types; others are looked up on demand in the source tree and the prefixes."""

    def __init__(self, roots: Iterable[Path] | None = None) -> None:
        """Look for ``<package>/msg/<Type>.msg`` under ``roots``, by default :func:`definition_roots`."""
        self._roots = tuple(definition_roots() if roots is None else roots)
        self._store = get_typestore(Stores.ROS2_JAZZY)

    def schema(self, type_name: str) -> Schema:
        """Return the schema of a type; raises BagError without a readable definition."""
        self.require(type_name)
        text, _ = self._store.generate_msgdef(type_name, ros_version=_ROS2_SYNTAX)
        return Schema(type_name, text, self._store.hash_rihs01(type_name))

    def stamp_place(self, type_name: str) -> int | None:
        """Return the byte at which the stamp of a message of this type begins, None if it has none."""
        self.require(type_name)
        fields = self._store.fielddefs[type_name][1]
        return stamp_place(type_name, fields[0][1][1] if fields else None)

    def make(self, type_name: str, **values: Any) -> Any:
        """Return a message object of a type with all its fields given."""
        self.require(type_name)
        return self._store.types[type_name](**values)

    def serialize(self, message: Any) -> bytes:
        """Return the CDR bytes of a message object, header included."""
        return bytes(self._store.serialize_cdr(message, message.__msgtype__))

    def deserialize(self, data: bytes | memoryview, type_name: str) -> Any:
        """Return the message in CDR bytes; raises BagError if they are not of this type."""
        self.require(type_name)
        try:
            return self._store.deserialize_cdr(data, type_name)
        except SerdeError as error:
            raise BagError(f"a message does not decode as {type_name}: {error}") from error

    def require(self, type_name: str) -> None:
        """Look up a type and its nested types; raises BagError if one is unknown."""
        pending, found = [type_name], {}
        while pending:
            name = pending.pop()
            if name in self._store.fielddefs or name in found:
                continue
            definitions = self._parse(name)
            found.update(definitions)
            for _, fields in definitions.values():
                pending.extend(nested for _, field in fields for nested in _nested_types(field))
        self._register(found)

    def _register(self, definitions: dict[str, Any]) -> None:
        if definitions:
            self._store.register(definitions)

    def _parse(self, type_name: str) -> dict[str, Any]:
        """Return the definitions in the ``.msg`` file of a type."""
        package, _, short = type_name.partition("/msg/")
        candidates = [root / package / "msg" / f"{short}.msg" for root in self._roots]
        if package == _SOURCE_PACKAGE:
            candidates.insert(0, _source_interfaces() / "msg" / f"{short}.msg")
        path = next((path for path in candidates if short and path.is_file()), None)
        if path is None:
            raise BagError(
                f"no definition of the message type {type_name!r}: looked for {short or type_name}.msg"
                f" in {', '.join(str(root) for root in self._roots)}"
            )
        try:
            return dict(get_types_from_msg(path.read_text(encoding="utf-8"), type_name))
        except (OSError, UnicodeDecodeError, TypesysError) as error:
            raise BagError(
                f"the definition of {type_name} in {path} is not readable: {_one_line(error)}"
            ) from error


def definition_roots() -> tuple[Path, ...]:
    """Return the ``share`` folders of the ROS workspaces (AMENT_PREFIX_PATH), then of the interpreter."""
    prefixes = [prefix for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    prefixes.append(sysconfig.get_path("data"))
    return tuple(Path(prefix) / "share" for prefix in prefixes)


def _source_interfaces() -> Path:
    return Path(__file__).resolve().parent.parent.parent / "interfaces"


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:200]


def _nested_types(field: Any) -> list[str]:
    _, content = field
    if isinstance(content, str):
        return [content]
    first, _ = content
    return _nested_types(first) if isinstance(first, tuple) else []
