"""The door of a node: what comes in is checked, and what is refused is counted and told, never used."""

from collections import Counter
from collections.abc import Callable
from time import monotonic
from typing import TypeVar

from sms_handover.errors import MessageError, Reason
from sms_handover.ros.transport.inputs import Deliver
from sms_handover.ros.transport.publisher_identity import PublisherIdentity

T = TypeVar("T")
Read = Callable[[bytes], T]  # CDR bytes to what is in a good message; raises MessageError on others
Receive = Callable[[T, int], None]  # what is in a message; wall time in ns of its sending
First = Callable[[str, MessageError], None]  # topic and error of the first refusal of its kind

REFUSED = "refused "  # begins the keys in the diagnostics of a node that count its refusals

_TELL_S = 1.0  # [s] of wall time at least between two lines of the log


class MessageFilter:
    """Counts the messages that a node has refused, by topic and reason, and tells of them.

    The first of each topic and reason is told at once; of a thousand more in a second the log has one
    line, with the newest of them and how many.
    """

    def __init__(self, tell: Callable[[str], None], first: First) -> None:
        """Write lines with ``tell``; ``first`` is called with the first refusal of each topic and reason."""
        self._tell = tell
        self._first = first
        self._counts: Counter[tuple[str, Reason]] = Counter()
        self._untold = 0
        self._newest = ""
        self._told_at = -_TELL_S

    @property
    def counts(self) -> dict[str, int]:
        """Return how many were refused in all by topic and reason, e.g. ``joint_command: not finite``."""
        return {f"{topic}: {reason.value}": count for (topic, reason), count in self._counts.items()}

    def add(self, topic: str, error: MessageError) -> None:
        """Count a message that is refused."""
        kind = topic, error.reason
        self._counts[kind] += 1
        if self._counts[kind] == 1:
            self._first(topic, error)
            return
        self._untold += 1
        self._newest = f"{topic}: refused, {error.reason.value}: {error}"
        self.tell()

    def tell(self) -> None:
        """Write what has not been told yet, unless the last line is too young."""
        now = monotonic()
        if self._untold and now - self._told_at >= _TELL_S:
            more = f" ({self._untold - 1} more since the last line)" if self._untold > 1 else ""
            self._tell(self._newest + more)
            self._untold, self._told_at = 0, now

    def guarding(
        self, topic: str, receive: Receive[T], read: Read[T], sender: PublisherIdentity | None = None
    ) -> Deliver:
        """Return what hands on what is in the messages that are good, and counts the others.

        ``receive`` may refuse a message too by a MessageError, as long as it has not used it.
        """

        def take(data: bytes, sent_ns: int, publisher: bytes) -> None:
            try:
                if sender is not None and publisher not in sender.own:
                    sender.require(publisher)
                receive(read(data), sent_ns)
            except MessageError as error:
                self.add(topic, error)

        return take
