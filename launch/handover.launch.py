"""The graph under ros2 launch: arguments and nodes, wiring only.

For a full ROS 2 installation; ``sms-handover run`` starts the same graph without the launch system,
and also checks the scenario first and waits for the recorder at the end.
"""

from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node

from launch import LaunchDescription

PACKAGE = "sms_handover"
LOOP_NODES = ("plant", "trajectory", "ik", "controller")

ARGUMENTS = {
    "controller": ("nmpc", "control law: nmpc or pid"),
    "schedule": ("", "path of a task schedule; empty: the package's handover.yaml"),
    "robot": ("", "path of a robot description; empty: the package's robot.yaml"),
    "mode": ("lockstep", "lockstep or realtime"),
    "record": ("true", "whether to record the graph"),
    "bag": ("", "new folder for the bag; empty: handover_<date>_<time>"),
}


def generate_launch_description() -> LaunchDescription:
    """Return the loop nodes, and a recorder that is one of their peers if one is wanted."""
    record = LaunchConfiguration("record")
    with_recorder = [" + (['recorder'] if '", record, "' == 'true' else [])"]
    peers = PythonExpression([repr(list(LOOP_NODES)), *with_recorder])
    common = {name: LaunchConfiguration(name) for name in ("schedule", "robot", "mode")} | {"peers": peers}
    own = {"controller": {"law": LaunchConfiguration("controller")}}
    nodes = [
        Node(
            package=PACKAGE,
            executable=name,
            name=name,
            output="screen",
            parameters=[common, own.get(name, {})],
        )
        for name in LOOP_NODES
    ]
    recorder = Node(
        package=PACKAGE,
        executable="recorder",
        name="recorder",
        output="screen",
        parameters=[common, {"folder": LaunchConfiguration("bag")}],
        condition=IfCondition(record),
    )
    declared = [
        DeclareLaunchArgument(name, default_value=value, description=text)
        for name, (value, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, *nodes, recorder])
