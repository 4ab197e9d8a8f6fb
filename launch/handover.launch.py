"""The graph under ros2 launch: arguments, nodes, and when it ends; wiring only.

With a recorder it ends when the bag is complete. A node that fails ends it with exit code 1.
``sms-handover run`` starts the same graph without the launch system, checks the scenario before any
node starts, and shows progress.
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.events.process import ProcessExited
from launch_ros.actions import Node

from sms_handover.errors import GraphError
from sms_handover.graph.topics import CONTAINER
from sms_handover.ros.launching.launch_arguments import ARGUMENTS, launch_processes
from sms_handover.ros.process.launcher_process import launcher_environment

PACKAGE = "sms_handover"
OWN_ARGUMENTS = (
    DeclareLaunchArgument(
        "params_file", default_value="", description="parameters in ROS 2 form on top of the shipped ones"
    ),
    DeclareLaunchArgument(
        "record", default_value="true", choices=["true", "false"], description="whether to record the graph"
    ),
    DeclareLaunchArgument(
        "compose",
        default_value="false",
        choices=["true", "false"],
        description="whether nodes that wait for each other share one process, which is faster",
    ),
    DeclareLaunchArgument(
        "nodes",
        default_value="",
        description="nodes to start on this host, with commas between; not given: all (docs/hosts.md)",
    ),
    DeclareLaunchArgument("namespace", default_value="", description="namespace of nodes and topics"),
    DeclareLaunchArgument("log_level", default_value="info", description="least severity that is logged"),
)


def generate_launch_description() -> LaunchDescription:
    """Return the arguments, and what they start."""
    of_parameters = [
        DeclareLaunchArgument(name, default_value="", description=item.text, choices=item.choices)
        for name, item in ARGUMENTS.items()
    ]
    return LaunchDescription([*of_parameters, *OWN_ARGUMENTS, OpaqueFunction(function=start)])


def start(context: LaunchContext) -> list[Node]:
    """Return the processes that the arguments ask for."""
    given = context.launch_configurations
    record, compose = (given[name] == "true" for name in ("record", "compose"))
    return [
        Node(
            package=PACKAGE,
            executable=name,
            name=None if name == CONTAINER else name,
            namespace=given["namespace"],
            output="screen",
            arguments=list(arguments.nodes),
            ros_arguments=[*arguments.ros, "--log-level", given["log_level"]],
            additional_env={
                "OPENBLAS_NUM_THREADS": "1",
                "PYTHONUNBUFFERED": "1",
                **launcher_environment(),  # the nodes end with this process
            },
            on_exit=end,
        )
        for name, arguments in launch_processes(given, record=record, compose=compose).items()
    ]


def end(event: ProcessExited, context: LaunchContext) -> Shutdown | None:
    """End the launch when a node has ended: the recorder when all is recorded, any other by mistake."""
    if context.is_shutdown:
        return None
    if event.returncode:
        raise GraphError(f"{event.process_name} ended with exit code {event.returncode}")
    return Shutdown(reason=f"{event.process_name} is done")
