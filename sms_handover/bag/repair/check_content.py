"""Hold the messages of a bag against its schemas, its loss ledger and what was published."""

import json
from collections import Counter
from collections.abc import Mapping
from typing import Any

from mcap.records import Metadata

from sms_handover.bag.ledger import LEDGER_RECORD, PERIODS_RECORD, Ledger, TopicLedger, is_of_ours, periods_of
from sms_handover.bag.mcap.scan import ScannedMessage, Source
from sms_handover.bag.recording import PUBLISHED_COUNTS
from sms_handover.bag.repair.findings import Findings
from sms_handover.bag.repair.ledger_rebuild import LedgerRebuild
from sms_handover.bag.repair.message_counts import MessageCounts
from sms_handover.bag.repair.recovery import RECOVERY_RECORD
from sms_handover.bag.schemas import SchemaTypes, types_of
from sms_handover.errors import BagError
from sms_handover.graph import topics
from sms_handover.units import NS_PER_S

_RUN_STATE = "sms_handover_interfaces/msg/RunState"
_NS_PER_MS = 1_000_000


class ContentCheck:
    """What the messages and records of a bag tell, gathered in one pass."""

    def __init__(self) -> None:
        self.any_record = False
        self.is_ours = False
        self._types: dict[Source, SchemaTypes | str] = {}  # or why there are none
        self._undecoded: set[Source] = set()
        self._heard: set[Source] = set()
        self._rebuild = LedgerRebuild()
        self._ledger: Ledger | None = None
        self._recovery: Mapping[str, str] | None = None
        self._newest: dict[str, int] = {}
        self._late: Counter[str] = Counter()
        self._state: Any = None
        self._run_topic = False
        self._told: set[str] = set()

    def record(self, record: Any) -> None:
        """Take a record that is no message."""
        self.any_record = True
        if isinstance(record, Metadata):
            self.is_ours = self.is_ours or is_of_ours([record.name])
            if record.name == PERIODS_RECORD:
                self._rebuild.expect(periods_of(record.metadata))
            elif record.name == LEDGER_RECORD:
                self._ledger = Ledger.from_record(record.metadata)
            elif record.name == RECOVERY_RECORD:
                self._recovery = record.metadata

    def source(self, source: Source) -> None:
        """Take a topic."""
        if source in self._types:
            return
        try:
            self._types[source] = types_of(source)
        except BagError as error:
            self._types[source] = str(error)
        self._rebuild.open(source)
        self._run_topic = self._run_topic or source.schema.name == _RUN_STATE

    def message(self, message: ScannedMessage) -> None:
        """Take a message."""
        self.any_record = True
        source = message.source
        if source not in self._heard:
            self.source(source)
            self._heard.add(source)
            self._decode(message)
        newest = self._newest.get(source.topic, 0)
        if message.log_time_ns < newest:
            self._late[source.topic] += 1
        else:
            self._newest[source.topic] = message.log_time_ns
        self._rebuild.book(message)
        if topics.is_refused(source.topic):
            return
        if source.schema.name == _RUN_STATE:
            self._state = self._decode(message) or self._state
        elif source.schema.name == PUBLISHED_COUNTS:
            counts = self._decode(message)
            self._told.add("" if counts is None else str(counts.node))

    def close(self, findings: Findings, claims: MessageCounts) -> None:
        """Tell what is wrong."""
        for source, types in self._types.items():
            if isinstance(types, str):
                tell = findings.damaged if source.encoding == "cdr" else findings.note
                tell(f"{source.topic} cannot be decoded: {types}")
        for source in self._undecoded:
            if not self._is_refused(source.topic):  # what strangers send is kept as it came
                findings.damaged(f"{source.topic} cannot be decoded: its messages do not fit its schema")
        if self._recovery is not None:
            self._tell_recovery(self._recovery, findings)
        if not self.is_ours:
            findings.note("it has no loss ledger, as only recorded runs have: losses on the way do not show")
            for topic, count in self._late.items():
                findings.note(f"{topic}: {count} messages lie behind later ones")
            return
        self._close_ledger(findings, claims)
        if self._run_topic:
            self._close_run(findings)

    def _close_ledger(self, findings: Findings, claims: MessageCounts) -> None:
        """Compare the messages with the ledger, and with what was published."""
        there = {topic.name: topic for topic in self._rebuild.ledger().topics}
        for topic in there.values():
            self._close_topic(topic, findings)
            if topic.lost is not None and topic.published is not None and topic.lost > 0:
                claims.add("published", {topic.name: topic.published})
        if self._ledger is None:
            findings.missing("the loss ledger is not there: the recorder did not come to close the bag")
            return
        claims.add("loss ledger", {topic.name: topic.received for topic in self._ledger.topics})
        for kept in self._ledger.topics:
            now = there.get(kept.name)
            comparable = now is not None and (now.received, now.period_ns) == (kept.received, kept.period_ns)
            if now is not None and comparable and _stamps(now) != _stamps(kept):
                findings.damaged(f"{kept.name}: the stamps are not those that the loss ledger tells of")

    def _close_topic(self, topic: TopicLedger, findings: Findings) -> None:
        """Tell what one topic lacks."""
        if self._is_refused(topic.name):
            findings.note(f"{topic.name}: {topic.received} messages of others than the topic's own publisher")
            return
        gap = f"the largest gap is {topic.largest_gap_ns / _NS_PER_MS:g} ms"
        if topic.missing:
            whole = topic.received + topic.missing
            findings.missing(f"{topic.name}: {topic.missing} of {whole} stamps never came, {gap}")
        if topic.duplicates:
            findings.note(f"{topic.name}: {topic.duplicates} stamps came more than once")
        if topic.out_of_order:
            findings.note(f"{topic.name}: {topic.out_of_order} messages came behind a later one")

    def _close_run(self, findings: Findings) -> None:
        """Whether the run came to its end, and whether everybody told what was published."""
        state = self._state
        over = () if state is None else (state.FINISHED, state.FAILED, state.WAITING)  # the last by a reset
        if state is None or state.state not in over:
            newest_s = max(self._newest.values(), default=0) / NS_PER_S
            findings.missing(f"the run was not finished when the recording ended, at {newest_s:g} s")
            return
        stamp = state.header.stamp
        how = "failed" if state.state == state.FAILED else "ended"
        findings.note(f"the run {how} at {stamp.sec + stamp.nanosec / NS_PER_S:g} s: {state.detail}")
        told = {node.rpartition("/")[2] for node in self._told}
        silent = [name for name in topics.LOOP_NODES if name not in told]
        if silent:
            findings.missing(f"how many messages were published is not told by {', '.join(silent)}")

    def _tell_recovery(self, record: Mapping[str, str], findings: Findings) -> None:
        """Tell what the bag was recovered from."""
        try:
            values = {key: json.loads(text) for key, text in record.items()}
            lost = sum(values["messages_lost"].values())
            text = f"it was recovered from {values['source']}: {values['bytes_lost']} bytes"
            tell = findings.missing if lost or values["bytes_lost"] else findings.note
            tell(f"{text} and {lost} messages known of were lost")
        except (ValueError, LookupError, AttributeError):
            findings.damaged("the record of its recovery is not readable")

    def _is_refused(self, topic: str) -> bool:
        """Whether a topic holds what others published where a node of ours alone was to."""
        return self.is_ours and topics.is_refused(topic)

    def _decode(self, message: ScannedMessage) -> Any:
        """Return a decoded message, None if that cannot be."""
        types = self._types[message.source]
        if isinstance(types, str):
            return None
        try:
            return types.decode(message.data)
        except BagError:
            self._undecoded.add(message.source)
            return None


def _stamps(topic: TopicLedger) -> tuple[object, ...]:
    """Return what an account says of the stamps."""
    return topic.first_ns, topic.last_ns, topic.missing, topic.duplicates, topic.out_of_order
