"""Frame names and the order of components.

Quaternions are stored x, y, z, w (as ROS messages and Pinocchio do). A twist is linear part
first, then angular. ``a_in_b`` is the pose of frame ``a`` expressed in frame ``b``: it maps
coordinates in ``a`` to coordinates in ``b``. ``docs/conventions.md`` gives the reasons.
"""

WORLD = "world"
BASE = "base_link"
DEPUTY = "deputy"


def tool_frame(arm: str) -> str:
    """Return the name of the tool frame of an arm, at the far end of its gripper."""
    return f"{arm}_tool"


def mount_frame(arm: str) -> str:
    """Return the name of the frame on the spacecraft where an arm is mounted."""
    return f"{arm}_mount"


def target_frame(arm: str) -> str:
    """Return the name of the frame that the tool frame of an arm is to reach."""
    return f"{arm}_target"


def grasp_frame(name: str) -> str:
    """Return the name of a grasp frame of the deputy among the frames of a graph."""
    return f"{DEPUTY}_{name}"


def joint_name(arm: str, number: int) -> str:
    """Return the name of joint ``number`` of an arm, counted from 1 at the mount."""
    return f"{arm}_joint_{number}"


def arm_of_joint(name: str) -> str:
    """Return the arm that a joint belongs to by its name, '' if it is no joint of an arm."""
    arm, _, number = name.rpartition("_joint_")
    return arm if number.isdecimal() else ""
