"""Columns of numbers from many CDR messages of the loop, without decoding each of them."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sms_handover.bag.run.series import Series
from sms_handover.messages.layout import Layout, Parse, Shape
from sms_handover.messages.stamps import stamp_ns
from sms_handover.run_data import Array


@dataclass
class _Group:
    """Messages of one shape: their rows, and the bytes of each wanted block."""

    layout: Layout
    columns: list[bytearray]
    rows: list[int] = field(default_factory=list)


class BlockCollector:
    """The float64 blocks of the messages of one topic, with their stamps."""

    def __init__(self, parse: Parse, wanted: Sequence[int]) -> None:
        """Use ``parse`` for messages of a layout not seen before; keep the ``wanted`` blocks."""
        self._parse = parse
        self._wanted = tuple(wanted)
        self._stamps: list[int] = []
        self._groups: dict[Shape, _Group] = {}
        self._latest: _Group | None = None

    def add(self, data: bytes) -> None:
        """Take one message; raises BagError if it is malformed."""
        group = self._latest
        stamp = None if group is None else group.layout.stamp_of(data)
        if group is None or stamp is None:
            group, stamp = self._group(data), stamp_ns(data)
        group.rows.append(len(self._stamps))
        self._stamps.append(stamp)
        for (begin, end), column in zip(group.layout.blocks, group.columns, strict=True):
            column.extend(data[begin:end])

    def first_names(self) -> tuple[str, ...]:
        """Return the names in the first message, () if there is none."""
        return next(iter(self._groups)).names if self._groups else ()

    def series(self, block: int, columns: Sequence[str] | int) -> Series:
        """Return one of the wanted blocks, counted from 0, as a series.

        ``columns`` is the width of the block, or the names of its columns: then they are looked
        up among the names in each message, and one that is not there gives NaN.
        """
        names = tuple(map(str, range(columns))) if isinstance(columns, int) else tuple(columns)
        values: Array = np.full((len(self._stamps), len(names)), np.nan)
        for shape, group in self._groups.items():
            order = "<f8" if shape.little_endian else ">f8"
            numbers = np.frombuffer(group.columns[block], dtype=order).reshape(len(group.rows), -1)
            if numbers.shape[1]:
                there = names if isinstance(columns, int) else shape.names
                new = [place for place, name in enumerate(names) if name in there]
                values[np.ix_(group.rows, new)] = numbers[:, [there.index(names[place]) for place in new]]
        return Series(np.array(self._stamps, dtype=np.int64), values)

    def _group(self, data: bytes) -> _Group:
        layout = Layout(data, self._parse, self._wanted)
        new = _Group(layout, [bytearray() for _ in self._wanted])
        self._latest = group = self._groups.setdefault(layout.shape, new)
        group.layout = layout
        return group
