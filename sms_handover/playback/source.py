"""Playback source: the topics and times of a bag to play, and their messages."""

from collections import deque
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from sms_handover.bag.files import RawMessage
from sms_handover.bag.info import BagInfo
from sms_handover.bag.time_order import TimeSpan, messages_by_time
from sms_handover.errors import ConfigurationError
from sms_handover.units import ns_to_seconds, seconds_to_ns

TopicKey = tuple[str, str]  # name and type of a topic


@dataclass(frozen=True)
class PlaybackSource:
    """Topics of a bag within a time span; ``latched`` is the number of messages kept by latched topic."""

    path: Path
    topics: Collection[TopicKey]
    latched: Mapping[TopicKey, int]
    bag_start_ns: int
    span: TimeSpan

    def read(self, from_ns: int) -> Iterator[RawMessage]:
        """Yield the messages from a bag time on, after the latched ones that a subscriber would have then."""
        later = self._messages(self.topics, TimeSpan(from_ns, self.span.end_ns))
        return chain(self._latched_at(from_ns), later)

    def _messages(self, topics: Collection[TopicKey], span: TimeSpan) -> Iterator[RawMessage]:
        """Return the messages of some topics."""
        messages = messages_by_time(self.path, {name for name, _ in topics}, span)
        return (message for message in messages if (message.topic, message.type) in topics)

    def _latched_at(self, from_ns: int) -> Iterator[RawMessage]:
        """Yield the latched messages that a subscriber joining at that time would have received."""
        if from_ns <= self.bag_start_ns or not self.latched:
            return
        kept = {key: deque[RawMessage](maxlen=depth) for key, depth in self.latched.items()}
        for message in self._messages(kept, TimeSpan(self.bag_start_ns, from_ns - 1)):
            if (message.topic, message.type) in self.topics:
                kept[message.topic, message.type].append(message)
        yield from sorted(chain.from_iterable(kept.values()), key=lambda message: message.log_time_ns)


def span_of(info: BagInfo, start_offset_s: float, duration_s: float) -> TimeSpan:
    """Return the time span to play, all if ``duration_s`` is 0; raises ConfigurationError past the end."""
    if start_offset_s > ns_to_seconds(info.duration_ns):
        raise ConfigurationError(
            f"start offset is {start_offset_s:g} s, must be <= {ns_to_seconds(info.duration_ns):g} s, "
            f"the length of {info.path}"
        )
    start_ns = info.start_ns + seconds_to_ns(start_offset_s)
    end_ns = min(info.end_ns, start_ns + seconds_to_ns(duration_s)) if duration_s else info.end_ns
    return TimeSpan(start_ns, end_ns)
