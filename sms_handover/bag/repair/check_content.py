"""Check of the content of a bag against its schemas, its loss ledger and the messages published."""

import json
from collections import Counter
from collections.abc import Mapping
from typing import Any

from mcap.records import Metadata

from sms_handover.bag.ledger import LEDGER_RECORD, PERIODS_RECORD, Ledger, TopicLedger, has_ledger, periods_of
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
    """The messages and records of a bag, gathered in one pass."""

    def __init__(self) -> None:
        self.any_record = False
        self.is_ours = False
        self._types: dict[Source, SchemaTypes | str] = {}  # or why there are none
        self._undecoded: dict[Source, str] = {}
        self._seen: set[Source] = set()
        self._rebuild = LedgerRebuild()
        self._ledger: Ledger | None = None
        self._recovery: Mapping[str, str] | None = None
        self._latest: dict[str, int] = {}
        self._late: Counter[str] = Counter()
        self._state: Any = None
        self._run_topic = False
        self._reporters: set[str] = set()

    def record(self, record: Any) -> None:
        """Take a record that is no message."""
        self.any_record = True
        if isinstance(record, Metadata):
            self.is_ours = self.is_ours or has_ledger([record.name])
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
        if source not in self._seen:
            self.source(source)
            self._seen.add(source)
            self._decode(message)
        latest = self._latest.get(source.topic, 0)
        if message.log_time_ns < latest:
            self._late[source.topic] += 1
        else:
            self._latest[source.topic] = message.log_time_ns
        self._rebuild.add(message)
        if topics.is_refused(source.topic):
            return
        if source.schema.name == _RUN_STATE:
            self._state = self._decode(message) or self._state
        elif source.schema.name == PUBLISHED_COUNTS:
            counts = self._decode(message)
            self._reporters.add("" if counts is None else str(counts.node))

    def close(self, findings: Findings, stated: MessageCounts) -> None:
        """Report what is wrong."""
        for source, types in self._types.items():
            if isinstance(types, str):
                findings.note(f"{source.topic} cannot be decoded: {types}; its messages are kept as bytes")
        report = findings.missing if self.is_ours else findings.note
        for source, reason in self._undecoded.items():
            if not self._is_refused(source.topic):  # others may send anything
                report(f"{source.topic} cannot be decoded: {reason}")
        if self._recovery is not None:
            self._report_recovery(self._recovery, findings)
        if not self.is_ours:
            findings.note(
                "it has no loss ledger, as only recorded runs have: losses in transport do not show"
            )
            for topic, count in self._late.items():
                findings.note(f"{topic}: {count} messages are out of order")
            return
        self._close_ledger(findings, stated)
        if self._run_topic:
            self._close_run(findings)

    def _close_ledger(self, findings: Findings, stated: MessageCounts) -> None:
        """Compare the messages with the ledger and the messages published."""
        there = {topic.name: topic for topic in self._rebuild.ledger().topics}
        for topic in there.values():
            self._close_topic(topic, findings)
            if topic.lost is not None and topic.published is not None and topic.lost > 0:
                stated.add("published", {topic.name: topic.published})
        if self._ledger is None:
            findings.missing("there is no loss ledger: the recorder did not close the bag")
            return
        stated.add("loss ledger", {topic.name: topic.received for topic in self._ledger.topics})
        for kept in self._ledger.topics:
            now = there.get(kept.name)
            comparable = now is not None and (now.received, now.period_ns) == (kept.received, kept.period_ns)
            if now is not None and comparable and _stamps(now) != _stamps(kept):
                findings.damaged(f"{kept.name}: the stamps are not those in the loss ledger")

    def _close_topic(self, topic: TopicLedger, findings: Findings) -> None:
        if self._is_refused(topic.name):
            findings.note(f"{topic.name}: {topic.received} messages of other publishers than the topic's own")
            return
        gap = f"the largest gap is {topic.largest_gap_ns / _NS_PER_MS:g} ms"
        if topic.missing:
            whole = topic.received + topic.missing
            findings.missing(f"{topic.name}: {topic.missing} of {whole} stamps are missing, {gap}")
        if topic.duplicates:
            findings.note(f"{topic.name}: {topic.duplicates} duplicate stamps")
        if topic.out_of_order:
            findings.note(f"{topic.name}: {topic.out_of_order} messages are out of order")

    def _close_run(self, findings: Findings) -> None:
        """Report whether the run ended, and which nodes did not report their published counts."""
        state = self._state
        over = () if state is None else (state.FINISHED, state.FAILED, state.WAITING)  # the last by a reset
        if state is None or state.state not in over:
            latest_s = max(self._latest.values(), default=0) / NS_PER_S
            findings.missing(f"the run was not finished when the recording ended, at {latest_s:g} s")
            return
        stamp = state.header.stamp
        how = "failed" if state.state == state.FAILED else "ended"
        findings.note(f"the run {how} at {stamp.sec + stamp.nanosec / NS_PER_S:g} s: {state.detail}")
        reporters = {node.rpartition("/")[2] for node in self._reporters}
        silent = [name for name in topics.LOOP_NODES if name not in reporters]
        if silent:
            findings.missing(f"no published counts from {', '.join(silent)}")

    def _report_recovery(self, record: Mapping[str, str], findings: Findings) -> None:
        """Report what the bag was recovered from."""
        try:
            values = {key: json.loads(text) for key, text in record.items()}
            lost = sum(values["messages_lost"].values())
            text = f"it was recovered from {values['source']}: {values['bytes_lost']} bytes"
            report = findings.missing if lost or values["bytes_lost"] else findings.note
            report(f"{text} and {lost} known messages were lost")
        except (ValueError, LookupError, AttributeError):
            findings.damaged("the record of its recovery is not readable")

    def _is_refused(self, topic: str) -> bool:
        """Whether a topic holds messages of others than its own publisher."""
        return self.is_ours and topics.is_refused(topic)

    def _decode(self, message: ScannedMessage) -> Any:
        types = self._types[message.source]
        if isinstance(types, str):
            return None
        try:
            return types.decode(message.data)
        except BagError as error:
            self._undecoded.setdefault(message.source, str(error))
            return None


def _stamps(topic: TopicLedger) -> tuple[object, ...]:
    return topic.first_ns, topic.last_ns, topic.missing, topic.duplicates, topic.out_of_order
