"""Parameters of the recorder."""

from dataclasses import dataclass

from sms_handover.bag.split import Split
from sms_handover.bag.topic_choice import TopicChoice
from sms_handover.configuration.parameters import parameter
from sms_handover.units import seconds_to_ns

_BYTES_PER_MB = 1e6


@dataclass(frozen=True)
class RecorderParameters:
    """Where and what to record; the values are in ``config/recorder.yaml``."""

    folder: str = parameter("new folder for the bag; empty: handover_<date>_<time> in the current folder")
    record_all: bool = parameter("record topics beyond those of the graph too")
    niceness: int = parameter(
        "niceness of the recorder, as in nice(1), so that the loop comes first; in real time at most 3",
        minimum=0,
        maximum=19,
    )
    split_duration: float = parameter(
        "simulated time after which the bag is split; 0: never", unit="s", minimum=0.0
    )
    split_size: float = parameter("size after which the bag is split; 0: never", unit="MB", minimum=0.0)
    drain_timeout: float = parameter(
        "wall time without messages after which the recorder stops waiting for the end", unit="s", minimum=0.1
    )

    @property
    def split(self) -> Split:
        """Return when the bag is split."""
        return _split(self.split_duration, self.split_size)


@dataclass(frozen=True)
class TopicRecorderParameters:
    """What to record of any graph; the values are in ``config/topic_recorder.yaml``."""

    folder: str = parameter("new folder for the bag; empty: rosbag2_<date>-<time> in the current folder")
    topics: tuple[str, ...] = parameter("topics to record; empty: all")
    regex: str = parameter("regular expression; topics that match it are recorded too")
    exclude_topics: tuple[str, ...] = parameter("topics not to record")
    exclude_regex: str = parameter("regular expression; topics that match it are not recorded")
    duration: float = parameter("wall time to record; 0: until interrupted", unit="s", minimum=0.0)
    split_duration: float = parameter(
        "wall time after which the bag is split; 0: never", unit="s", minimum=0.0
    )
    split_size: float = parameter("size after which the bag is split; 0: never", unit="MB", minimum=0.0)

    @property
    def split(self) -> Split:
        """Return when the bag is split."""
        return _split(self.split_duration, self.split_size)

    @property
    def choice(self) -> TopicChoice:
        """Return the choice of topics."""
        return TopicChoice(self.topics, self.regex, self.exclude_topics, self.exclude_regex)


def _split(duration_s: float, size_mb: float) -> Split:
    """Return the split at a duration in s and a size in MB."""
    return Split(seconds_to_ns(duration_s), round(size_mb * _BYTES_PER_MB))
