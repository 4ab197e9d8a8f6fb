"""What a node decides goes out on run/events, whatever its severity and however often it changes."""

import pytest

from sms_handover.graph.events import RunEvent, Severity
from sms_handover.graph.topics import RUN_EVENTS
from sms_handover.messages.values import run_event
from sms_handover.ros.node.endpoints import Endpoints
from sms_handover.ros.node.event_publisher import EventPublisher

from .bench import Bench
from .graph import TOPICS

pytestmark = pytest.mark.ros


def test_events_of_every_severity_reach_even_who_comes_late(bench: Bench) -> None:
    bench.start()
    plant = bench.plain("plant")
    events = EventPublisher(plant, Endpoints(plant, TOPICS, ()).publisher(RUN_EVENTS))
    expected = [
        RunEvent(number, "plant", "made_up", severity, "a test", "carry", 2.0, 1.0, "s")
        for number, severity in enumerate((*Severity, *Severity))
    ]
    for event in expected:
        events.publish(event)
    heard: list[RunEvent] = []
    ear = Endpoints(bench.plain("ear"), TOPICS, ())
    ear.subscribe(RUN_EVENTS, lambda message: heard.append(run_event(message)))
    bench.until(lambda: len(heard) == 6, "all events")
    assert heard == expected
