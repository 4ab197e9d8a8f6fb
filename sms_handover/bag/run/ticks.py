"""Ticks of a recorded run: the state, and the answer to it."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from sms_handover.bag.files import read_messages
from sms_handover.bag.info import read_info
from sms_handover.bag.run.collector import decoder
from sms_handover.bag.time_order import messages_by_time
from sms_handover.errors import BagError
from sms_handover.graph.topics import (
    APPLIED_BASE_WRENCH,
    BASE_ODOMETRY,
    JOINT_COMMAND,
    JOINT_STATES,
    TASK_PHASE,
)
from sms_handover.messages.values import base_wrench
from sms_handover.types import BaseWrench

_TOPICS = tuple(f"/{name}" for name in (JOINT_STATES, BASE_ODOMETRY, JOINT_COMMAND, TASK_PHASE))


@dataclass(frozen=True)
class RecordedTick:
    """The CDR bytes of one tick; what was not recorded is None."""

    stamp_ns: int
    joint_states: bytes | None
    base_odometry: bytes | None
    joint_command: bytes | None
    task_phase: bytes | None


def recorded_ticks(path: Path) -> Iterator[RecordedTick]:
    """Yield the ticks of a run by their stamp, which is the log time in its bag.

    Raises BagError if the bag holds no run, or if the simulation was reset while it was recorded.
    """
    missing = [name for name in _TOPICS if name not in read_info(path).topics]
    if missing:
        raise BagError(f"{path} holds no run of sms_handover: it has no topic {', '.join(missing)}")
    return _ticks(path)


def recorded_base_wrenches(path: Path) -> tuple[BaseWrench, ...]:
    """Return the wrenches that others asked for and that acted in a run, in order of time."""
    name, found = f"/{APPLIED_BASE_WRENCH}", list[BaseWrench]()
    info = read_info(path)
    if name in info.topics:
        take = decoder(info, name, lambda message: found.append(base_wrench(message)))
        for message in read_messages(path, {name}):
            take(message.data)
    return tuple(found)


def _ticks(path: Path) -> Iterator[RecordedTick]:
    messages = messages_by_time(path, _TOPICS)
    for stamp_ns, group in groupby(messages, key=lambda message: message.log_time_ns):
        found: dict[str, bytes] = {}
        for message in group:
            if message.topic in found:
                raise BagError(
                    f"{path} has two messages on {message.topic} at {stamp_ns} ns: the simulation was "
                    "reset while it was recorded"
                )
            found[message.topic] = message.data
        yield RecordedTick(stamp_ns, *(found.get(name) for name in _TOPICS))
