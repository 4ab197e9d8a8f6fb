"""Marker that shows the deputy in viewers, which draw only the robot from its description."""

from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from sms_handover.frames import DEPUTY
from sms_handover.ros.codecs.convert import header
from sms_handover.types import Array

_COLOUR = (0.06, 0.62, 0.42, 1.0)  # [-] red, green, blue, opacity; appearance only


def deputy_marker(size: Array) -> Marker:
    """Return a box with edges ``size`` (3,) m that stays with the frame of the deputy, for ever."""
    marker = Marker(header=header(0, DEPUTY), ns=DEPUTY, type=Marker.CUBE, frame_locked=True)
    marker.pose.orientation.w = 1.0
    marker.scale.x, marker.scale.y, marker.scale.z = size.tolist()
    red, green, blue, opacity = _COLOUR
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=opacity)
    return marker
