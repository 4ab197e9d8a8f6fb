"""The loss ledger finds what is missing, comes twice or late, and goes into the bag."""

from pathlib import Path

import numpy as np
import pytest

from sms_handover.bag.info import read_info
from sms_handover.bag.ledger import Ledger, TopicLedger, ledger_table
from sms_handover.bag.ledger_keeper import LedgerKeeper
from sms_handover.bag.recording import PUBLISHED_COUNTS, Recording
from sms_handover.errors import BagError
from sms_handover.graph.topics import TF_TYPE
from sms_handover.messages.transforms import transforms_cdr
from sms_handover.types import Pose

from .bag_messages import TICK_NS, TYPES, WALL_NS, joint_state, published_counts, text

TOPIC = "/joint_states"


def account(ticks: list[int], period_ns: int = TICK_NS) -> TopicLedger:
    """Return the account of a topic that received these ticks."""
    keeper = LedgerKeeper()
    keeper.add_topic(TOPIC, period_ns)
    for tick in ticks:
        keeper.receive(TOPIC, tick * TICK_NS)
    return keeper.ledger().topics[0]


def test_an_even_topic_is_complete() -> None:
    ledger = account(list(range(1001)))
    assert (ledger.received, ledger.first_ns, ledger.last_ns) == (1001, 0, 1000 * TICK_NS)
    assert (ledger.missing, ledger.duplicates, ledger.out_of_order) == (0, 0, 0)
    assert (ledger.largest_gap_ns, ledger.rate, ledger.complete) == (TICK_NS, 1000.0, True)


@pytest.mark.parametrize(
    ("ticks", "missing", "duplicates", "late", "gap"),
    [
        ([0, 1, 3, 4], 1, 0, 0, 2),  # dropped
        ([0, 1, 9, 20], 17, 0, 0, 11),
        ([0, 1, 1, 2], 0, 1, 0, 1),  # duplicate
        ([5, 5, 5], 0, 2, 0, 0),
        ([0, 2, 1, 3], 0, 0, 1, 2),  # late
        ([0, 4, 2, 3], 1, 0, 2, 4),
        ([0, 4, 2, 2], 2, 1, 2, 4),
        ([0, 1, 2, 0], 0, 1, 1, 1),  # late and a duplicate
        ([3, 4, 0, 5], 2, 0, 1, 1),  # the first came late
        ([3, 0, 1, 2], 0, 0, 3, 0),
        ([7], 0, 0, 0, 0),
    ],
)
def test_dropped_duplicate_and_late_stamps_are_counted(
    ticks: list[int], missing: int, duplicates: int, late: int, gap: int
) -> None:
    ledger = account(ticks)
    assert (ledger.missing, ledger.duplicates, ledger.out_of_order) == (missing, duplicates, late)
    assert ledger.largest_gap_ns == gap * TICK_NS
    assert (ledger.received, ledger.first_ns) == (len(ticks), min(ticks) * TICK_NS)
    assert (ledger.last_ns, ledger.complete) == (max(ticks) * TICK_NS, missing == 0)


def test_a_topic_without_a_period_misses_nothing() -> None:
    ledger = account([0, 0, 7, 5, 100], period_ns=0)
    assert (ledger.missing, ledger.duplicates, ledger.out_of_order) == (0, 0, 1)
    assert (ledger.largest_gap_ns, ledger.complete) == (93 * TICK_NS, True)


def test_published_counts_tell_what_was_lost_at_the_ends() -> None:
    keeper = LedgerKeeper()
    for name in (TOPIC, "/run/ready", "/quiet"):
        keeper.add_topic(name)
    for tick in range(5):
        keeper.receive(TOPIC, tick)
    keeper.receive_unstamped("/run/ready")
    keeper.report(published_counts("plant", {TOPIC: 7}))
    keeper.report(published_counts("plant", {TOPIC: 7}))  # a latched report that comes twice counts once
    for node in ("ik", "trajectory"):
        keeper.report(published_counts(node, {"/run/ready": 1}))
    keeper.report(published_counts("plant", {"/not/recorded": 3}))
    ledger = keeper.ledger()
    assert [topic.published for topic in ledger.topics] == [7, 2, None]
    assert [topic.lost for topic in ledger.topics] == [2, 1, None]
    assert [topic.complete for topic in ledger.topics] == [False, False, True]
    assert not ledger.complete


def test_ledger_survives_its_record_and_a_wrong_record_is_refused() -> None:
    ledger = Ledger((account([0, 1, 3]), account([], 0)))
    ledger = Ledger((ledger.topics[0], TopicLedger(**{**vars(ledger.topics[1]), "name": "/other"})))
    assert Ledger.from_record(ledger.to_record()) == ledger
    for record in ({"/a": "{}"}, {"/a": "no json"}, {"/a": "[1]"}):
        with pytest.raises(BagError, match="the loss ledger of the bag is not readable"):
            Ledger.from_record(record)


def test_table_has_a_line_per_topic() -> None:
    lines = ledger_table(Ledger((account([0, 1, 3]), account([], 0)))).splitlines()
    assert lines[0].split("  ")[0] == "topic"
    assert lines[1].split() == [TOPIC, "3", "-", "1", "0", "0", "0.000", "0.003", "666.7", "2.000"]
    assert lines[2].split() == [TOPIC, "0", "-", "-", "0", "0", "-", "-", "-", "-"]
    assert len({len(line) for line in lines}) == 1


def test_recording_keeps_the_ledger_and_the_clock(tmp_path: Path) -> None:
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        recording.add_topic(TOPIC, "sensor_msgs/msg/JointState", period_ns=TICK_NS)
        recording.add_topic("/text", "std_msgs/msg/String")
        recording.add_topic("/walled", "std_msgs/msg/Header")
        recording.add_topic("/tf", TF_TYPE, period_ns=2 * TICK_NS)
        recording.add_topic("/run/published", PUBLISHED_COUNTS)
        recording.receive("/text", TYPES.serialize(text("before the first stamp")), WALL_NS)
        for tick in (0, 1, 3):
            recording.receive(TOPIC, TYPES.serialize(joint_state(tick * TICK_NS)), WALL_NS)
        recording.receive("/text", TYPES.serialize(text("at 3 ms")), WALL_NS)
        recording.receive("/walled", TYPES.serialize(joint_state(WALL_NS)), WALL_NS)
        for tick in (0, 2):
            moved = ("world", "deputy", Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])))
            recording.receive("/tf", transforms_cdr(TYPES, [moved], tick * TICK_NS), WALL_NS)
        recording.receive("/tf", transforms_cdr(TYPES, [], 0), WALL_NS)  # of nothing, so without a stamp
        counts = TYPES.serialize(published_counts("plant", {TOPIC: 4, "/text": 2}))
        recording.receive("/run/published", counts, WALL_NS)
        assert recording.simulation_ns == 3 * TICK_NS
    info = read_info(tmp_path / "bag")
    assert info.ledger is not None
    topics = {topic.name: topic for topic in info.ledger.topics}
    assert (topics[TOPIC].missing, topics[TOPIC].lost) == (1, 1)
    assert (topics["/text"].received, topics["/text"].lost, topics["/text"].first_ns) == (2, 0, None)
    assert topics["/walled"].first_ns is None
    tf = topics["/tf"]
    assert (tf.received, tf.first_ns, tf.last_ns, tf.complete) == (3, 0, 2 * TICK_NS, True)
    assert not info.ledger.complete
    assert (info.start_ns, info.end_ns) == (0, 3 * TICK_NS)
