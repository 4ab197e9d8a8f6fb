"""Quality of service of the graph: nothing may be lost, and what is latched reaches late comers."""

from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile, QoSReliabilityPolicy

from sms_handover.bag.qos import Durability, History, Qos, Reliability
from sms_handover.topics import Topic

LOSSLESS = QoSProfile(
    history=QoSHistoryPolicy.KEEP_ALL,
    reliability=QoSReliabilityPolicy.RELIABLE,
    durability=QoSDurabilityPolicy.VOLATILE,
)  # a slow reader holds the writer back instead of losing messages
LATCHED = QoSProfile(
    history=QoSHistoryPolicy.KEEP_LAST,
    depth=100,  # [messages] kept for subscribers that come late
    reliability=QoSReliabilityPolicy.RELIABLE,
    durability=QoSDurabilityPolicy.TRANSIENT_LOCAL,
)


def profile_of(topic: Topic) -> QoSProfile:
    """Return the profile with which a topic of the graph is published and subscribed."""
    return LATCHED if topic.latched else LOSSLESS


def stored(profile: QoSProfile) -> Qos:
    """Return a profile in the form that a recording keeps."""
    return Qos(
        reliability=Reliability(profile.reliability.name.lower()),
        durability=Durability(profile.durability.name.lower()),
        history=History(profile.history.name.lower()),
        depth=profile.depth,
    )
