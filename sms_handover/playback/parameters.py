"""Parameters of the player."""

from dataclasses import dataclass

from sms_handover.bag.topic_choice import TopicChoice
from sms_handover.configuration.parameters import parameter
from sms_handover.errors import ConfigurationError


@dataclass(frozen=True)
class PlayerParameters:
    """Parameters of the player; the values are in ``config/player.yaml``."""

    bag: str = parameter("the bag to play, its folder or its file")
    rate: float = parameter("seconds of the bag per second of wall time", unit="-", maximum=1000.0)
    start_offset: float = parameter("bag time to skip at the start", unit="s", minimum=0.0)
    duration: float = parameter("bag time to play; 0: to the end", unit="s", minimum=0.0)
    loop: bool = parameter("start over at the end")
    start_paused: bool = parameter("start paused")
    topics: tuple[str, ...] = parameter("topics to play; empty: all")
    regex: str = parameter("regular expression; matching topics are played too")
    exclude_topics: tuple[str, ...] = parameter("topics not to play")
    exclude_regex: str = parameter("regular expression; matching topics are not played")
    rename: tuple[str, ...] = parameter("new names, OLD:=NEW, of topics whose recorded names ROS forbids")
    clock: float = parameter(
        "rate of a generated /clock that replaces the recorded one; 0: play the recorded one",
        unit="Hz",
        minimum=0.0,
        maximum=10_000.0,
    )
    qos_overrides: str = parameter("YAML file of QoS policies by topic that override the recorded ones")
    wait: float = parameter(
        "wall time to wait for a subscriber of every topic; 0: wait only for those already there",
        unit="s",
        minimum=0.0,
    )
    ack_timeout: float = parameter("wall time to wait at the end for acknowledgements", unit="s", minimum=0.0)
    read_ahead: int = parameter("largest number of messages held in memory", minimum=1, maximum=1_000_000)
    keyboard: bool = parameter("read keys if standard input is a terminal")

    def __post_init__(self) -> None:
        """Reject a rate that is not positive and an empty path."""
        if self.rate <= 0.0:
            raise ConfigurationError(f"parameter 'rate' is {self.rate:g}, must be > 0")
        for rule in self.rename:
            if rule.count(":=") != 1:
                raise ConfigurationError(f"parameter 'rename' has {rule!r}, must be OLD:=NEW")
        if not self.bag:
            raise ConfigurationError("parameter 'bag' is empty, must be the path of a bag")

    @property
    def choice(self) -> TopicChoice:
        """Return which topics to play; a generated clock replaces a recorded one."""
        excluded = (*self.exclude_topics, "/clock") if self.clock else self.exclude_topics
        return TopicChoice(self.topics, self.regex, excluded, self.exclude_regex)
