"""Player node: publishes the messages of a bag."""

import sys
from collections.abc import Sequence
from pathlib import Path
from threading import Event
from time import monotonic, monotonic_ns

from rclpy.duration import Duration
from rclpy.executors import Executor
from rosgraph_msgs.msg import Clock

from sms_handover.bag.info import read_info
from sms_handover.bag.topic_choice import absolute
from sms_handover.errors import BagError, ConfigurationError, GraphError
from sms_handover.graph.topics import CLOCK, PLAYER
from sms_handover.nodes.parts.bag_publishers import BagPublisher, make_publishers, without_subscriber
from sms_handover.nodes.parts.playback_services import offer_services
from sms_handover.playback.parameters import PlayerParameters
from sms_handover.playback.qos import read_overrides
from sms_handover.playback.report import closing_line, progress_line
from sms_handover.playback.schedule import PlaybackOptions, PlaybackSchedule
from sms_handover.playback.source import PlaybackSource, TopicKey, span_of
from sms_handover.ros.codecs.convert import time_message
from sms_handover.ros.parameters import declare, reject_unknown
from sms_handover.ros.process.main import EXIT_LOSS, EXIT_OK, EXIT_STOPPED, RunnableNode, Stop, run_node
from sms_handover.terminal.keyboard import Key, Keyboard
from sms_handover.terminal.progress import Progress
from sms_handover.terminal.streams import printable
from sms_handover.units import NS_PER_S

KEYS = "space: pause, resume   right: next message   up, down: 10 % faster, slower"

_BURST_NS = 10_000_000  # [ns] of wall time to send without serving services and keys
_WAIT_NS = 50_000_000  # [ns] of wall time between checks for keys and signals at most
_AHEAD = 50  # [messages] read at once while idle
_FASTER = 1.1  # [-] by which a key press multiplies the rate
_QUIET_S = 0.5  # [s] of wall time without a new match after which discovery counts as complete
_DISCOVERY_S = 5.0  # [s] of wall time to wait for existing subscribers at most
_POLL_S = 0.05  # [s] of wall time between checks for subscribers
_BLOCKED_S = 5.0  # [s] of wall time after which a subscriber that blocks the playback is reported
_STOPPED_ACK_S = 1.0  # [s] of wall time to wait for acknowledgements after a stop
_CLOCK_DEPTH = 10  # [messages] of a generated clock; a subscriber needs no old time
_ACK_STEP = Duration(seconds=0.1)  # of wall time to wait for acknowledgements at once


