"""Make the messages of ``/tf``, for a bag that viewers show without our robot model."""

from collections.abc import Sequence

from sms_handover.bag.message_types import MessageTypes
from sms_handover.types import Pose
from sms_handover.units import NS_PER_S

TF_TYPE = "tf2_msgs/msg/TFMessage"

Transform = tuple[str, str, Pose]  # parent frame, child frame, pose of the child in the parent


def transforms_cdr(types: MessageTypes, transforms: Sequence[Transform], stamp_ns: int) -> bytes:
    """Return the CDR bytes of one TFMessage with all transforms at one stamp."""
    seconds, nanoseconds = divmod(stamp_ns, NS_PER_S)
    stamp = types.make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    stamped = [
        types.make(
            "geometry_msgs/msg/TransformStamped",
            header=types.make("std_msgs/msg/Header", stamp=stamp, frame_id=parent),
            child_frame_id=child,
            transform=_transform(types, pose),
        )
        for parent, child, pose in transforms
    ]
    return types.serialize(types.make(TF_TYPE, transforms=stamped))


def _transform(types: MessageTypes, pose: Pose) -> object:
    """Return a pose as a Transform message."""
    x, y, z = pose.position.tolist()
    qx, qy, qz, qw = pose.quaternion_xyzw.tolist()
    return types.make(
        "geometry_msgs/msg/Transform",
        translation=types.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
        rotation=types.make("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
    )
