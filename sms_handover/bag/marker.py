"""Make the marker that shows the deputy in viewers, which draw the robot from its description alone."""

import numpy as np

from sms_handover.bag.message_types import MessageTypes
from sms_handover.frames import DEPUTY
from sms_handover.types import Array

MARKER_TYPE = "visualization_msgs/msg/Marker"

_CUBE, _ADD = 1, 0  # [-] numbers of visualization_msgs/msg/Marker
_COLOUR = (0.06, 0.62, 0.42, 1.0)  # [-] red, green, blue, opacity; appearance only


def deputy_marker_cdr(types: MessageTypes, size: Array) -> bytes:
    """Return the CDR bytes of a box with edges ``size`` (3,) m that stays with the frame of the deputy."""

    def floats(kind: str, names: str, values: Array | tuple[float, ...]) -> object:
        return types.make(kind, **dict(zip(names, map(float, values), strict=True)))

    time = {"sec": 0, "nanosec": 0}
    stamp = types.make("builtin_interfaces/msg/Time", **time)
    header = types.make("std_msgs/msg/Header", stamp=stamp, frame_id=DEPUTY)
    nothing = np.zeros(0, dtype=np.uint8)
    texture = types.make("sensor_msgs/msg/CompressedImage", header=header, format="", data=nothing)
    return types.serialize(
        types.make(
            MARKER_TYPE,
            header=header,
            ns=DEPUTY,
            id=0,
            type=_CUBE,
            action=_ADD,
            pose=types.make(
                "geometry_msgs/msg/Pose",
                position=floats("geometry_msgs/msg/Point", "xyz", np.zeros(3)),
                orientation=floats("geometry_msgs/msg/Quaternion", "xyzw", (0.0, 0.0, 0.0, 1.0)),
            ),
            scale=floats("geometry_msgs/msg/Vector3", "xyz", size),
            color=floats("std_msgs/msg/ColorRGBA", "rgba", _COLOUR),
            lifetime=types.make("builtin_interfaces/msg/Duration", **time),  # zero: for ever
            frame_locked=True,
            points=[],
            colors=[],
            texture_resource="",
            texture=texture,
            uv_coordinates=[],
            text="",
            mesh_resource="",
            mesh_file=types.make("visualization_msgs/msg/MeshFile", filename="", data=nothing),
            mesh_use_embedded_materials=False,
        )
    )
