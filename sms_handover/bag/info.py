"""What a bag says of itself: topics, times, loss ledger, provenance and the files attached to it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

from mcap.reader import make_reader
from mcap.records import Schema, Statistics
from mcap.summary import Summary

from sms_handover.bag.attachments import PARAMETERS_FILE, ROBOT_FILE, SCHEDULE_FILE, parameters_from_json
from sms_handover.bag.files import bag_files, damage_reported
from sms_handover.bag.ledger import LEDGER_RECORD, Ledger
from sms_handover.bag.mcap.summary import file_summary
from sms_handover.bag.provenance import PROVENANCE_RECORD


@dataclass(frozen=True)
class TopicInfo:
    """One topic of a bag; ``qos`` is the YAML text of the profiles that its publishers offered."""

    name: str
    type: str
    message_count: int
    encoding: str
    schema_encoding: str
    schema_text: str
    qos: str
    type_hash: str


@dataclass(frozen=True)
class BagInfo:
    """What a bag holds, without its messages; times are log time, which is simulation time in our bags.

    ``channels`` has an entry for each type, encoding and definition of a topic, ``topics`` the first of each.
    """

    path: Path
    files: tuple[Path, ...]
    size: int
    profile: str
    library: str
    start_ns: int
    end_ns: int
    channels: tuple[TopicInfo, ...]
    topics: Mapping[str, TopicInfo]
    records: Mapping[str, Mapping[str, str]]
    attachments: Mapping[str, bytes]

    @property
    def message_count(self) -> int:
        """Return the number of messages of all topics."""
        return sum(topic.message_count for topic in self.channels)

    @property
    def duration_ns(self) -> int:
        """Return the time from the first message to the last."""
        return self.end_ns - self.start_ns

    @property
    def ledger(self) -> Ledger | None:
        """Return the loss ledger, None if the recorder kept none."""
        record = self.records.get(LEDGER_RECORD)
        return None if record is None else Ledger.from_record(record)

    @property
    def provenance(self) -> Mapping[str, str]:
        """Return versions, revision, seed and start; empty if the bag is not ours."""
        return self.records.get(PROVENANCE_RECORD, MappingProxyType({}))

    @property
    def parameters(self) -> Mapping[str, Mapping[str, object]]:
        """Return the parameters by node and name; empty if the bag holds none."""
        text = self._text(PARAMETERS_FILE)
        return {} if text is None else parameters_from_json(text)

    @property
    def schedule_text(self) -> str | None:
        """Return the YAML text of the task schedule, None if the bag holds none."""
        return self._text(SCHEDULE_FILE)

    @property
    def urdf_text(self) -> str | None:
        """Return the robot description, None if the bag holds none."""
        return self._text(ROBOT_FILE)

    def _text(self, name: str) -> str | None:
        """Return an attachment as text."""
        content = self.attachments.get(name)
        return None if content is None else content.decode(errors="replace")


def read_info(path: Path) -> BagInfo:
    """Return what the bag at ``path`` (its folder or a file) holds; raises BagError if it is unusable."""
    files = bag_files(path)
    headers, spans = [], []
    channels: dict[TopicInfo, TopicInfo] = {}
    records: dict[str, Mapping[str, str]] = {}
    attachments: dict[str, bytes] = {}
    for file in files:
        with damage_reported(file), file.open("rb") as stream:
            reader = make_reader(stream)
            headers.append(reader.get_header())
            summary, statistics = file_summary(reader, file)
            if statistics.message_count:
                spans.append((statistics.message_start_time, statistics.message_end_time))
            for topic in _topics(summary, statistics):
                same = replace(topic, message_count=0, qos="")
                channels[same] = _joined(channels.get(same), topic)
            records.update((item.name, MappingProxyType(item.metadata)) for item in reader.iter_metadata())
            attachments.update((item.name, item.data) for item in reader.iter_attachments())
    return BagInfo(
        path=path,
        files=files,
        size=sum(file.stat().st_size for file in files),
        profile=headers[0].profile,
        library=headers[0].library,
        start_ns=min((start for start, _ in spans), default=0),
        end_ns=max((end for _, end in spans), default=0),
        channels=tuple(channels.values()),
        topics=MappingProxyType(_first_by_name(channels.values())),
        records=MappingProxyType(records),
        attachments=MappingProxyType(attachments),
    )


def _topics(summary: Summary, statistics: Statistics) -> list[TopicInfo]:
    """Return the channels of a file as topics."""
    nameless = Schema(id=0, data=b"", encoding="", name="")
    channels = [
        (channel, summary.schemas.get(channel.schema_id, nameless)) for channel in summary.channels.values()
    ]
    return [
        TopicInfo(
            name=channel.topic,
            type=schema.name,
            message_count=statistics.channel_message_counts.get(channel.id, 0),
            encoding=channel.message_encoding,
            schema_encoding=schema.encoding,
            schema_text=schema.data.decode(errors="replace"),
            qos=channel.metadata.get("offered_qos_profiles", ""),
            type_hash=channel.metadata.get("topic_type_hash", ""),
        )
        for channel, schema in channels
    ]


def _joined(before: TopicInfo | None, topic: TopicInfo) -> TopicInfo:
    """Return a topic that has a channel already, with the messages of another channel added."""
    if before is None:
        return topic
    return replace(before, message_count=before.message_count + topic.message_count)


def _first_by_name(channels: Iterable[TopicInfo]) -> dict[str, TopicInfo]:
    """Return the first channel of each topic."""
    topics: dict[str, TopicInfo] = {}
    for channel in channels:
        topics.setdefault(channel.name, channel)
    return topics
