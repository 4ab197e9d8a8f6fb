"""What a tick costs, counted and not timed, so that a slow-down shows on any machine."""

from pathlib import Path

import pytest

from sms_handover.bag.files import read_messages
from sms_handover.bag.info import read_info
from sms_handover.graph.topics import CONTROLLER, DIAGNOSTICS, IK, PLANT, TRAJECTORY, Rate, graph_topics
from sms_handover.messages.message_types import MessageTypes
from sms_handover.messages.values import header_ns
from sms_handover.ros.node.diagnostics import node_of

from .conftest import LAWS, TICKS
from .runs import Ended

pytestmark = [pytest.mark.system, pytest.mark.slow]

PERIODS = (TICKS - 1) // 20 + 1
PER_TICK = 3  # messages over DDS: two of the state, one of the command
PER_PERIOD = 16  # messages over DDS beside them each reference period, without the service
WAKES = {PLANT: TICKS, CONTROLLER: TICKS, TRAJECTORY: 2 * PERIODS, IK: PERIODS}
MARGIN = 1.05  # [-] a message may overtake one that another writer has sent before it

Recorded = dict[str, tuple[Path, Ended]]


@pytest.fixture(params=LAWS)
def bag(request: pytest.FixtureRequest, recorded: Recorded) -> Path:
    """The bag of a run under each law."""
    return recorded[request.param][0] / "bag"


def test_a_tick_takes_as_few_messages_as_ever(bag: Path) -> None:
    counts = {name: topic.message_count for name, topic in read_info(bag).topics.items()}
    for rate, often, messages in ((Rate.TICK, TICKS, PER_TICK), (Rate.REFERENCE, PERIODS, PER_PERIOD)):
        topics = [t.name for t in graph_topics(("arm_a", "arm_b")) if t.rate is rate]
        assert sum(counts[f"/{name}"] for name in topics) == often * messages, rate


def test_a_node_is_woken_once_for_what_it_waits_for(bag: Path) -> None:
    """By the last of the messages that it needs; the trajectory node once more by the solution."""
    types, last = MessageTypes(), {}
    for message in read_messages(bag, {DIAGNOSTICS}):
        decoded = types.deserialize(message.data, message.type)
        for status in decoded.status:
            told = {value.key: value.value for value in status.values}
            last[node_of(status.name)] = header_ns(decoded), int(told["wakes"])
    for node, allowed in WAKES.items():
        stamp_ns, wakes = last[node]
        assert stamp_ns >= (TICKS - 21) * 1_000_000, f"{node} has told at its end"
        assert 0.1 * allowed < wakes <= MARGIN * allowed, node
