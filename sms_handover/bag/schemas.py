"""Read messages by nothing but the schemas in their bag, so that any ROS 2 bag can be read."""

from typing import Any

from mcap.records import Schema
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore

from sms_handover.bag.mcap.scan import Source
from sms_handover.errors import BagError

Field = tuple[str, Any]  # name, and what it holds as rosbags describes it

_TIMES = ("builtin_interfaces/msg/Time", "std_msgs/msg/Header")
_LONGEST_REASON = 200  # characters of a parser's complaint that are shown


class SchemaTypes:
    """The message types of one schema; what others call by the same names is not used."""

    def __init__(self, schema: Schema) -> None:
        """Parse the text of a schema; raises BagError if it is not readable or not complete."""
        self.name = schema.name
        self._store = get_typestore(Stores.EMPTY)
        text = schema.data.decode(errors="replace")
        try:
            if schema.encoding == "ros2msg":
                definitions = get_types_from_msg(text, schema.name)
            elif schema.encoding == "ros2idl":
                definitions = get_types_from_idl(text)
            else:
                raise BagError(
                    f"{schema.name or 'a topic'} has a schema in {schema.encoding or 'no'} encoding"
                )
            known = self._store.fielddefs
            self._store.register({name: item for name, item in definitions.items() if name not in known})
            self._store.get_msgdef(schema.name)
        except (TypesysError, LookupError) as error:
            raise BagError(f"the schema of {schema.name} is not readable: {_one_line(error)}") from error

    @property
    def stamped(self) -> bool:
        """Whether a message begins with a time."""
        fields = self.fields(self.name)
        return bool(fields) and fields[0][1][1] in _TIMES

    def fields(self, type_name: str) -> list[Field]:
        """Return the fields of a type of the schema."""
        return list(self._store.fielddefs[type_name][1])

    def decode(self, data: bytes) -> Any:
        """Return the message in CDR bytes; raises BagError if they are not of this type."""
        try:
            return self._store.deserialize_cdr(data, self.name)
        except (SerdeError, LookupError) as error:
            raise BagError(f"a message does not decode as {self.name}: {_one_line(error)}") from error


def types_of(source: Source) -> SchemaTypes:
    """Return the types of a topic; raises BagError unless its messages are CDR with a readable schema."""
    if source.encoding != "cdr":
        raise BagError(f"{source.topic} has messages in {source.encoding or 'no'} encoding, only cdr is read")
    return SchemaTypes(source.schema)


def _one_line(error: Exception) -> str:
    """Return the text of an error without line breaks, cut to a readable length."""
    return " ".join(str(error).split())[:_LONGEST_REASON]
