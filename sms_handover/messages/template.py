"""Messages whose names and lengths are always the same: the bytes of one are the template of all.

One compiled struct takes a message apart into its stamp and everything that has to be as in the template;
one array holds all its numbers.
"""

import struct
from collections.abc import Sequence

import numpy as np

from sms_handover.types import Array
from sms_handover.units import NS_PER_S

_HEAD = struct.Struct("<4siI")  # encapsulation, seconds, nanoseconds
_STAMP = struct.Struct("<iI")
_STAMP_AT = 4  # [byte] behind the encapsulation header
_BODY_AT = _STAMP_AT + _STAMP.size
_DOUBLE = 8  # [byte]
_SPARE = 8  # [byte] that rclpy may put behind the end of a message
_FLOAT64 = np.dtype("<f8")
_LITTLE_ENDIAN = b"\x00\x01"  # encapsulation of plain CDR; the two bytes behind it mean nothing


def head(stamp_ns: int) -> bytes:
    """Return how a message with a stamp begins: encapsulation and time, which are all of a Clock."""
    return _HEAD.pack(_LITTLE_ENDIAN + bytes(2), stamp_ns // NS_PER_S, stamp_ns % NS_PER_S)


class Template:
    """Packs and takes apart the messages of one layout.

    ``parts`` are where its blocks of numbers stand in the array that :meth:`numbers` returns.
    """

    def __init__(self, example: bytes, blocks: Sequence[Array]) -> None:
        """Exchange stamp and ``blocks`` of a message, which stand in it in this order and only there."""
        starts = [example.index(block.tobytes()) for block in blocks]
        ends = [start + block.nbytes for start, block in zip(starts, blocks, strict=True)]
        fixed = list(zip([_BODY_AT, *ends], [*starts, len(example)], strict=True))
        counts = [block.nbytes for block in blocks]
        layout = "".join(f"{end - begin}s{n}x" for (begin, end), n in zip(fixed, [*counts, 0], strict=True))
        self._unpack = struct.Struct(f"<2s2xiI{layout}").unpack_from
        self._fixed = [example[begin:end] for begin, end in fixed]
        self._size = len(example)
        self._first_at, self._count = starts[0], (ends[-1] - starts[0]) // _DOUBLE
        self.parts = tuple(
            slice((start - starts[0]) // _DOUBLE, (end - starts[0]) // _DOUBLE)
            for start, end in zip(starts, ends, strict=True)
        )
        self._buffer = bytearray(example)
        numbers = self.numbers(self._buffer)
        self._places = tuple(numbers[part] for part in self.parts)

    def stamp_of(self, data: bytes) -> int | None:
        """Return the stamp of a message in ns, None if it is of another layout or from before time zero."""
        if not 0 <= len(data) - self._size <= _SPARE:
            return None
        encapsulation, seconds, nanoseconds, *fixed = self._unpack(data)
        if fixed != self._fixed or encapsulation != _LITTLE_ENDIAN or seconds < 0:
            return None
        return int(seconds * NS_PER_S + nanoseconds)

    def numbers(self, data: bytes | bytearray) -> Array:
        """Return everything from the first number of a message of this layout to the last.

        What stands between two blocks is their length; taken for a number it is finite.
        """
        return np.frombuffer(data, _FLOAT64, self._count, self._first_at)

    def pack(self, stamp_ns: int, *blocks: Array) -> bytes:
        """Return the bytes of a message with a stamp and all its blocks."""
        _STAMP.pack_into(self._buffer, _STAMP_AT, stamp_ns // NS_PER_S, stamp_ns % NS_PER_S)
        for place, block in zip(self._places, blocks, strict=True):
            place[:] = block
        return bytes(self._buffer)
