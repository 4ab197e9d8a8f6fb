"""QoS of a recorded topic, as rosbag2 stores it."""

from dataclasses import dataclass
from enum import Enum

from rosbags.rosbag2.errors import ReaderError
from rosbags.rosbag2.metadata import dump_qos_v9, parse_qos


class Reliability(Enum):
    """Whether a lost sample is sent again."""

    RELIABLE = "reliable"
    BEST_EFFORT = "best_effort"


class Durability(Enum):
    """Whether a late subscriber still gets the last samples."""

    VOLATILE = "volatile"
    TRANSIENT_LOCAL = "transient_local"


class History(Enum):
    """How many samples a publisher keeps."""

    KEEP_LAST = "keep_last"
    KEEP_ALL = "keep_all"
    UNKNOWN = "unknown"  # what discovery reports of a remote publisher


@dataclass(frozen=True)
class Qos:
    """What a publisher of a recorded topic offered; deadline, lifespan and lease are infinite."""

    reliability: Reliability = Reliability.RELIABLE
    durability: Durability = Durability.VOLATILE
    history: History = History.KEEP_LAST
    depth: int = 10

    def to_rosbag2(self) -> dict[str, object]:
        """Return the profile as version 9 of the rosbag2 metadata writes it."""
        return {
            "history": self.history.value,
            "depth": self.depth,
            "reliability": self.reliability.value,
            "durability": self.durability.value,
            "deadline": _infinite(),
            "lifespan": _infinite(),
            "liveliness": "automatic",
            "liveliness_lease_duration": _infinite(),
            "avoid_ros_namespace_conventions": False,
        }


def profiles_of(text: str) -> list[dict[str, object]]:
    """Return the profiles in the YAML text of a channel, of any rosbag2 version, as version 9 writes them.

    Empty if the text is not readable: a profile is no reason to reject a bag.
    """
    try:
        return [dict(profile) for profile in dump_qos_v9(parse_qos(text))]
    except (ReaderError, LookupError, TypeError, AttributeError):
        return []


def _infinite() -> dict[str, int]:
    """Return the duration that ROS 2 takes as infinite."""
    return {"sec": 9223372036, "nsec": 854775807}
