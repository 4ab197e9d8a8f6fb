"""Stamps of messages, read from their CDR bytes."""

import struct

from sms_handover.errors import BagError
from sms_handover.graph.topics import TF_TYPE
from sms_handover.units import NS_PER_S

_LITTLE = struct.Struct("<iI")
_BIG = struct.Struct(">iI")
_SIZE = 8  # [byte] of a stamp
_FIRST = 4  # [byte] of a message that begins with a stamp, behind the encapsulation header
_IN_LIST = 8  # [byte] where it begins with a list of such messages, behind their number
_STAMPED = ("builtin_interfaces/msg/Time", "std_msgs/msg/Header")  # what such a message begins with


def stamp_place(type_name: str, first_field: object) -> int | None:
    """Return the byte at which the stamp of a message of a type begins, None if it has none in front.

    ``first_field`` is the type of the first field; of transforms it is that of the first one that counts.
    """
    if type_name == TF_TYPE:
        return _IN_LIST
    return _FIRST if first_field in _STAMPED else None


def stamp_ns(data: bytes, place: int = _FIRST) -> int:
    """Return the stamp in nanoseconds that begins at a byte of a message, see :func:`stamp_place`.

    Raises BagError on bytes that are too short or not plain CDR.
    """
    if len(data) < place + _SIZE or data[0] != 0 or data[1] > 1:
        raise BagError(f"a message of {len(data)} bytes does not begin with a time stamp in plain CDR")
    seconds, nanoseconds = (_LITTLE if data[1] else _BIG).unpack_from(data, place)
    return int(seconds) * NS_PER_S + int(nanoseconds)
