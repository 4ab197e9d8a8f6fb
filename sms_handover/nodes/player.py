"""The player node."""

import sys
from collections.abc import Sequence
from pathlib import Path
from time import monotonic, monotonic_ns

from rclpy.duration import Duration
from rclpy.executors import Executor
from rosgraph_msgs.msg import Clock

from sms_handover.bag.info import BagInfo, read_info
from sms_handover.errors import BagError, ConfigurationError, GraphError
from sms_handover.graph.topics import CLOCK, PLAYER
from sms_handover.nodes.parts.bag_publishers import BagPublisher, make_publishers, without_subscriber
from sms_handover.nodes.parts.playback_services import offer_services
from sms_handover.playback.parameters import PlayerParameters
from sms_handover.playback.qos import read_overrides
from sms_handover.playback.report import closing_line, progress_line
from sms_handover.playback.schedule import PlaybackOptions, PlaybackSchedule
from sms_handover.playback.source import PlaybackSource, span_of
from sms_handover.ros.codecs.convert import time_message
from sms_handover.ros.parameters import declare, reject_unknown
from sms_handover.ros.process.main import EXIT_LOSS, EXIT_OK, EXIT_STOPPED, RunnableNode, Stop, run_node
from sms_handover.terminal.keyboard import Key, Keyboard
from sms_handover.terminal.progress import Progress
from sms_handover.units import NS_PER_S

KEYS = "space: pause or go on   right: next message   up, down: faster, slower by 10 %"

_STRETCH_NS = 10_000_000  # [ns] of wall time to send without a look at services and keys
_WAIT_NS = 50_000_000  # [ns] of wall time to wait at most, so that keys and signals are noticed
_AHEAD = 50  # [messages] read at once while there is time
_FASTER = 1.1  # [-] what a key press multiplies the rate by
_QUIET_S = 0.5  # [s] of wall time without a new subscription after which discovery is taken to be over
_DISCOVERY_S = 5.0  # [s] of wall time at most to wait for those that are there already
_LOOK_S = 0.05  # [s] of wall time between two looks at who has subscribed
_STUCK_S = 5.0  # [s] of wall time after which a subscriber that takes nothing is spoken of
_STOPPED_ACK_S = 1.0  # [s] of wall time to wait for confirmation when asked to stop
_CLOCK_DEPTH = 10  # [messages] of a generated clock kept for a subscriber; an old time is of no use to it
_ACK_STEP = Duration(seconds=0.1)  # of wall time to wait for confirmation at once


