"""Message filter: incoming messages are checked; those rejected are counted and reported, never used."""

from collections import Counter
from collections.abc import Callable
from time import monotonic
from typing import TypeVar

from sms_handover.errors import MessageError, Reason
from sms_handover.ros.transport.inputs import OnSerialized
from sms_handover.ros.transport.publisher_identity import PublisherIdentity

T = TypeVar("T")
Decode = Callable[[bytes], T]  # CDR bytes to the content of a good message; raises MessageError on others
OnMessage = Callable[[T, int], None]  # content of a message; wall time in ns at which it was sent
OnFirst = Callable[[str, MessageError], None]  # topic and error of the first rejection of its kind

_REPORT_S = 1.0  # [s] of wall time at least between two lines of the log


class MessageFilter:
    """Counts the messages that a node has rejected, by topic and reason, and reports them.

    The first of each topic and reason is reported at once; of a thousand more in a second the log has one
    line, with the latest of them and how many.
    """

    def __init__(self, log: Callable[[str], None], on_first: OnFirst) -> None:
        """Write lines with ``log``; call ``on_first`` for the first rejection of each topic and reason."""
        self._log = log
        self._on_first = on_first
        self._counts: Counter[tuple[str, Reason]] = Counter()
        self._unreported = 0
        self._latest = ""
        self._reported_at = -_REPORT_S

    @property
    def counts(self) -> dict[str, int]:
        """How many were rejected in all by topic and reason, e.g. ``joint_command: not finite``."""
        return {f"{topic}: {reason.value}": count for (topic, reason), count in self._counts.items()}

    def reject(self, topic: str, error: MessageError) -> None:
        """Count a message that is rejected."""
        kind = topic, error.reason
        self._counts[kind] += 1
        if self._counts[kind] == 1:
            self._on_first(topic, error)
            return
        self._unreported += 1
        self._latest = f"{topic}: rejected, {error.reason.value}: {error}"
        self.report()

    def report(self) -> None:
        """Write what has not been reported yet, unless the last line is too young."""
        now = monotonic()
        if self._unreported and now - self._reported_at >= _REPORT_S:
            more = f" ({self._unreported - 1} more since the last line)" if self._unreported > 1 else ""
            self._log(self._latest + more)
            self._unreported, self._reported_at = 0, now

    def wrap(
        self,
        topic: str,
        on_message: OnMessage[T],
        decode: Decode[T],
        identity: PublisherIdentity | None = None,
    ) -> OnSerialized:
        """Return a callback that hands on the content of good messages, and counts the others.

        ``on_message`` may reject a message too by a MessageError, as long as it has not used it.
        """

        def on_data(data: bytes, sent_ns: int, publisher: bytes) -> None:
            try:
                if identity is not None and publisher not in identity.own:
                    identity.require(publisher)
                on_message(decode(data), sent_ns)
            except MessageError as error:
                self.reject(topic, error)

        return on_data
