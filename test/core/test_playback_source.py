"""What is opened of a bag: the chosen topics and times, and the latched messages that are in force."""

from dataclasses import replace
from pathlib import Path

import pytest

from sms_handover.bag.info import read_info
from sms_handover.bag.time_order import TimeSpan
from sms_handover.bag.writer import BagWriter
from sms_handover.errors import ConfigurationError
from sms_handover.messages.message_types import MessageTypes
from sms_handover.playback.definitions import same_definition
from sms_handover.playback.source import PlaybackSource, span_of

from .bag_messages import TYPES, text
from .test_bag_info import write_by_mcap

S = 1_000_000_000  # ns
START_S = 5


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Ten seconds with a message a second, and latched ones that change now and then."""
    with BagWriter(tmp_path / "bag") as writer:
        for topic in ("/ticks", "/map", "/description"):
            writer.add_topic(topic, "std_msgs/msg/String")
        for second in range(START_S, START_S + 11):
            if second == START_S:
                writer.write("/description", TYPES.serialize(text("robot")), second * S, 0)
            if second % 3 == 0:
                writer.write("/map", TYPES.serialize(text(f"map {second}")), second * S, 0)
            writer.write("/ticks", TYPES.serialize(text(f"tick {second}")), second * S, 0)
    return tmp_path / "bag"


def contents(bag: Path, from_s: float, latched: dict[str, int], end_s: float = 100.0) -> list[str]:
    """Return what is read from a time on."""
    info = read_info(bag)
    span = TimeSpan(info.start_ns, round(end_s * S))
    kept = {(topic, info.topics[topic].type): depth for topic, depth in latched.items()}
    topics = {(topic.name, topic.type) for topic in info.channels}
    source = PlaybackSource(bag, topics, kept, info.start_ns, span)
    return [TYPES.deserialize(m.data, m.type).data for m in source.read(round(from_s * S))]


def test_from_the_start_it_is_the_bag(bag: Path) -> None:
    whole = contents(bag, START_S, {"/map": 1, "/description": 1})
    assert whole[:3] == ["robot", "tick 5", "map 6"] and len(whole) == 11 + 1 + 4


def test_from_a_later_time_what_is_latched_comes_first(bag: Path) -> None:
    latched = {"/map": 1, "/description": 1}
    assert contents(bag, 13.5, latched) == ["robot", "map 12", "tick 14", "map 15", "tick 15"]
    assert contents(bag, 13.5, {"/map": 2}) == ["map 9", "map 12", "tick 14", "map 15", "tick 15"]
    assert contents(bag, 13.5, {}) == ["tick 14", "map 15", "tick 15"]


def test_a_latched_message_of_that_very_time_is_not_sent_twice(bag: Path) -> None:
    assert contents(bag, 12.0, {"/map": 2}, end_s=12.0) == ["map 6", "map 9", "map 12", "tick 12"]


def test_the_span_is_what_was_asked_for(bag: Path) -> None:
    info = read_info(bag)
    assert span_of(info, 0.0, 0.0) == TimeSpan(5 * S, 15 * S)
    assert span_of(info, 2.5, 0.0) == TimeSpan(7.5 * S, 15 * S)
    assert span_of(info, 2.5, 3.0) == TimeSpan(7.5 * S, 10.5 * S)
    assert span_of(info, 2.5, 99.0) == TimeSpan(7.5 * S, 15 * S)
    assert span_of(info, 10.0, 0.0) == TimeSpan(15 * S, 15 * S)
    with pytest.raises(ConfigurationError, match=r"start offset is 10\.1 s, must be <= 10 s"):
        span_of(info, 10.1, 0.0)


def test_definitions_are_compared_by_hash_or_schema(bag: Path, tmp_path: Path) -> None:
    types = MessageTypes()
    topic = read_info(bag).topics["/ticks"]
    assert same_definition(topic, types)
    assert not same_definition(replace(topic, type_hash="RIHS01_0"), types)
    write_by_mcap(tmp_path / "other.mcap", 1)  # has a schema and no hash
    foreign = read_info(tmp_path / "other.mcap").topics["/text"]
    assert foreign.type_hash == ""
    assert same_definition(foreign, types)
    assert not same_definition(replace(foreign, schema_text="string data\nint32 more\n"), types)
    assert same_definition(replace(foreign, schema_text="not { a definition"), types)
    assert same_definition(replace(foreign, type="nowhere_msgs/msg/Thing"), types)
