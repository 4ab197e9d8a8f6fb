"""Loop record: the wall times of the ticks of a recorded run."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from sms_handover.bag.files import read_messages
from sms_handover.bag.info import read_info
from sms_handover.bag.run.collector import decoder
from sms_handover.bag.run.reader import find_namespace
from sms_handover.bag.run.series import RowCollector, Series
from sms_handover.graph import topics
from sms_handover.messages.stamps import stamp_ns
from sms_handover.run_data import Array, Stamps
from sms_handover.units import NS_PER_S


@dataclass(frozen=True, eq=False)
class LoopRecord:
    """The course of a run in wall time.

    Rows per tick (N,): ``tick_ns``, and ``wall`` s, when the recorder received its state, since the
    first one. Rows per LoopTiming message of the plant (M,): ``report_ns``; ``ticks``,
    ``late_ticks`` and ``held_commands`` since the start; ``period_mean``, ``period_std`` and
    ``period_max`` s between the ticks since the previous report.
    """

    tick_ns: Stamps
    wall: Array
    report_ns: Stamps
    ticks: Array
    late_ticks: Array
    held_commands: Array
    period_mean: Array
    period_std: Array
    period_max: Array

    def __post_init__(self) -> None:
        for item in fields(self):
            getattr(self, item.name).setflags(write=False)


_REPORTED = ("ticks", "late_ticks", "held_commands", "period_mean", "period_std", "period_max")


def read_loop(path: Path, namespace: str | None = None) -> LoopRecord:
    """Return the wall times of the run in the bag at ``path``, of the last one after a reset.

    ``namespace`` is that of the graph; without it the bag must hold one run only. Raises BagError
    if the bag is missing or damaged, was not closed, or holds no run.
    """
    info = read_info(path)
    prefix = find_namespace(info) if namespace is None else namespace.rstrip("/")
    states, reports = (f"{prefix}/{name}" for name in (topics.JOINT_STATES, topics.LOOP_TIMING))
    collected = RowCollector(len(_REPORTED), _reported)
    collect = decoder(info, reports, collected.add)
    stamps: list[int] = []
    walls: list[int] = []
    for message in read_messages(path, {states, reports}):
        if message.topic == states:
            stamps.append(stamp_ns(message.data))
            walls.append(message.publish_time_ns)
        else:
            collect(message.data)
    wall_ns = np.array(walls, dtype=np.int64)
    since = (wall_ns - wall_ns[:1]) / NS_PER_S
    arrived = Series(np.array(stamps, dtype=np.int64), since.reshape(-1, 1)).settled()
    reported = collected.series().settled()
    wall = arrived.values[:, 0] - arrived.values[:1, 0]
    columns = map(np.array, reported.values.T)
    return LoopRecord(arrived.stamp_ns, wall, reported.stamp_ns, *columns)


def _reported(message: Any) -> tuple[float, ...]:
    return tuple(float(getattr(message, name)) for name in _REPORTED)
