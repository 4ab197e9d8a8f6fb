"""Schemas of a bag: messages of any type are read by nothing but the schema of their topic."""

import re
from typing import Any

from mcap.records import Schema
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore

from sms_handover.bag.mcap.scan import Source
from sms_handover.errors import BagError
from sms_handover.messages.stamps import stamp_place

Field = tuple[str, Any]  # name, and what it holds as rosbags describes it

_LONGEST_REASON = 200  # characters of a parser's complaint that are shown
_PLAIN_CDR = (b"\x00\x00", b"\x00\x01")  # representations, big and little endian
_DELIMITER = "=" * 80  # between the definitions in a schema
_EVENT = "_Event"
_EVENT_INFO = ("service_msgs/msg/ServiceEventInfo", "builtin_interfaces/msg/Time")
_EVENT_TEXT = """service_msgs/ServiceEventInfo info
{service}_Request[<=1] request
{service}_Response[<=1] response
"""
_ERRORS = (
    TypesysError,
    SerdeError,
    LookupError,
    ValueError,
    TypeError,
    SyntaxError,
    AssertionError,
    RecursionError,
)


class SchemaTypes:
    """The message types of one schema; types of the same name elsewhere are not used."""

    def __init__(self, schema: Schema) -> None:
        """Parse the text of a schema; raises BagError if it is not understood."""
        self._store = get_typestore(Stores.EMPTY)
        try:
            self.name, definitions = _definitions(schema)
            known = self._store.fielddefs
            self._store.register({name: item for name, item in definitions.items() if name not in known})
            self._store.get_msgdef(self.name)
        except _ERRORS as error:
            reason = "wstring is not supported" if "wstring" in str(error) else _one_line(error)
            raise BagError(f"the schema of {schema.name} is not understood: {reason}") from error

    @property
    def stamp_place(self) -> int | None:
        """The byte at which the stamp of a message begins, None if it has none in front."""
        fields = self.fields(self.name)
        return stamp_place(self.name, fields[0][1][1] if fields else None)

    def fields(self, type_name: str) -> list[Field]:
        """Return the fields of a type of the schema."""
        return list(self._store.fielddefs[type_name][1])

    def decode(self, data: bytes) -> Any:
        """Return the message in CDR bytes; raises BagError if they are not of this type."""
        if len(data) >= len(_PLAIN_CDR[0]) and data[:2] not in _PLAIN_CDR:
            kind = int.from_bytes(data[:2], "big")
            raise BagError(f"a message of {self.name} is not in plain CDR but in representation {kind:#06x}")
        try:
            return self._store.deserialize_cdr(data, self.name)
        except (*_ERRORS, OverflowError, MemoryError) as error:
            raise BagError(f"a message does not decode as {self.name}: {_one_line(error)}") from error


def types_of(source: Source) -> SchemaTypes:
    """Return the types of a topic; raises BagError unless its messages are CDR with a readable schema."""
    if source.encoding != "cdr":
        raise BagError(f"{source.topic} has messages in {source.encoding or 'no'} encoding, only cdr is read")
    return SchemaTypes(source.schema)


def _definitions(schema: Schema) -> tuple[str, dict[str, Any]]:
    """Return the name of the type of a schema, as rosbags has it, and all definitions."""
    name = schema.name or "a topic"
    text = schema.data.decode(errors="replace").replace("\r\n", "\n")
    if schema.encoding in ("ros2idl", "omgidl"):
        text = re.sub(r"^[ \t]*#.*$", "", text, flags=re.MULTILINE)  # all that is included is in the text
        parts = re.split(rf"^{_DELIMITER}\nIDL: .*$", text, flags=re.MULTILINE)
        parsed = [get_types_from_idl(part) for part in parts if part.strip()]
        return schema.name, {key: item for definitions in parsed for key, item in definitions.items()}
    if not schema.encoding:
        raise BagError(f"{name} has no schema text")
    if schema.encoding != "ros2msg":
        raise BagError(f"{name} has a schema in {schema.encoding} encoding")
    extra: dict[str, Any] = {}
    main, *others = text.split(f"{_DELIMITER}\n")
    parts = re.split(r"^---[ \t]*$", main, flags=re.MULTILINE)
    if schema.name.endswith(_EVENT) and len(parts) == len(("request", "response")):
        service = schema.name.removesuffix(_EVENT)
        kinds = zip(("Request", "Response"), parts, strict=True)
        nested = [f"MSG: {service}_{kind}\n{part.strip()}\n" for kind, part in kinds]
        text = f"{_DELIMITER}\n".join([_EVENT_TEXT.format(service=service), *nested, *others])
        jazzy = get_typestore(Stores.ROS2_JAZZY).fielddefs
        extra = {key: jazzy[key] for key in _EVENT_INFO}
    definitions = get_types_from_msg(text, schema.name)
    return next(iter(definitions)), {**extra, **definitions}


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:_LONGEST_REASON]
