"""Topics of the graph as data: who publishes what, who needs it, and how often.

The nodes make their endpoints from this table, wait on it until everything has matched, and the
recorder checks its counts against it. Names are relative, so a namespace moves the whole graph;
``/clock`` and ``/diagnostics`` are global by ROS convention.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from enum import Enum

PLANT = "plant"
TRAJECTORY = "trajectory"
IK = "ik"
CONTROLLER = "controller"
RECORDER = "recorder"
PLAYER, VIEWER, TOPIC_RECORDER = "player", "viewer", "topic_recorder"  # outside the graph
LOOP_NODES = (PLANT, TRAJECTORY, IK, CONTROLLER)
NODES = (*LOOP_NODES, RECORDER)
CONTAINER = "container"  # the process of the nodes of the loop that have none of their own

CLOCK_PERIOD_NS = 10_000_000  # [ns] of simulation time between two /clock messages


class Rate(Enum):
    """When a topic gets a message."""

    TICK = "every tick"
    REFERENCE = "every reference period"
    CLOCK = "every 10 ms of simulation time"
    CHANGE = "on change, latched"
    WALL = "every second of wall time"
    SOLVE = "every solve of a predictive law"
    OUTSIDE = "every tick in which one is asked for"
    OUTSIDE_REFERENCE = "every reference period, once any has acted"
    SHOWN = "every fifth solve of a predictive law"
    SENSOR = "as the sensor gives results"


@dataclass(frozen=True)
class Topic:
    """One topic: ROS name, type, the nodes that publish it and those (but the recorder) that need it."""

    name: str
    type: str
    publishers: tuple[str, ...]
    subscribers: tuple[str, ...]
    rate: Rate

    @property
    def latched(self) -> bool:
        """Whether a late subscriber still gets the last message."""
        return self.rate is Rate.CHANGE

    @property
    def is_global(self) -> bool:
        """Whether the topic is outside the namespace of the graph, where other graphs may publish too."""
        return self.name.startswith("/")

    @property
    def is_from_outside(self) -> bool:
        """Whether no node of the graph publishes the topic; it counts by what its subscriber makes of it."""
        return not self.publishers

    @property
    def is_shared(self) -> bool:
        """Whether others may publish on the topic too, by the conventions of ROS."""
        return self.is_global or self.name in (TF, TF_STATIC)


def target_pose(arm: str) -> str:
    """Return the name of the topic with an arm's target pose."""
    return f"{arm}/target_pose"


def tool_pose(arm: str) -> str:
    """Return the name of the topic with an arm's tool pose."""
    return f"{arm}/tool_pose"


JOINT_STATES = "joint_states"
BASE_ODOMETRY = "base_odometry"
SAMPLED_JOINT_STATES = "sampled_joint_states"  # the same messages, those of reference periods only,
SAMPLED_BASE_ODOMETRY = "sampled_base_odometry"  # so that slow readers do not slow the loop
JOINT_COMMAND = "joint_command"
JOINT_REFERENCE = "joint_reference"
TASK_PHASE = "task/phase"
GRASP_EVENT = "task/grasp_event"
DEPUTY_POSE = "deputy/pose"
DEPUTY_ODOMETRY = "deputy/odometry"
MEASURED_JOINT_STATES = "measured_joint_states"  # what sensors tell, only where there are any
MEASURED_BASE_ODOMETRY = "measured_base_odometry"
MEASURED_SAMPLED_JOINT_STATES = "sampled_measured_joint_states"
MEASURED_SAMPLED_BASE_ODOMETRY = "sampled_measured_base_odometry"
MEASURED_DEPUTY_POSE = "deputy/measured_pose"
GYRO, STAR_TRACKER, VISION = "sensors/gyro", "sensors/star_tracker", "sensors/vision"
SENSOR_TYPES = {  # of the topics of sensors that have one of their own
    GYRO: "sensor_msgs/msg/Imu",
    STAR_TRACKER: "geometry_msgs/msg/PoseWithCovarianceStamped",
    VISION: "geometry_msgs/msg/PoseWithCovarianceStamped",
}
CLEARANCE = "clearance"  # only where it is measured online
LINEAR_MOMENTUM = "momentum/linear"
ANGULAR_MOMENTUM = "momentum/angular"
LINEAR_IMPULSE = "impulse/linear"  # of wrenches from outside
ANGULAR_IMPULSE = "impulse/angular"
BASE_WRENCH = "base_wrench"  # what anybody may ask for,
APPLIED_BASE_WRENCH = "base_wrench/applied"  # and what acted, which is what a recording counts on
ENERGY = "energy"
IK_STATUS = "ik/status"
MPC_STATUS = "mpc/status"  # only where the law solves a program as it goes on
PLANNED_PATHS = "mpc/planned_paths"  # markers, for viewers
ROBOT_DESCRIPTION = "robot_description"
APPLIED_VALUES = "applied_values"
DEPUTY_MARKER = "deputy/marker"
RUN_STATE = "run/state"
RUN_READY = "run/ready"
RUN_PUBLISHED = "run/published"
RUN_EVENTS = "run/events"  # decisions of nodes
RUN_RECORDED = "run/recorded"  # up to which stamp everything is in the bag
LOOP_TIMING = "loop_timing"
CLOCK = "/clock"
DIAGNOSTICS = "/diagnostics"
TF = "tf"  # relative, so that the equal frames of two graphs stay apart; without a namespace it is /tf
TF_STATIC = "tf_static"
TF_TYPE = "tf2_msgs/msg/TFMessage"

