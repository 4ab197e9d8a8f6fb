"""Info about a bag: topics, times, loss ledger, provenance and attachments."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

from mcap.records import Schema

from sms_handover.bag.attachments import (
    PARAMETERS_FILE,
    ROBOT_FILE,
    SCENARIO_FILE,
    SCHEDULE_FILE,
    parameters_from_json,
)
from sms_handover.bag.files import check_ends, damage_reported, files_of
from sms_handover.bag.ledger import LEDGER_RECORD, Ledger
from sms_handover.bag.mcap.scan import Source
from sms_handover.bag.mcap.summary import summarize
from sms_handover.bag.provenance import PROVENANCE_RECORD
from sms_handover.bag.schemas import SchemaTypes


@dataclass(frozen=True)
class TopicInfo:
    """One topic and type of a bag; ``qos`` is the YAML text of the profiles that its publishers offered."""

    name: str
    type: str
    message_count: int
    encoding: str
    schema_encoding: str
    schema_text: str
    qos: str
    type_hash: str

    @property
    def types(self) -> SchemaTypes:
        """Return the types of its messages; raises BagError if the schema is not understood."""
        return SchemaTypes(Schema(0, self.schema_text.encode(), self.schema_encoding, self.type))


@dataclass(frozen=True)
class BagInfo:
    """The content of a bag without its messages; times are log time, simulation time if recorded here.

    ``channels`` has an entry for each type, encoding and definition of a topic, ``topics`` the first
    of each name.
    ``missing`` says in words what is not read and why, ``notes`` what else is unusual.
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
    missing: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def message_count(self) -> int:
        """Return the number of messages of all topics."""
        return sum(topic.message_count for topic in self.channels)

    @property
    def duration_ns(self) -> int:
        """Return the log time from the first message to the last."""
        return self.end_ns - self.start_ns

    @property
    def ledger(self) -> Ledger | None:
        """Return the loss ledger, None without one."""
        record = self.records.get(LEDGER_RECORD)
        return None if record is None else Ledger.from_record(record)

    @property
    def provenance(self) -> Mapping[str, str]:
        """Return versions, revision, seed and start; empty without a record."""
        return self.records.get(PROVENANCE_RECORD, MappingProxyType({}))

    @property
    def parameters(self) -> Mapping[str, Mapping[str, object]]:
        """Return the parameters by node and name; empty without the attachment."""
        text = self._text(PARAMETERS_FILE)
        return {} if text is None else parameters_from_json(text)

    @property
    def schedule_text(self) -> str | None:
        """Return the YAML text of the task schedule, None without the attachment."""
        return self._text(SCHEDULE_FILE)

    @property
    def scenario_text(self) -> str | None:
        """Return the YAML text of the scenario, None without the attachment, as in older recordings."""
        return self._text(SCENARIO_FILE)

    @property
    def urdf_text(self) -> str | None:
        """Return the robot description, None without the attachment."""
        return self._text(ROBOT_FILE)

    def _text(self, name: str) -> str | None:
        content = self.attachments.get(name)
        return None if content is None else content.decode(errors="replace")


def read_info(path: Path) -> BagInfo:
    """Return the content of the bag at ``path``, its folder or a file; raises BagError if it is unusable."""
    bag = files_of(path)
    missing = [f"{name} is not there, metadata.yaml lists it" for name in bag.missing]
    stated = sum(bag.counts.values())
    notes = [f"{name} is there, metadata.yaml does not list it" for name in bag.unlisted]
    summaries = []
    channels: dict[TopicInfo, TopicInfo] = {}
    with bag.opened() as files:
        for file in files:
            check_ends(file, path)
            with damage_reported(file):
                summary = summarize(file)
            summaries.append(summary)
            if summary.doubt:
                notes.append(f"{file.name} was scanned: {summary.doubt}")
            missing += map(str, summary.damages)
            for source, count in summary.counts.items():
                topic = _topic(source, count)
                same = replace(topic, message_count=0, qos="")
                first = channels.get(same, topic)
                total = count if first is topic else first.message_count + count
                channels[same] = replace(first, message_count=total)
    found = sum(topic.message_count for topic in channels.values())
    if stated > found:
        text = f"{stated - found} of {stated} messages are missing, as metadata.yaml counts them"
        (missing if bag.missing else notes).append(text)
    topics: dict[str, TopicInfo] = {}
    for topic in channels.values():
        topics.setdefault(topic.name, topic)
    times = [(s.start_ns, s.end_ns) for s in summaries if s.start_ns is not None and s.end_ns is not None]
    return BagInfo(
        path=path,
        files=bag.files,
        size=bag.size,
        profile=summaries[0].header.profile,
        library=summaries[0].header.library,
        start_ns=min((start for start, _ in times), default=0),
        end_ns=max((end for _, end in times), default=0),
        channels=tuple(channels.values()),
        topics=MappingProxyType(topics),
        records=MappingProxyType(
            {item.name: MappingProxyType(item.metadata) for s in summaries for item in s.records}
        ),
        attachments=MappingProxyType({item.name: item.data for s in summaries for item in s.attachments}),
        missing=tuple(missing),
        notes=tuple(notes),
    )


def _topic(source: Source, count: int) -> TopicInfo:
    return TopicInfo(
        name=source.topic,
        type=source.schema.name,
        message_count=count,
        encoding=source.encoding,
        schema_encoding=source.schema.encoding,
        schema_text=source.schema.data.decode(errors="replace"),
        qos=source.metadata.get("offered_qos_profiles", ""),
        type_hash=source.metadata.get("topic_type_hash", ""),
    )
