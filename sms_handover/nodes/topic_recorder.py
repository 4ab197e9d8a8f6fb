"""Topic recorder node: records topics of any graph."""

import sys
from collections.abc import Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from time import monotonic, sleep, time_ns

from mcap.records import Schema
from rclpy.executors import Executor
from rclpy.qos import QoSProfile
from rclpy.topic_endpoint_info import TopicEndpointInfo

from sms_handover.bag.mcap.scan import Source
from sms_handover.bag.metadata import qos_text
from sms_handover.bag.parameters import TopicRecorderParameters
from sms_handover.bag.writer import BagWriter
from sms_handover.errors import BagError, ConfigurationError
from sms_handover.graph.topics import TOPIC_RECORDER
from sms_handover.ros.message_types import message_class
from sms_handover.ros.parameters import declare, reject_unknown
from sms_handover.ros.process.main import EXIT_FAILED, EXIT_LOSS, EXIT_OK, RunnableNode, Stop, run_node
from sms_handover.ros.qos import serves, stored, weakest
from sms_handover.ros.transport.direct import DirectInputs
from sms_handover.terminal.progress import Progress
from sms_handover.terminal.streams import printable

_POLL_S = 0.005  # [s] of wall time between polls for messages
_DISCOVERY_S = 0.1  # [s] of wall time between polls for new topics
_QUIET_S = 0.2  # [s] of wall time without a message after which none is on the way
_DRAIN_S = 5.0  # [s] of wall time to wait for that at most


class TopicRecorderNode(RunnableNode):
    """Writes messages as they arrive to a rosbag2 MCAP bag.

    The log time of a message is the wall time at which it was sent, so that the order across topics does
    not depend on which is taken from the middleware first.
    """

    def __init__(self) -> None:
        """Create the bag; raises ConfigurationError if it cannot be, or on a bad parameter."""
        super().__init__(TOPIC_RECORDER, automatically_declare_parameters_from_overrides=True)
        self.parameters: TopicRecorderParameters = declare(
            self, TopicRecorderParameters, "topic_recorder.yaml", TOPIC_RECORDER
        )
        reject_unknown(self, TopicRecorderParameters)
        self._choice = self.parameters.choice
        folder = self.parameters.folder or datetime.now().strftime("rosbag2_%Y_%m_%d-%H_%M_%S")
        try:
            self._writer = BagWriter(Path(folder), split=self.parameters.split)
        except BagError as error:
            raise ConfigurationError(str(error)) from error
        self._subscribed: dict[str, tuple[str, QoSProfile]] = {}  # type and profile by topic
        self._not_recorded: set[tuple[str, ...]] = set()  # topic and what of it
        self._end_ns: int | None = None  # of wall time; what is sent later is not recorded
        self._inputs = DirectInputs(self)
        self._progress = Progress()
        self.create_timer(_DISCOVERY_S, self.discover_topics)

    @property
    def recorded(self) -> dict[str, int]:
        """Return the number of messages recorded by topic."""
        return self._writer.message_counts

    def run(self, executor: Executor, stop: Stop) -> int:
        """Record until stopped or for the given duration, and close the bag."""
        begin = monotonic()
        duration_s = self.parameters.duration
        print(f"recording to {self._writer.folder}; Ctrl-C to stop", file=sys.stderr)
        try:
            while not stop.asked and not (duration_s and monotonic() - begin > duration_s):
                executor.spin_once(timeout_sec=_POLL_S)
                self._poll()
            self._end_ns = time_ns()
            self._drain()
        finally:
            self._writer.close()
            self._inputs.destroy()
            self._progress.stay()
        for topic, count in self.recorded.items():
            print(f"{count:10d}  {topic}")
        print(f"{sum(self.recorded.values()):10d}  messages in {self._writer.folder}")
        if not self.recorded:
            return EXIT_FAILED
        return EXIT_LOSS if self._not_recorded else EXIT_OK

    def discover_topics(self) -> None:
        """Subscribe to the chosen topics that have appeared, with the QoS they are offered with.

        What cannot be recorded is reported once: it keeps no other topic from being recorded.
        """
        for name, _ in self.get_topic_names_and_types():
            publishers = self.get_publishers_info_by_topic(name) if self._choice.wants(name) else []
            for type_name in dict.fromkeys(publisher.topic_type for publisher in publishers):
                same = [publisher for publisher in publishers if publisher.topic_type == type_name]
                if (name, type_name) not in self._not_recorded:
                    try:
                        self._record(name, type_name, same)
                    except Exception as error:  # whatever it is, it is about this topic alone
                        self._report(name, " ".join(str(error).split()), name, type_name)

    def _record(self, name: str, type_name: str, publishers: Sequence[TopicEndpointInfo]) -> None:
        """Subscribe to a topic, or look at its new publishers."""
        offers = [publisher.qos_profile for publisher in publishers]
        if name not in self._subscribed:
            kind, profile = message_class(type_name), weakest(offers)
            self._add_topic(name, type_name, publishers)
            self._inputs.subscribe(kind, name, profile, partial(self._on_message, name))
            self._subscribed[name] = type_name, profile
        recorded, profile = self._subscribed[name]
        if recorded != type_name:
            self._report(name, f"type {type_name}, as type {recorded} is recorded", name, type_name)
        elif not all(serves(offer, profile) for offer in offers):
            self._report(name, "a later publisher offers less than the first, in its QoS", name, "qos")

    def _add_topic(self, name: str, type_name: str, publishers: Sequence[TopicEndpointInfo]) -> None:
        """Open a topic of the bag; a definition that cannot be read is left out, its messages are not."""
        profiles = list(dict.fromkeys(stored(publisher.qos_profile) for publisher in publishers))
        try:
            self._writer.add_topic(name, type_name, profiles)
        except BagError as error:
            self._progress.print(f"no definition of {name} in the bag: {error}")
            metadata = {"offered_qos_profiles": qos_text([profile.to_rosbag2() for profile in profiles])}
            schema = Schema(id=0, name=type_name, encoding="", data=b"")
            self._writer.add_source(name, Source(name, "cdr", schema, metadata))

    def _report(self, name: str, reason: str, *what: str) -> None:
        """Report once that something of a topic is not recorded."""
        if what not in self._not_recorded:
            self._not_recorded.add(what)
            self._progress.print(f"not recorded: {printable(name)}: {reason}")

    def _on_message(self, name: str, data: bytes, sent_ns: int, publisher: bytes) -> None:
        """Record one message, unless it was sent after the end."""
        if self._end_ns is None or sent_ns <= self._end_ns:
            self._writer.write(name, data, sent_ns, sent_ns)

    def _poll(self) -> None:
        """Take the messages that have arrived and show the progress."""
        self._inputs.poll()
        if self._progress.due:
            counts = self.recorded
            self._progress.show(f"{sum(counts.values())} messages of {len(counts)} topics")

    def _drain(self) -> None:
        """Take the messages that are on the way."""
        begin = last = monotonic()
        count = -1
        while monotonic() - last < _QUIET_S and monotonic() - begin < _DRAIN_S:
            before, count = count, sum(self.recorded.values())
            if count != before:
                last = monotonic()
            self._poll()
            sleep(_POLL_S)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(TopicRecorderNode, args, name=TOPIC_RECORDER)


if __name__ == "__main__":
    raise SystemExit(main())
