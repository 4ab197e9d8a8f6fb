"""Topic recorder node: records topics of any graph."""

import sys
from collections.abc import Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from time import monotonic

from rclpy.executors import Executor

from sms_handover.bag.parameters import TopicRecorderParameters
from sms_handover.bag.writer import BagWriter
from sms_handover.errors import BagError, ConfigurationError, SmsHandoverError
from sms_handover.graph.topics import TOPIC_RECORDER
from sms_handover.ros.message_types import message_class
from sms_handover.ros.parameters import declare, reject_unknown
from sms_handover.ros.process.main import EXIT_FAILED, EXIT_OK, RunnableNode, Stop, run_node
from sms_handover.ros.qos import stored, weakest
from sms_handover.ros.transport.direct import DirectInputs
from sms_handover.terminal.status_line import StatusLine

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
            self._writer = BagWriter(Path(folder))
        except BagError as error:
            raise ConfigurationError(str(error)) from error
        self._seen: set[str] = set()
        self._inputs = DirectInputs(self)
        self._line = StatusLine()
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
            self._drain(executor)
        finally:
            self._writer.close()
            self._inputs.destroy()
            self._line.stay()
        for topic, count in self.recorded.items():
            print(f"{count:10d}  {topic}")
        print(f"{sum(self.recorded.values()):10d}  messages in {self._writer.folder}")
        return EXIT_OK if self.recorded else EXIT_FAILED

    def discover_topics(self) -> None:
        """Subscribe to the chosen topics that have appeared, with the QoS they are offered with."""
        for name, type_names in self.get_topic_names_and_types():
            if name in self._seen or not self._choice.wants(name):
                continue
            publishers = self.get_publishers_info_by_topic(name)
            if not publishers:
                continue
            self._seen.add(name)
            offers = [publisher.qos_profile for publisher in publishers]
            try:
                kind = message_class(type_names[0])
                self._writer.add_topic(name, type_names[0], list(dict.fromkeys(map(stored, offers))))
            except SmsHandoverError as error:
                self._line.stay()
                print(f"not recorded: {name}: {error}", file=sys.stderr)
                continue
            self._inputs.subscribe(kind, name, weakest(offers), partial(self._on_message, name))

    def _on_message(self, name: str, data: bytes, sent_ns: int, publisher: bytes) -> None:
        """Record one message."""
        self._writer.write(name, data, sent_ns, sent_ns)

    def _poll(self) -> int:
        """Take the messages that have arrived and show the progress; return their number."""
        taken = self._inputs.poll()
        if self._line.due:
            counts = self.recorded
            self._line.show(f"{sum(counts.values())} messages of {len(counts)} topics")
        return taken

    def _drain(self, executor: Executor) -> None:
        """Take the messages that are on the way."""
        begin = last = monotonic()
        while monotonic() - last < _QUIET_S and monotonic() - begin < _DRAIN_S:
            if self._poll():
                last = monotonic()
            executor.spin_once(timeout_sec=_POLL_S)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(TopicRecorderNode, args, name=TOPIC_RECORDER)


if __name__ == "__main__":
    raise SystemExit(main())
