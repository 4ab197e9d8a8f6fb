"""Series of values with stamps, and how they are aligned."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sms_handover.messages.values import header_ns
from sms_handover.run_data import Array, Stamps


@dataclass(frozen=True, eq=False)
class Series:
    """Rows of numbers (N, width) with their stamps (N,), one per message."""

    stamp_ns: Stamps
    values: Array

    def settled(self) -> "Series":
        """Return the last run in the series, in the order of time, each stamp once.

        A stamp that goes back to the first one or before begins a new run (a reset); any other that
        goes back is a late message. Of equal stamps the first counts.
        """
        stamps = self.stamp_ns
        restarts = np.flatnonzero((np.diff(stamps) < 0) & (stamps[1:] <= stamps[:1])) + 1
        begin = int(restarts[-1]) if len(restarts) else 0
        unique, first = np.unique(stamps[begin:], return_index=True)
        return Series(unique, self.values[begin:][first])

    def at(self, stamp_ns: Stamps) -> Array:
        """Return the rows of a settled series at the given stamps, NaN where there is none."""
        rows = np.full((len(stamp_ns), self.values.shape[1]), np.nan)
        if len(self.stamp_ns):
            place = np.minimum(np.searchsorted(self.stamp_ns, stamp_ns), len(self.stamp_ns) - 1)
            there = self.stamp_ns[place] == stamp_ns
            rows[there] = self.values[place[there]]
        return rows


class RowCollector:
    """Rows of numbers taken from decoded messages, with their stamps."""

    def __init__(self, width: int, values: Callable[[Any], tuple[float, ...]]) -> None:
        """Take ``width`` numbers by ``values`` from each message."""
        self._width = width
        self._values = values
        self._stamps: list[int] = []
        self._rows: list[tuple[float, ...]] = []

    def add(self, message: Any) -> None:
        """Take one decoded message with a header."""
        self._rows.append(self._values(message))
        self._stamps.append(header_ns(message))

    def series(self) -> Series:
        """Return the rows taken so far."""
        rows = np.array(self._rows, dtype=np.float64).reshape(-1, self._width)
        return Series(np.array(self._stamps, dtype=np.int64), rows)
