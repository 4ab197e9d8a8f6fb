"""Quality of service of the graph: nothing may be lost, and what is latched reaches late comers."""

from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile, QoSReliabilityPolicy

from sms_handover.topics import Topic

LATCHED_DEPTH = 100  # [messages] kept for subscribers that come late


def profile_of(topic: Topic) -> QoSProfile:
    """Return the profile with which a topic is published and subscribed.

    Reliable and KEEP_ALL, so a slow reader holds the writer back instead of losing messages; a
    latched topic keeps its last messages for late subscribers.
    """
    if topic.latched:
        return QoSProfile(
            history=QoSHistoryPolicy.KEEP_LAST,
            depth=LATCHED_DEPTH,
            reliability=QoSReliabilityPolicy.RELIABLE,
            durability=QoSDurabilityPolicy.TRANSIENT_LOCAL,
        )
    return QoSProfile(
        history=QoSHistoryPolicy.KEEP_ALL,
        reliability=QoSReliabilityPolicy.RELIABLE,
        durability=QoSDurabilityPolicy.VOLATILE,
    )