class PlayerNode(RunnableNode):
    """Publishes the messages of a bag as they were recorded, every one of them, each when its time comes."""

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
        self._outlets = self._advertise()
        self._source = PlaybackSource(
            path=self._info.path,
            topics=frozenset(self._outlets),
            latched={name: item.in_force for name, item in self._outlets.items() if item.in_force},
            bag_start_ns=self._info.start_ns,
            span=span_of(self._info, options.start_offset, options.duration),
        )
        start = PlaybackOptions(options.rate, options.start_paused, options.loop, options.read_ahead)
        self._schedule = PlaybackSchedule(self._source.read, self._source.span, start, monotonic_ns())
        self._clock_outlet = self.create_publisher(Clock, CLOCK, _CLOCK_DEPTH) if options.clock else None
        if self._clock_outlet:
            self.create_timer(1.0 / options.clock, self._publish_clock)
        self._progress = Progress()
        self._refused_since = 0.0
        self._ended = False
        offer_services(self, self._schedule, self._stop)

    def run(self, executor: Executor, stop: Stop) -> int:
        """Play to the end or until asked to stop; return the exit code."""
        with Keyboard(wanted=self.parameters.keyboard) as keyboard:
            if keyboard.usable:
                print(KEYS, file=sys.stderr)
            self._wait_for_subscribers(executor, stop)
            try:
                self._play(executor, stop, keyboard)
            finally:
                self._progress.stay()
            print(closing_line(self._schedule, monotonic_ns()))
            missing = self._unconfirmed(stop)
        if missing:
            print(f"not confirmed by a subscriber of: {', '.join(missing)}", file=sys.stderr)
        if stop.asked:
            return EXIT_STOPPED
        return EXIT_LOSS if missing else EXIT_OK

    # The start

    def _advertise(self) -> dict[str, BagPublisher]:
        """Return the publishers of the topics to play; those that cannot be played are named."""
        options, info = self.parameters, self._info
        choice = options.choice
        chosen = [topic for topic in info.topics.values() if choice.wants(topic.name)]
        absent = choice.absent(info.topics)
        if absent:
            raise ConfigurationError(f"{info.path} has no topic {', '.join(absent)}; {_known(info)}")
        if not chosen:
            raise ConfigurationError(f"no topic of {info.path} is chosen; {_known(info)}")
        overrides = read_overrides(Path(options.qos_overrides)) if options.qos_overrides else {}
        publishers, skipped = make_publishers(self, chosen, overrides)
        for item in skipped:
            print(f"not played: {item.topic}: {item.reason}", file=sys.stderr)
        if not publishers:
            raise ConfigurationError(f"nothing is left to play of {info.path}")
        return publishers

    def _wait_for_subscribers(self, executor: Executor, stop: Stop) -> None:
        """Wait until those who are there have matched; if asked for, until every topic has a subscriber."""
        publishers, patience_s = self._outlets.values(), self.parameters.wait
        begin = changed = monotonic()
        seen = -1
        while not stop.asked:
            executor.spin_once(timeout_sec=_LOOK_S)
            now, count = monotonic(), sum(item.subscription_count for item in publishers)
            if count != seen:
                seen, changed = count, now
            lonely = without_subscriber(publishers) if patience_s else []
            if lonely and now - begin > patience_s:
                raise GraphError(f"after {patience_s:g} s nobody has subscribed to {', '.join(lonely)}")
            quiet = now - changed > _QUIET_S and not any(item.waits_for_match(self) for item in publishers)
            if not lonely and (quiet or now - begin > max(patience_s, _DISCOVERY_S)):
                return

    # Playing

    def _play(self, executor: Executor, stop: Stop, keyboard: Keyboard) -> None:
        """Send every message when its time comes, until the end or until asked to stop."""
        self._schedule.read_ahead(self.parameters.read_ahead)
        self._schedule.start(monotonic_ns())
        while not (stop.asked or self._ended):
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
        """Show how far the playback is."""
        self._progress.show(progress_line(self._schedule, self._source.span, monotonic_ns()))

    def _send(self) -> None:
        """Publish what is due, for a while at most."""
        schedule, outlets = self._schedule, self._outlets
        until_ns = monotonic_ns() + _STRETCH_NS
        now_ns = monotonic_ns()
        while now_ns < until_ns:
            message = schedule.due(now_ns)
            if message is None:
                return
            if not outlets[message.topic].publish(message.data):
                self._note_refusal(message.topic)
                return
            self._refused_since = 0.0
            now_ns = monotonic_ns()
            schedule.sent(now_ns)

    def _note_refusal(self, topic: str) -> None:
        """Say once that a subscriber holds the playback up."""
        now = monotonic()
        if self._refused_since == 0.0:
            self._refused_since = now
        elif now - self._refused_since > _STUCK_S:
            self._refused_since = now
            self._progress.print(f"a subscriber of {topic} takes nothing; waiting for it")

    def _idle_s(self) -> float:
        """Read ahead if there is time, and return how long to wait for events."""
        wait_ns = self._schedule.wait_ns(monotonic_ns())
        if wait_ns is None or wait_ns > 0:
            self._schedule.read_ahead(_AHEAD)
            wait_ns = self._schedule.wait_ns(monotonic_ns())
        return (_WAIT_NS if wait_ns is None else min(wait_ns, _WAIT_NS)) / NS_PER_S

    def _publish_clock(self) -> None:
        """Publish the time up to which everything has been sent."""
        if self._clock_outlet:
            position_ns = self._schedule.position_ns(monotonic_ns())
            self._clock_outlet.publish(Clock(clock=time_message(position_ns)))

    def _unconfirmed(self, stop: Stop) -> list[str]:
        """Wait until everything has been confirmed; return the topics where it has not."""
        asked = stop.asked
        deadline = monotonic() + (_STOPPED_ACK_S if asked else self.parameters.ack_timeout)
        left = list(self._outlets.values())
        while left:
            left = [item for item in left if not item.confirmed(_ACK_STEP)]
            if monotonic() > deadline or stop.asked != asked:
                break
        return [item.topic_name for item in left]

    # Control

    def _on_key(self, key: Key) -> None:
        """Do what a key asks for."""
        now_ns, schedule = monotonic_ns(), self._schedule
        if key is Key.SPACE:
            schedule.toggle(now_ns)
        elif key is Key.RIGHT:
            schedule.step()
        else:
            factor = _FASTER if key is Key.UP else 1.0 / _FASTER
            schedule.set_rate(schedule.clock.rate * factor, now_ns)

    def _stop(self) -> None:
        """End the playback."""
        self._ended = True


def _known(info: BagInfo) -> str:
    """Return the topics of a bag in words."""
    return f"it has {', '.join(sorted(info.topics)) or 'none'}"


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(PlayerNode, args, name=PLAYER)


if __name__ == "__main__":
    raise SystemExit(main())