REFUSED_TOPIC = "/refused"  # ends the topic of a bag with what others published on a topic of one node


def is_refused(topic: str) -> bool:
    """Whether a topic of a bag holds what others published; nothing of that counts for the run."""
    return topic.endswith(REFUSED_TOPIC)


SOLVE_IK = "solve_ik"  # service of the ik node

_OURS = "sms_handover_interfaces/msg"
RUN_STATE_TYPE = f"{_OURS}/RunState"


def sensor_topic(sensor: str) -> str:
    """Return the name of the topic with what a sensor gives."""
    return f"sensors/{sensor}"


def state_topics(*, measured: bool) -> tuple[str, str]:
    """Return the topics of the state that a controller answers, as it is or as it is measured."""
    return (MEASURED_JOINT_STATES, MEASURED_BASE_ODOMETRY) if measured else (JOINT_STATES, BASE_ODOMETRY)


def sampled_topics(*, measured: bool) -> tuple[str, str, str]:
    """Return the topics of robot and deputy that the trajectory goes by."""
    if measured:
        return MEASURED_SAMPLED_JOINT_STATES, MEASURED_SAMPLED_BASE_ODOMETRY, MEASURED_DEPUTY_POSE
    return SAMPLED_JOINT_STATES, SAMPLED_BASE_ODOMETRY, DEPUTY_POSE


