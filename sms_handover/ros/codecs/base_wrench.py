"""Base wrench as a message: WrenchStamped read, checked, and written."""

import numpy as np
from geometry_msgs.msg import WrenchStamped

from sms_handover.messages.values import base_wrench
from sms_handover.ros.codecs.convert import header
from sms_handover.ros.codecs.loop_messages import arrival_ns, decoded
from sms_handover.ros.codecs.validation import check_finite
from sms_handover.types import BaseWrench


def read_base_wrench(data: bytes) -> BaseWrench:
    """Return the wrench of a good message; raises MessageError unless its stamp and numbers are good."""
    arrival_ns(data)
    wrench = base_wrench(decoded(data, WrenchStamped))
    check_finite(np.array([*wrench.force, *wrench.torque]), "a wrench")
    return wrench


def wrench_message(wrench: BaseWrench) -> WrenchStamped:
    """Return the message of a wrench."""
    message = WrenchStamped(header=header(wrench.stamp_ns))
    message.header.frame_id = wrench.frame
    for part, numbers in ((message.wrench.force, wrench.force), (message.wrench.torque, wrench.torque)):
        part.x, part.y, part.z = numbers
    return message
