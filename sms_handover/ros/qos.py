"""QoS of the graph: nothing may be lost, and what is latched reaches late subscribers."""

from collections.abc import Sequence
from typing import Any

from rclpy.duration import Infinite
from rclpy.qos import (
    QoSCompatibility,
    QoSDurabilityPolicy,
    QoSHistoryPolicy,
    QoSLivelinessPolicy,
    QoSProfile,
    QoSReliabilityPolicy,
    qos_check_compatible,
)

from sms_handover.bag.qos import Durability, History, Qos, Reliability
from sms_handover.graph.topics import Topic

# in full, so that a profile can be compared with one from discovery
_UNTIMED: dict[str, Any] = {
    "deadline": Infinite,
    "liveliness": QoSLivelinessPolicy.AUTOMATIC,
    "liveliness_lease_duration": Infinite,
}
LOSSLESS = QoSProfile(
    history=QoSHistoryPolicy.KEEP_ALL,
    reliability=QoSReliabilityPolicy.RELIABLE,
    durability=QoSDurabilityPolicy.VOLATILE,
    **_UNTIMED,
)  # a slow reader holds the writer back instead of losing messages
LATCHED = QoSProfile(
    history=QoSHistoryPolicy.KEEP_LAST,
    depth=100,  # [messages] kept for subscribers that come late
    reliability=QoSReliabilityPolicy.RELIABLE,
    durability=QoSDurabilityPolicy.TRANSIENT_LOCAL,
    **_UNTIMED,
)


PATIENT = QoSProfile(
    history=QoSHistoryPolicy.KEEP_LAST,
    depth=1000,  # [messages] 20 s of reference periods in real time, more than a recorder is ever behind
    reliability=QoSReliabilityPolicy.RELIABLE,
    durability=QoSDurabilityPolicy.VOLATILE,
    **_UNTIMED,
)  # a reader of others that hangs loses messages, and holds nobody back


def profile_of(topic: Topic) -> QoSProfile:
    """Return the profile with which a topic of the graph is published and subscribed."""
    if topic.latched:
        return LATCHED
    return PATIENT if topic.is_shared and not topic.is_global else LOSSLESS


def stored(profile: QoSProfile) -> Qos:
    """Return a profile in the form that a recording keeps."""
    return Qos(
        reliability=Reliability(profile.reliability.name.lower()),
        durability=Durability(profile.durability.name.lower()),
        history=History(profile.history.name.lower()),
        depth=profile.depth,
    )


def serves(offered: QoSProfile, asked: QoSProfile) -> bool:
    """Whether a publisher's profile and a subscription's can match."""
    return bool(qos_check_compatible(offered, asked)[0] != QoSCompatibility.ERROR)


def weakest(offers: Sequence[QoSProfile]) -> QoSProfile:
    """Return a profile that every one of the offered ones can serve, with a queue that drops nothing."""
    reliable = all(offer.reliability == QoSReliabilityPolicy.RELIABLE for offer in offers)
    latched = all(offer.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL for offer in offers)
    return QoSProfile(
        history=LOSSLESS.history,
        reliability=LOSSLESS.reliability if reliable else QoSReliabilityPolicy.BEST_EFFORT,
        durability=QoSDurabilityPolicy.TRANSIENT_LOCAL if latched else QoSDurabilityPolicy.VOLATILE,
    )