def graph_topics(
    arms: Iterable[str],
    *,
    clearance: bool = False,
    sensors: Collection[str] = (),
    measured: bool = False,
) -> tuple[Topic, ...]:
    """Return every topic of the graph for a robot with these arms.

    ``clearance`` if it is measured online; ``sensors`` are the topics of those that conditions have; with
    ``measured`` the loop goes by what they tell. Nodes outside the graph publish a topic without publishers.
    """
    everyone_else = (TRAJECTORY, IK, CONTROLLER)
    by_law, by_trajectory = state_topics(measured=measured), sampled_topics(measured=measured)
    pose, vector = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/Vector3Stamped"
    odometry = "nav_msgs/msg/Odometry"
    joints, text = "sensor_msgs/msg/JointState", "std_msgs/msg/String"
    wrench = "geometry_msgs/msg/WrenchStamped"

    def state(name: str, type_name: str, rate: Rate) -> Topic:
        needed_by = (CONTROLLER,) * (name in by_law) + (TRAJECTORY,) * (name in by_trajectory)
        return Topic(name, type_name, (PLANT,), needed_by, rate)

    table = [
        state(JOINT_STATES, joints, Rate.TICK),
        state(BASE_ODOMETRY, odometry, Rate.TICK),
        state(SAMPLED_JOINT_STATES, joints, Rate.REFERENCE),
        state(SAMPLED_BASE_ODOMETRY, odometry, Rate.REFERENCE),
        Topic(JOINT_COMMAND, joints, (CONTROLLER,), (PLANT,), Rate.TICK),
        Topic(JOINT_REFERENCE, joints, (TRAJECTORY,), (CONTROLLER,), Rate.REFERENCE),
        Topic(TASK_PHASE, f"{_OURS}/TaskPhase", (TRAJECTORY,), (PLANT, CONTROLLER), Rate.REFERENCE),
        state(DEPUTY_POSE, pose, Rate.REFERENCE),
        Topic(DEPUTY_ODOMETRY, odometry, (PLANT,), (), Rate.REFERENCE),
        Topic(GRASP_EVENT, f"{_OURS}/GraspEvent", (PLANT,), (TRAJECTORY, CONTROLLER), Rate.CHANGE),
        Topic(LINEAR_MOMENTUM, vector, (PLANT,), (), Rate.REFERENCE),
        Topic(ANGULAR_MOMENTUM, vector, (PLANT,), (), Rate.REFERENCE),
        Topic(LINEAR_IMPULSE, vector, (PLANT,), (), Rate.OUTSIDE_REFERENCE),
        Topic(ANGULAR_IMPULSE, vector, (PLANT,), (), Rate.OUTSIDE_REFERENCE),
        Topic(BASE_WRENCH, wrench, (), (PLANT,), Rate.OUTSIDE),
        Topic(APPLIED_BASE_WRENCH, wrench, (PLANT,), (), Rate.OUTSIDE),
        Topic(ENERGY, f"{_OURS}/EnergyStamped", (PLANT,), (), Rate.REFERENCE),
        Topic(IK_STATUS, f"{_OURS}/IkStatus", (TRAJECTORY,), (), Rate.REFERENCE),
        Topic(MPC_STATUS, f"{_OURS}/MpcStatus", (CONTROLLER,), (), Rate.SOLVE),
        Topic(PLANNED_PATHS, "visualization_msgs/msg/MarkerArray", (CONTROLLER,), (), Rate.SHOWN),
        Topic(ROBOT_DESCRIPTION, text, (PLANT,), (), Rate.CHANGE),
        Topic(APPLIED_VALUES, text, (PLANT,), (), Rate.CHANGE),
        Topic(TF, TF_TYPE, (PLANT, TRAJECTORY), (), Rate.REFERENCE),
        Topic(TF_STATIC, TF_TYPE, (PLANT,), (), Rate.CHANGE),
        Topic(DEPUTY_MARKER, "visualization_msgs/msg/Marker", (PLANT,), (), Rate.CHANGE),
        Topic(RUN_STATE, RUN_STATE_TYPE, (PLANT,), everyone_else, Rate.CHANGE),
        Topic(RUN_READY, text, everyone_else, (PLANT,), Rate.CHANGE),
        Topic(RUN_PUBLISHED, f"{_OURS}/PublishedCounts", LOOP_NODES, (), Rate.CHANGE),
        Topic(RUN_EVENTS, f"{_OURS}/RunEvent", LOOP_NODES, (), Rate.CHANGE),
        Topic(RUN_RECORDED, "std_msgs/msg/Header", (RECORDER,), (PLANT,), Rate.WALL),
        Topic(LOOP_TIMING, f"{_OURS}/LoopTiming", (PLANT,), (), Rate.WALL),
        Topic(CLOCK, "rosgraph_msgs/msg/Clock", (PLANT,), (), Rate.CLOCK),
        Topic(DIAGNOSTICS, "diagnostic_msgs/msg/DiagnosticArray", LOOP_NODES, (), Rate.WALL),
    ]
    if sensors or measured:
        table += [
            state(MEASURED_JOINT_STATES, joints, Rate.TICK),
            state(MEASURED_BASE_ODOMETRY, odometry, Rate.TICK),
            state(MEASURED_SAMPLED_JOINT_STATES, joints, Rate.REFERENCE),
            state(MEASURED_SAMPLED_BASE_ODOMETRY, odometry, Rate.REFERENCE),
            state(MEASURED_DEPUTY_POSE, pose, Rate.REFERENCE),
        ]
        table += [
            Topic(name, kind, (PLANT,), (), Rate.SENSOR)
            for name, kind in SENSOR_TYPES.items()
            if name in sensors
        ]
    if clearance:
        table.append(Topic(CLEARANCE, f"{_OURS}/Clearance", (PLANT,), (TRAJECTORY,), Rate.REFERENCE))
    for arm in arms:
        table.append(Topic(target_pose(arm), pose, (TRAJECTORY,), (), Rate.REFERENCE))
        table.append(Topic(tool_pose(arm), pose, (PLANT,), (), Rate.REFERENCE))
    return tuple(table)
