"""Markers for viewers, which draw only the robot from its description: the deputy, and planned paths."""

from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from sms_handover.frames import DEPUTY, WORLD
from sms_handover.plan_report import PlannedPaths
from sms_handover.ros.codecs.convert import header
from sms_handover.types import Array

_COLOUR = (0.06, 0.62, 0.42, 1.0)  # [-] red, green, blue, opacity; appearance only
_OF_ARMS = ((0.11, 0.45, 0.72, 1.0), (0.82, 0.38, 0.10, 1.0))  # [-] likewise, in turn
_WIDTH = 0.006  # [m] of a line


def deputy_marker(size: Array) -> Marker:
    """Return a box with edges ``size`` (3,) m that stays with the frame of the deputy, for ever."""
    marker = Marker(header=header(0, DEPUTY), ns=DEPUTY, type=Marker.CUBE, frame_locked=True)
    marker.pose.orientation.w = 1.0
    marker.scale.x, marker.scale.y, marker.scale.z = size.tolist()
    marker.color = _colour(_COLOUR)
    return marker


def path_markers(paths: PlannedPaths) -> MarkerArray:
    """Return a line per arm through where its tool is to be, each named after its arm."""
    markers = []
    for index, (arm, path) in enumerate(paths.tool_in_world.items()):
        marker = Marker(header=header(paths.stamp_ns, WORLD), ns=arm, type=Marker.LINE_STRIP)
        marker.pose.orientation.w, marker.scale.x = 1.0, _WIDTH
        marker.color = _colour(_OF_ARMS[index % len(_OF_ARMS)])
        marker.points = [Point(x=x, y=y, z=z) for x, y, z in path.tolist()]
        markers.append(marker)
    return MarkerArray(markers=markers)


def _colour(parts: tuple[float, float, float, float]) -> ColorRGBA:
    """Return a colour from red, green, blue and opacity."""
    red, green, blue, opacity = parts
    return ColorRGBA(r=red, g=green, b=blue, a=opacity)
