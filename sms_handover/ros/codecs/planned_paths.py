"""Planned paths as a message: the lines of a MarkerArray read and checked."""

from visualization_msgs.msg import MarkerArray

from sms_handover.errors import MessageError, Reason
from sms_handover.messages.values import planned_paths
from sms_handover.plan_report import PlannedPaths
from sms_handover.ros.codecs.loop_messages import decoded
from sms_handover.ros.codecs.validation import check_finite


def read_planned_paths(data: bytes) -> PlannedPaths:
    """Return the paths of a good message; raises MessageError unless it has lines of finite points."""
    message = decoded(data, MarkerArray)
    if not message.markers or not all(marker.points for marker in message.markers):
        raise MessageError(Reason.LENGTHS, "a MarkerArray has no line, must have one per arm")
    paths = planned_paths(message)
    for arm, path in paths.tool_in_world.items():
        check_finite(path.ravel(), f"the planned path of {arm}")
    return paths
