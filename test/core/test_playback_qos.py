"""Recorded profiles: both forms of rosbag2, as rosbags writes them too, and what users may override."""

from pathlib import Path

import pytest
from rosbags.interfaces import Qos as RosbagsQos
from rosbags.interfaces import QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from sms_handover.bag.info import read_info
from sms_handover.bag.metadata import qos_text
from sms_handover.bag.qos import Durability, History, Qos, Reliability
from sms_handover.errors import ConfigurationError
from sms_handover.playback.qos import Liveliness, Offer, read_offer, read_overrides, with_policies

NUMBERED = """
- history: {history}
  depth: 7
  reliability: {reliability}
  durability: {durability}
  deadline: {{sec: 0, nsec: 100000000}}
  lifespan: {{sec: 2147483647, nsec: 4294967295}}
  liveliness: {liveliness}
  liveliness_lease_duration: {{sec: 9223372036, nsec: 854775807}}
  avoid_ros_namespace_conventions: false
"""


@pytest.mark.parametrize("reliability", list(Reliability))
@pytest.mark.parametrize("durability", list(Durability))
@pytest.mark.parametrize("history", list(History))
def test_our_own_profiles_are_read_back(
    reliability: Reliability, durability: Durability, history: History
) -> None:
    offer = read_offer(qos_text([Qos(reliability, durability, history, 7).to_rosbag2()]))
    assert offer == Offer(reliability, durability, history, 7)


def test_numbers_of_the_older_form_are_those_of_rmw() -> None:
    """rmw/types.h: keep_last 1, keep_all 2; reliable 1, best effort 2; transient local 1, volatile 2."""
    text = NUMBERED.format(history=1, reliability=2, durability=1, liveliness=3)
    assert read_offer(text) == Offer(
        Reliability.BEST_EFFORT,
        Durability.TRANSIENT_LOCAL,
        History.KEEP_LAST,
        7,
        deadline_ns=100_000_000,
        liveliness=Liveliness.MANUAL_BY_TOPIC,
    )
    text = NUMBERED.format(history=3, reliability=1, durability=2, liveliness=1)
    assert read_offer(text) == Offer(depth=7, deadline_ns=100_000_000)


@pytest.mark.parametrize("version", [8, 9])
def test_what_rosbags_writes_is_read(tmp_path: Path, version: int) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    time = QosTime(0, 0)
    profile = RosbagsQos(
        QosHistory.KEEP_LAST,
        3,
        QosReliability.BEST_EFFORT,
        QosDurability.TRANSIENT_LOCAL,
        QosTime(1, 5),
        time,
        QosLiveliness.AUTOMATIC,
        time,
        False,
    )
    plugin = StoragePlugin.MCAP
    with RosbagsWriter(tmp_path / "bag", version=version, storage_plugin=plugin) as writer:  # type: ignore[arg-type]
        kind = "std_msgs/msg/String"
        writer.add_connection("/text", kind, typestore=store, offered_qos_profiles=[profile])
    offer = read_offer(read_info(tmp_path / "bag").topics["/text"].qos)
    assert (offer.reliability, offer.durability) == (Reliability.BEST_EFFORT, Durability.TRANSIENT_LOCAL)
    assert (offer.history, offer.depth) == (History.KEEP_LAST, 3)
    assert (offer.deadline_ns, offer.lifespan_ns) == (1_000_000_005, None)


def test_without_any_profile_it_is_reliable() -> None:
    assert read_offer("") == read_offer("[]") == Offer()


def test_of_several_profiles_the_stronger_counts() -> None:
    """It serves every subscriber that listened to one of them."""
    weak = Qos(Reliability.BEST_EFFORT, Durability.VOLATILE, History.KEEP_LAST, 1)
    strong = Qos(Reliability.RELIABLE, Durability.TRANSIENT_LOCAL, History.KEEP_LAST, 5)
    for profiles in ([weak, strong], [strong, weak]):
        offer = read_offer(qos_text([profile.to_rosbag2() for profile in profiles]))
        assert (offer.reliability, offer.durability) == (Reliability.RELIABLE, Durability.TRANSIENT_LOCAL)
        assert offer.depth == 5
    assert read_offer(qos_text([weak.to_rosbag2()] * 2)).reliability is Reliability.BEST_EFFORT


@pytest.mark.parametrize("text", ["{", "history: 1", "- 1"])
def test_a_text_that_is_no_profile_is_as_good_as_none(text: str) -> None:
    assert read_offer(text) == Offer()


@pytest.mark.parametrize(
    ("policies", "told"),
    [
        ({"history": "keep_some"}, "unknown value 'keep_some'.*keep_last"),
        ({"depth": -1}, "depth is -1, must be >= 0"),
        ({"deadline": 5}, "deadline is 5, must be a mapping with sec and nsec"),
        ({"deadline": {"sec": 1, "nsec": 0.5}}, "nsec is 0.5, must be a whole number"),
        ({"colour": "red"}, "there: unknown policy 'colour'"),
    ],
)
def test_policies_that_are_none_are_refused(policies: dict[str, object], told: str) -> None:
    with pytest.raises(ConfigurationError, match=told):
        with_policies(Offer(), policies, "there")


def test_overrides_change_what_they_name_only(tmp_path: Path) -> None:
    path = tmp_path / "qos.yaml"
    path.write_text("/map: {durability: transient_local, depth: 2}\n", encoding="utf-8")
    recorded = Offer(Reliability.BEST_EFFORT, deadline_ns=5)
    offer = with_policies(recorded, read_overrides(path)["/map"], "there")
    assert offer == Offer(Reliability.BEST_EFFORT, Durability.TRANSIENT_LOCAL, depth=2, deadline_ns=5)


@pytest.mark.parametrize("text", ["/map: reliable\n", "/map: {reliability: sometimes}\n", "[]\n"])
def test_a_wrong_file_of_overrides_is_refused_with_its_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / "qos.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"qos\.yaml"):
        read_overrides(path)
