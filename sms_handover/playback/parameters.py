"""Parameters of the player."""

from dataclasses import dataclass

from sms_handover.bag.topic_choice import TopicChoice
from sms_handover.configuration.parameters import parameter
from sms_handover.errors import ConfigurationError


@dataclass(frozen=True)
class PlayerParameters:
    """What to play and how; the values are in ``config/player.yaml``."""

    bag: str = parameter("the bag to play, its folder or its file")
    rate: float = parameter("seconds of the bag per second of wall time", unit="-", maximum=1000.0)
    start_offset: float = parameter("bag time to leave out at the start", unit="s", minimum=0.0)
    duration: float = parameter("bag time to play; 0: to the end", unit="s", minimum=0.0)
    loop: bool = parameter("begin again at the end")
    start_paused: bool = parameter("begin paused")
    topics: tuple[str, ...] = parameter("topics to play; empty: all")
    regex: str = parameter("regular expression; topics that match it are played too")
    exclude_topics: tuple[str, ...] = parameter("topics not to play")
    exclude_regex: str = parameter("regular expression; topics that match it are not played")
    clock: float = parameter(
        "rate of a generated /clock instead of the recorded one; 0: the recorded one, if any",
        unit="Hz",
        minimum=0.0,
        maximum=10_000.0,
    )
    qos_overrides: str = parameter("YAML file with policies by topic that replace the recorded ones")
    wait: float = parameter(
        "wall time to wait until every topic has a subscriber; 0: only those already there are waited for",
        unit="s",
        minimum=0.0,
    )
    ack_timeout: float = parameter(
        "wall time at the end for subscribers to confirm what has been sent", unit="s", minimum=0.0
    )
    read_ahead: int = parameter("messages held in memory at most", minimum=1, maximum=1_000_000)
    keyboard: bool = parameter("take keys if standard input is a terminal")

    def __post_init__(self) -> None:
        """Refuse a rate that is not positive, and no bag."""
        if self.rate <= 0.0:
            raise ConfigurationError(f"parameter 'rate' is {self.rate:g}, allowed is more than 0")
        if not self.bag:
            raise ConfigurationError("parameter 'bag' is empty, expected the path of a bag")

    @property
    def choice(self) -> TopicChoice:
        """Return which topics are wanted; a generated clock takes the place of a recorded one."""
        excluded = (*self.exclude_topics, "/clock") if self.clock else self.exclude_topics
        return TopicChoice(self.topics, self.regex, excluded, self.exclude_regex)
