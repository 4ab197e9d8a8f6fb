"""Recovery of a bag: what was recovered, and what is lost."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from sms_handover.bag.ledger import Ledger
from sms_handover.bag.mcap.damage import Damage

RECOVERY_RECORD = "sms_handover.recovery"  # name of the metadata record in the bag


@dataclass(frozen=True)
class TopicRecovery:
    """One topic: messages recovered, and messages recorded, None if unknown."""

    name: str
    recovered: int
    recorded: int | None

    @property
    def lost(self) -> int:
        """Return the number of messages known to be lost."""
        return 0 if self.recorded is None else max(0, self.recorded - self.recovered)


@dataclass(frozen=True)
class Recovery:
    """The result of a recovery from ``source`` into the new bag ``folder``.

    ``size`` is what was read [byte], ``closed`` is whether every file had its end,
    ``from_cut_chunk`` counts messages out of chunks cut off by the end of a file, ``missing`` names
    files that ``metadata.yaml`` lists, ``private`` counts records that only their writer understands,
    which are not kept. Times are log
    times, None without messages. ``largest_loss_ns`` is the longest interval of log time without
    messages around damage; unless ``ends_known``, damage reaches an end of the bag, and how much was
    beyond is unknown. ``ledger`` is that of the new bag, None if the old one had none.
    """

    source: Path
    folder: Path
    size: int
    closed: bool
    damages: tuple[Damage, ...]
    topics: tuple[TopicRecovery, ...]
    from_cut_chunk: int
    missing: tuple[str, ...]
    private: int
    start_ns: int | None
    end_ns: int | None
    largest_loss_ns: int
    ends_known: bool
    ledger: Ledger | None

    @property
    def message_count(self) -> int:
        """Return the number of messages recovered."""
        return sum(topic.recovered for topic in self.topics)

    @property
    def losses(self) -> tuple[Damage, ...]:
        """Return the damage that may have cost messages, attachments or records."""
        return tuple(damage for damage in self.damages if not damage.of_index)

    @property
    def lost_bytes(self) -> int:
        """Return the number of unusable bytes of messages, attachments and records."""
        return sum(damage.size for damage in self.losses)

    @property
    def clean(self) -> bool:
        """Whether everything in the files was recovered."""
        return not self.losses and not self.missing and not any(topic.lost for topic in self.topics)

    def to_record(self) -> dict[str, str]:
        """Return the metadata record in the new bag that describes its origin."""
        values: Mapping[str, object] = {
            "source": self.source.name,
            "bytes_read": self.size,
            "bytes_lost": self.lost_bytes,
            "closed": self.closed,
            "files_missing": self.missing,
            "private_records": self.private,
            "damage": [str(damage) for damage in self.damages],
            "messages_lost": {topic.name: topic.lost for topic in self.topics if topic.lost},
            "largest_loss_ns": self.largest_loss_ns,
            "ends_known": self.ends_known,
        }
        return {key: json.dumps(value) for key, value in values.items()}
