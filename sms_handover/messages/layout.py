"""CDR layouts of messages whose numbers are float64: all messages of one publisher share that of a prototype.

They differ only in stamp and numbers. One compiled struct takes a message apart into its stamp and
everything that must be as in the prototype; the numbers are views of its bytes.
"""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sms_handover.errors import BagError
from sms_handover.messages.stamps import stamp_ns
from sms_handover.types import Array
from sms_handover.units import NS_PER_S

_HEAD = struct.Struct("<4siI")  # encapsulation, seconds, nanoseconds
_ORIGIN = 4  # [byte] size of the encapsulation, from behind which CDR aligns
_BODY_AT = 12  # [byte] end of the stamp
_DOUBLE = 8  # [byte]
_SPARE = 8  # [byte] that rclpy may put behind the end of a message
_LITTLE_ENDIAN = b"\x00\x01"  # encapsulation of plain CDR; the two bytes behind it mean nothing

Block = tuple[int, int]  # [byte] begin and end of an array of float64 in a message


@dataclass(frozen=True)
class Shape:
    """What a message is made of behind its stamp: names and blocks of numbers, up to byte ``end``."""

    little_endian: bool
    names: tuple[str, ...]
    blocks: tuple[Block, ...]
    end: int


Parse = Callable[[bytes], Shape]


def joint_state(data: bytes) -> Shape:
    """Return the shape of a JointState: its joint names; blocks position, velocity, effort.

    Raises BagError if it is malformed, as all functions of this kind do.
    """
    cursor = _Cursor(data)
    cursor.text()  # frame_id
    names = tuple(cursor.text() for _ in range(cursor.count()))
    blocks = []
    for quantity in ("position", "velocity", "effort"):
        count = cursor.count()
        if count not in {0, len(names)}:
            raise BagError(f"a JointState has {len(names)} names but {count} values of {quantity}")
        blocks.append(cursor.doubles(count))
    return cursor.shape(names, blocks)


def odometry(data: bytes) -> Shape:
    """Return the shape of an Odometry: its frames; blocks pose, covariance (36), twist, covariance (36)."""
    cursor = _Cursor(data)
    frames = (cursor.text(), cursor.text())
    return cursor.shape(frames, [cursor.doubles(count) for count in (7, 36, 6, 36)])


def numbers_behind_header(count: int) -> Parse:
    """Return the parser of a message that is a header and ``count`` doubles, e.g. a PoseStamped."""

    def parse(data: bytes) -> Shape:
        cursor = _Cursor(data)
        return cursor.shape((cursor.text(),), [cursor.doubles(count)])

    return parse


def head(stamp_ns: int) -> bytes:
    """Return how a message with a stamp begins: encapsulation and time, which are all of a Clock."""
    return _HEAD.pack(_LITTLE_ENDIAN + bytes(2), stamp_ns // NS_PER_S, stamp_ns % NS_PER_S)


class Layout:
    """Packs and reads the messages that are like a prototype in all but stamp and numbers.

    ``blocks`` are where the wanted ones stand in a message, ``parts`` where in :meth:`numbers`.
    """

    def __init__(self, prototype: bytes, parse: Parse, wanted: Sequence[int]) -> None:
        """Find the blocks of a prototype; raises BagError if it is malformed."""
        self.shape = parse(prototype)
        self.blocks = tuple(self.shape.blocks[index] for index in wanted)
        order = "<" if self.shape.little_endian else ">"
        self._dtype = np.dtype(f"{order}f8")
        self._stamp = struct.Struct(f"{order}iI")
        ends = [_BODY_AT, *(end for _, end in self.shape.blocks)]
        starts = [*(start for start, _ in self.shape.blocks), self.shape.end]
        fields, self._fixed = f"{order}2s2xiI", []
        place = _BODY_AT
        for begin, end in zip(ends, starts, strict=True):
            if end > begin:
                fields += f"{begin - place}x{end - begin}s"
                self._fixed.append(prototype[begin:end])
                place = end
        self._unpack = struct.Struct(f"{fields}{self.shape.end - place}x").unpack_from
        self._encapsulation = prototype[:2]
        first, last = self.blocks[0][0], self.blocks[-1][1]
        self._first, self._count = first, (last - first) // _DOUBLE
        self.parts = tuple(
            slice((start - first) // _DOUBLE, (end - first) // _DOUBLE) for start, end in self.blocks
        )
        self._buffer = bytearray(prototype[: self.shape.end])
        numbers = self.numbers(self._buffer)
        self._places = tuple(numbers[part] for part in self.parts)

    def stamp_of(self, data: bytes) -> int | None:
        """Return the stamp of a message in ns, None if it is of another layout or from before time zero."""
        if not 0 <= len(data) - self.shape.end <= _SPARE:
            return None
        encapsulation, seconds, nanoseconds, *fixed = self._unpack(data)
        if fixed != self._fixed or encapsulation != self._encapsulation or seconds < 0:
            return None
        return int(seconds * NS_PER_S + nanoseconds)

    def numbers(self, data: bytes | bytearray) -> Array:
        """Return everything from the first wanted number of a message of this layout to the last.

        What stands between two blocks is their length; taken for a number it is finite.
        """
        return np.frombuffer(data, self._dtype, self._count, self._first)

    def pack(self, stamp_ns: int, *blocks: Array) -> bytes:
        """Return the bytes of a message with a stamp and all wanted blocks; the rest is the prototype's."""
        self._stamp.pack_into(self._buffer, _ORIGIN, stamp_ns // NS_PER_S, stamp_ns % NS_PER_S)
        for place, block in zip(self._places, blocks, strict=True):
            place[:] = block
        return bytes(self._buffer)


class _Cursor:
    """A place in CDR bytes, behind the stamp at first."""

    def __init__(self, data: bytes) -> None:
        """Begin behind the stamp; raises BagError if the bytes are not plain CDR with one."""
        stamp_ns(data)
        self._little_endian = bool(data[1])
        self._data = data
        self._place = _BODY_AT
        self._unsigned = struct.Struct("<I" if self._little_endian else ">I")

    def shape(self, names: tuple[str, ...], blocks: Sequence[Block]) -> Shape:
        return Shape(self._little_endian, names, tuple(blocks), self._place)

    def count(self) -> int:
        begin, self._place = self._span(4, 4)
        return int(self._unsigned.unpack_from(self._data, begin)[0])

    def text(self) -> str:
        begin, self._place = self._span(self.count(), 1)
        return self._data[begin : self._place].rstrip(b"\0").decode(errors="replace")

    def doubles(self, count: int) -> Block:
        if count == 0:
            return self._place, self._place
        begin, self._place = self._span(count * _DOUBLE, _DOUBLE)
        return begin, self._place

    def _span(self, size: int, alignment: int) -> Block:
        """Return begin and end of the next item; raises BagError beyond the end of the bytes."""
        begin = self._place + -(self._place - _ORIGIN) % alignment
        if begin + size > len(self._data):
            raise BagError(f"a message of {len(self._data)} bytes is cut short")
        return begin, begin + size
