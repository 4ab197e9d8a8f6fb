"""Recordings of the runs of a graph that is reset: one bag per run."""

from collections.abc import Callable, Iterator, Sequence
from itertools import count
from pathlib import Path
from typing import NamedTuple

from sms_handover.bag.ledger import Ledger
from sms_handover.bag.qos import Qos
from sms_handover.bag.recording import Recording
from sms_handover.bag.split import Split
from sms_handover.messages.message_types import MessageTypes


class _Topic(NamedTuple):
    name: str
    type: str
    qos: Sequence[Qos]
    period_ns: int


class RunRecordings:
    """The recording of the current run, after those of earlier runs, which are closed.

    The first is in ``folder``, the next in ``<folder>_2``, ``<folder>_3`` and so on, skipping folders
    that exist.
    """

    def __init__(
        self, folder: Path, describe: Callable[[Recording], None], split: Split | None = None
    ) -> None:
        """Open the first recording; ``describe`` is called with each new one. Raises BagError."""
        self.types = MessageTypes()
        self._describe = describe
        self._split = split
        self._topics: list[_Topic] = []
        self._folders = _folders(folder)
        self._complete = True
        self._current = self._open()

    @property
    def current(self) -> Recording:
        """Return the recording of the current run."""
        return self._current

    @property
    def complete(self) -> bool:
        """Whether nothing is known to be missing in the closed recordings."""
        return self._complete

    def add_topic(self, name: str, type_name: str, qos: Sequence[Qos] = (), period_ns: int = 0) -> None:
        """Open a topic in this and all later recordings; raises BagError."""
        self._current.add_topic(name, type_name, qos, period_ns)
        self._topics.append(_Topic(name, type_name, qos, period_ns))

    def begin_next(self) -> Ledger:
        """Close the recording and open the next; return the ledger of the closed one."""
        ledger = self.close()
        self._current = self._open()
        for topic in self._topics:
            self._current.add_topic(*topic)
        self._current.begin()
        return ledger

    def close(self) -> Ledger:
        """Close the current recording and return its ledger; idempotent."""
        self._current.close()
        ledger = self._current.ledger
        self._complete = self._complete and ledger.complete
        return ledger

    def _open(self) -> Recording:
        recording = Recording(next(self._folders), types=self.types, split=self._split)
        self._describe(recording)
        return recording


def _folders(first: Path) -> Iterator[Path]:
    yield first
    for number in count(2):
        folder = first.with_name(f"{first.name}_{number}")
        if not folder.exists():
            yield folder
