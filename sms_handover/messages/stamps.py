"""Stamps of messages, read from their CDR bytes."""

import struct

from sms_handover.errors import BagError
from sms_handover.units import NS_PER_S

_LITTLE = struct.Struct("<iI")
_BIG = struct.Struct(">iI")
_OFFSET = 4  # [byte] size of the encapsulation header
_SIZE = 12  # [byte] up to the end of the stamp


def stamp_ns(data: bytes) -> int:
    """Return the stamp in nanoseconds of a message that begins with a Header or a Time.

    See ``MessageTypes.stamped``. Raises BagError on bytes that are too short or not plain CDR.
    """
    if len(data) < _SIZE or data[0] != 0 or data[1] > 1:
        raise BagError(f"a message of {len(data)} bytes does not begin with a time stamp in plain CDR")
    seconds, nanoseconds = (_LITTLE if data[1] else _BIG).unpack_from(data, _OFFSET)
    return int(seconds) * NS_PER_S + int(nanoseconds)
