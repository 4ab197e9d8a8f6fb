"""Event publisher: what a node has decided goes to ``run/events``, hence into the bag, and to its log."""

from collections.abc import Iterable

from rclpy.node import Node

from sms_handover.graph.events import RunEvent, Severity
from sms_handover.ros.codecs.convert import run_event_message
from sms_handover.ros.node.endpoints import CountedPublisher


class EventPublisher:
    """Publishes events of one node and logs each at its severity.

    The topic is latched and reliable with a bounded history: what may happen often is counted, and reported
    at most once per second.
    """

    def __init__(self, node: Node, publisher: CountedPublisher) -> None:
        """Speak for a node on a publisher of ``run/events``."""
        self._log = node.get_logger()
        self._publisher = publisher

    def publish_all(self, events: Iterable[RunEvent]) -> None:
        """Publish and log events, if there are any."""
        for event in events:
            self.publish(event)

    def publish(self, event: RunEvent) -> None:
        """Publish and log an event."""
        self._publisher.publish(run_event_message(event))
        text = str(event).strip()
        if event.severity is Severity.INFO:  # rclpy wants a line of code to log at one severity
            self._log.info(text)
        elif event.severity is Severity.WARNING:
            self._log.warning(text)
        else:
            self._log.error(text)