class PlayerNode(RunnableNode):
    """Publishes every message of a bag as recorded, when its time comes."""

    def __init__(self) -> None:
        """Open the bag and advertise its topics; raises ConfigurationError if nothing can be played."""
        super().__init__(PLAYER, automatically_declare_parameters_from_overrides=True)
        self.parameters: PlayerParameters = declare(self, PlayerParameters, "player.yaml", PLAYER)
        reject_unknown(self, PlayerParameters)
        options = self.parameters
        try:
            self._info = read_info(Path(options.bag))
        except BagError as error:
            raise ConfigurationError(str(error)) from error
        self._bag_publishers = self._advertise()
        self._source = PlaybackSource(
            path=self._info.path,
            topics=self._bag_publishers.keys(),
            latched={key: item.kept for key, item in self._bag_publishers.items() if item.kept},
            bag_start_ns=self._info.start_ns,
            span=span_of(self._info, options.start_offset, options.duration),
        )
        start = PlaybackOptions(options.rate, options.start_paused, options.loop, options.read_ahead)
        self._schedule = PlaybackSchedule(self._source.read, self._source.span, start, monotonic_ns())
        self._clock_publisher = self.create_publisher(Clock, CLOCK, _CLOCK_DEPTH) if options.clock else None
        if self._clock_publisher:
            self.create_timer(1.0 / options.clock, self._publish_clock)
        self._progress = Progress()
        self._blocked_since = 0.0
        self._stopped = Event()
        offer_services(self, self._schedule, self._stopped.set)

    def run(self, executor: Executor, stop: Stop) -> int:
        """Play to the end or until stopped; return the exit code."""
        with Keyboard(wanted=self.parameters.keyboard) as keyboard:
            if keyboard.usable:
                print(KEYS, file=sys.stderr)
            self._wait_for_subscribers(executor, stop)
            self._leave_out_conflicts()
            try:
                self._play(executor, stop, keyboard)
            finally:
                self._progress.stay()
            print(closing_line(self._schedule, monotonic_ns()))
            missing = self._unacknowledged(stop)
        if missing:
            print(f"not acknowledged by a subscriber of: {', '.join(missing)}", file=sys.stderr)
        for text in self._info.missing:
            print(f"not played: {text}", file=sys.stderr)
        if self._left_out:
            print(f"{self._left_out} messages of the bag were not played, see above", file=sys.stderr)
        if stop.asked:
            return EXIT_STOPPED
        return EXIT_LOSS if missing or self._left_out or self._info.missing else EXIT_OK

    def _advertise(self) -> dict[TopicKey, BagPublisher]:
        """Return the publishers of the topics to play; report those that cannot be played."""
        options, info = self.parameters, self._info
        choice = options.choice
        chosen = [topic for topic in info.channels if choice.wants(topic.name)]
        absent = choice.absent(info.topics)
        known = f"it has {', '.join(sorted(info.topics)) or 'none'}"
        if absent:
            raise ConfigurationError(f"{info.path} has no topic {', '.join(absent)}; {known}")
        if not chosen:
            raise ConfigurationError(f"no topic of {info.path} is chosen; {known}")
        overrides = read_overrides(Path(options.qos_overrides)) if options.qos_overrides else {}
        renamed = {absolute(old): new for old, new in (rule.split(":=") for rule in options.rename)}
        publishers, skipped = make_publishers(self, chosen, overrides, renamed)
        for (topic, _), reason in skipped.items():
            _report_left_out(topic, reason)
        self._left_out = sum(item.message_count for item in chosen if (item.name, item.type) in skipped)
        if not publishers:
            raise ConfigurationError(f"no topic of {info.path} can be played")
        return publishers

    def _wait_for_subscribers(self, executor: Executor, stop: Stop) -> None:
        """Wait for existing subscribers to match; with ``wait``, for a subscriber of every topic."""
        publishers, timeout_s = self._bag_publishers.values(), self.parameters.wait
        begin = changed = monotonic()
        seen = -1
        while not stop.asked:
            executor.spin_once(timeout_sec=_POLL_S)
            now, count = monotonic(), sum(item.subscription_count for item in publishers)
            if count != seen:
                seen, changed = count, now
            unmatched = without_subscriber(publishers) if timeout_s else []
            if unmatched and now - begin > timeout_s:
                raise GraphError(f"no subscriber of {', '.join(unmatched)} after {timeout_s:g} s")
            quiet = now - changed > _QUIET_S and not any(item.waits_for_match() for item in publishers)
            if not unmatched and (quiet or now - begin > max(timeout_s, _DISCOVERY_S)):
                return

    def _leave_out_conflicts(self) -> None:
        """Leave out topics that other nodes publish with another type; raises GraphError on all."""
        for key, publisher in list(self._bag_publishers.items()):
            if reason := publisher.conflict():
                _report_left_out(publisher.name, reason)
                self._left_out += publisher.message_count
                self._bag_publishers.pop(key).destroy()
        if not self._bag_publishers:
            raise GraphError(f"no topic of {self._info.path} can be played")

    def _play(self, executor: Executor, stop: Stop, keyboard: Keyboard) -> None:
        """Send every message when its time comes, to the end or until stopped."""
        self._schedule.read_ahead(self.parameters.read_ahead)
        self._schedule.start(monotonic_ns())
        while not (stop.asked or self._stopped.is_set()):
            self._send()
            if self._schedule.finished:
                break
            executor.spin_once(timeout_sec=self._idle_s())
            for key in keyboard.pressed():
                self._on_key(key)
            if self._progress.due:
                self._show()
        self._publish_clock()
        self._show()

    def _show(self) -> None:
        """Show the progress."""
        self._progress.show(progress_line(self._schedule, self._source.span, monotonic_ns()))

    def _send(self) -> None:
        """Publish what is due, for one burst at most."""
        schedule = self._schedule
        now_ns = monotonic_ns()
        until_ns = now_ns + _BURST_NS
        while now_ns < until_ns:
            message = schedule.due(now_ns)
            if message is None:
                return
            if not self._bag_publishers[message.topic, message.type].publish(message.data):
                self._report_blocked(message.topic)
                return
            self._blocked_since = 0.0
            now_ns = monotonic_ns()
            schedule.sent(now_ns)

    def _report_blocked(self, topic: str) -> None:
        """Report now and then that a subscriber blocks the playback."""
        now = monotonic()
        self._blocked_since = self._blocked_since or now
        if now - self._blocked_since > _BLOCKED_S:
            self._blocked_since = now
            self._progress.print(f"waiting for a subscriber of {topic} that takes no messages")

    def _idle_s(self) -> float:
        """Read ahead if there is time; return how long to wait for events."""
        wait_ns = self._schedule.wait_ns(monotonic_ns())
        if wait_ns is None or wait_ns > 0:
            self._schedule.read_ahead(_AHEAD)
            wait_ns = self._schedule.wait_ns(monotonic_ns())
        return (_WAIT_NS if wait_ns is None else min(wait_ns, _WAIT_NS)) / NS_PER_S

    def _publish_clock(self) -> None:
        """Publish the time up to which everything has been sent."""
        if self._clock_publisher:
            position_ns = self._schedule.position_ns(monotonic_ns())
            self._clock_publisher.publish(Clock(clock=time_message(position_ns)))

    def _unacknowledged(self, stop: Stop) -> list[str]:
        """Wait for acknowledgements; return the topics that lack some."""
        asked = stop.asked
        deadline = monotonic() + (_STOPPED_ACK_S if asked else self.parameters.ack_timeout)
        left = list(self._bag_publishers.values())
        while left:
            left = [item for item in left if not item.acknowledged(_ACK_STEP)]
            if monotonic() > deadline or stop.asked != asked:
                break
        return [item.topic_name for item in left]

    def _on_key(self, key: Key) -> None:
        """Carry out a key."""
        now_ns, schedule = monotonic_ns(), self._schedule
        if key is Key.SPACE:
            schedule.toggle(now_ns)
        elif key is Key.RIGHT:
            schedule.step()
        else:
            factor = _FASTER if key is Key.UP else 1.0 / _FASTER
            schedule.set_rate(schedule.clock.rate * factor, now_ns)


def _report_left_out(topic: str, reason: str) -> None:
    """Report a topic that is not played."""
    print(f"not played: {printable(topic)}: {reason}", file=sys.stderr)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(PlayerNode, args, name=PLAYER)


if __name__ == "__main__":
    raise SystemExit(main())
