"""Gather numbers from many CDR messages of the loop's types at once, without decoding each of them.

Messages of one publisher differ only in stamp and numbers. So the first message is parsed, and
from each further one that is alike in everything else the blocks of float64 are taken as bytes.
"""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from sms_handover.bag.run.series import Series
from sms_handover.errors import BagError
from sms_handover.messages.stamps import stamp_ns
from sms_handover.run_data import Array

_ORIGIN = 4  # [byte] CDR aligns from behind the encapsulation header
_STAMP_END = 12  # [byte]
_DOUBLE = 8  # [byte]


@dataclass(frozen=True)
class Layout:
    """Where the numbers of a message are: ``texts`` it begins with, ``blocks`` as (offset, end)."""

    little_endian: bool
    texts: tuple[str, ...]
    blocks: tuple[tuple[int, int], ...]


@dataclass
class _Group:
    """Messages of one layout; ``fixed`` are the bytes that a message must share to be taken unparsed."""

    layout: Layout
    fixed: list[tuple[int, int, bytes]]
    size: int
    rows: list[int] = field(default_factory=list)
    wanted: list[tuple[int, int, bytearray]] = field(default_factory=list)

    def fits(self, data: bytes) -> bool:
        """Whether a message has this layout for sure."""
        return len(data) == self.size and all(data[begin:end] == same for begin, end, same in self.fixed)


class BlockCollector:
    """The float64 blocks of the messages of one topic, with their stamps."""

    def __init__(self, parse: Callable[[bytes], Layout], wanted: Sequence[int]) -> None:
        """Use ``parse`` for messages of a form not seen before; keep the ``wanted`` blocks of a layout."""
        self._parse = parse
        self._wanted = tuple(wanted)
        self._stamps: list[int] = []
        self._groups: dict[Layout, _Group] = {}
        self._last: _Group | None = None

    def add(self, data: bytes) -> None:
        """Take one message; raises BagError if it is malformed."""
        group = self._last
        if group is None or not group.fits(data):
            group = self._last = self._group(data)
        group.rows.append(len(self._stamps))
        self._stamps.append(stamp_ns(data))
        for begin, end, numbers in group.wanted:
            numbers.extend(data[begin:end])

    def first_texts(self) -> tuple[str, ...]:
        """Return the texts of the first message, () if there is none."""
        return next(iter(self._groups)).texts if self._groups else ()

    def series(self, block: int, columns: Sequence[str] | int) -> Series:
        """Return one of the wanted blocks, counted from 0, as a series.

        ``columns`` is the width of the block, or the names of its columns: then they are looked
        up among the texts of each message, and a name that is not there gives NaN.
        """
        names = tuple(map(str, range(columns))) if isinstance(columns, int) else tuple(columns)
        values: Array = np.full((len(self._stamps), len(names)), np.nan)
        for group in self._groups.values():
            order = "<f8" if group.layout.little_endian else ">f8"
            numbers = np.frombuffer(group.wanted[block][2], dtype=order).reshape(len(group.rows), -1)
            if numbers.shape[1]:
                there = names if isinstance(columns, int) else group.layout.texts
                new = [place for place, name in enumerate(names) if name in there]
                values[np.ix_(group.rows, new)] = numbers[:, [there.index(names[place]) for place in new]]
        return Series(np.array(self._stamps, dtype=np.int64), values)

    def _group(self, data: bytes) -> _Group:
        """Return the group of a message of another form than the last one."""
        layout = self._parse(data)
        ends = [_STAMP_END, *(end for _, end in layout.blocks)]
        begins = [*(begin for begin, _ in layout.blocks), len(data)]
        fixed = [(0, _ORIGIN, data[:_ORIGIN])]
        fixed += [
            (end, begin, data[end:begin]) for end, begin in zip(ends, begins, strict=True) if end < begin
        ]
        group = self._groups.setdefault(layout, _Group(layout, fixed, len(data)))
        group.fixed, group.size = fixed, len(data)
        if not group.wanted:
            group.wanted = [(*layout.blocks[index], bytearray()) for index in self._wanted]
        return group


def joint_state_layout(data: bytes) -> Layout:
    """Return the layout of a JointState: its names; blocks position, velocity, effort."""
    cursor = _Cursor(data)
    cursor.text()  # frame_id
    names = tuple(cursor.text() for _ in range(cursor.count()))
    blocks = []
    for quantity in ("position", "velocity", "effort"):
        count = cursor.count()
        if count not in {0, len(names)}:
            raise BagError(f"a JointState has {len(names)} names but {count} values of {quantity}")
        blocks.append(cursor.doubles(count))
    return Layout(cursor.little_endian, names, tuple(blocks))


def odometry_layout(data: bytes) -> Layout:
    """Return the layout of an Odometry: blocks pose (7), its covariance, twist (6), its covariance."""
    cursor = _Cursor(data)
    frames = (cursor.text(), cursor.text())
    return Layout(cursor.little_endian, frames, tuple(cursor.doubles(count) for count in (7, 36, 6, 36)))


class _Cursor:
    """A place in CDR bytes, behind the stamp at first."""

    def __init__(self, data: bytes) -> None:
        """Begin behind the stamp; raises BagError if the bytes are not plain CDR with one."""
        stamp_ns(data)
        self.little_endian = bool(data[1])
        self._data = data
        self._place = _STAMP_END
        self._unsigned = struct.Struct("<I" if self.little_endian else ">I")

    def count(self) -> int:
        """Read the length of a sequence or text."""
        begin, self._place = self._span(4, 4)
        return int(self._unsigned.unpack_from(self._data, begin)[0])

    def text(self) -> str:
        """Read a text."""
        begin, self._place = self._span(self.count(), 1)
        return self._data[begin : self._place].rstrip(b"\0").decode(errors="replace")

    def doubles(self, count: int) -> tuple[int, int]:
        """Step over numbers and return where they are."""
        if count == 0:
            return self._place, self._place
        begin, self._place = self._span(count * _DOUBLE, _DOUBLE)
        return begin, self._place

    def _span(self, size: int, alignment: int) -> tuple[int, int]:
        """Return begin and end of the next item; raises BagError beyond the end of the bytes."""
        begin = self._place + -(self._place - _ORIGIN) % alignment
        if begin + size > len(self._data):
            raise BagError(f"a message of {len(self._data)} bytes is cut short")
        return begin, begin + size
