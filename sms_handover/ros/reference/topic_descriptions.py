"""Topic descriptions, for the help of the nodes and docs/topics.md."""

from sms_handover.graph import topics
from sms_handover.graph.topics import Topic

_CONTENTS = {
    topics.JOINT_STATES: "joint positions [rad], velocities [rad/s], efforts of the last tick [N m]",
    topics.BASE_ODOMETRY: "pose of base_link in world [m], its twist in base_link [m/s, rad/s]",
    topics.SAMPLED_JOINT_STATES: "those of joint_states that fall on a reference period",
    topics.SAMPLED_BASE_ODOMETRY: "those of base_odometry that fall on a reference period",
    topics.JOINT_COMMAND: "joint efforts asked for [N m], with the stamp of the state that they answer",
    topics.JOINT_REFERENCE: "desired joint positions [rad] and velocities [rad/s]",
    topics.TASK_PHASE: "the phase of the schedule in force, and the grasp commands due at this instant",
    topics.DEPUTY_POSE: "pose of the CubeSat in world [m]",
    topics.DEPUTY_ODOMETRY: "pose of the CubeSat in world [m], its twist in its own axes [m/s, rad/s]",
    topics.CLEARANCE: "least distances of bodies [m], their nearest points; only if clearance is online",
    topics.MEASURED_JOINT_STATES: "joint_states by the encoders, efforts as they are; only with sensors",
    topics.MEASURED_BASE_ODOMETRY: "base_odometry by gyro and star tracker, else as it is; only with sensors",
    topics.MEASURED_SAMPLED_JOINT_STATES: "those of measured_joint_states that fall on a reference period",
    topics.MEASURED_SAMPLED_BASE_ODOMETRY: "those of measured_base_odometry that fall on a reference period",
    topics.MEASURED_DEPUTY_POSE: "deputy/pose by vision, the latest one that has come; only with sensors",
    topics.GYRO: "angular velocity of base_link in its axes [rad/s]; only with this sensor",
    topics.STAR_TRACKER: "orientation of base_link in world, its position as it is; only with this sensor",
    topics.VISION: "pose of the CubeSat in base_link [m]; only with this sensor",
    topics.DEPUTY_MARKER: "the shape of the CubeSat, for viewers",
    topics.GRASP_EVENT: "result of a grasp command: errors at that instant, impulse [N s, N m s], heat [J]",
    topics.LINEAR_MOMENTUM: "linear momentum of robot and deputy in world axes [kg m/s]",
    topics.ANGULAR_MOMENTUM: "angular momentum about their centre of mass in world axes [kg m^2/s]",
    topics.LINEAR_IMPULSE: "what wrenches from outside have added to it [N s]",
    topics.ANGULAR_IMPULSE: "what they have added to that [N m s]",
    topics.BASE_WRENCH: "a wrench that is to act on base_link over the tick of its stamp [N, N m]",
    topics.APPLIED_BASE_WRENCH: "the one that has acted, with the stamp of its tick [N, N m]",
    topics.ENERGY: "kinetic energy, work of the joint efforts and from outside, and what became heat [J]",
    topics.IK_STATUS: "how the last inverse-kinematics solve ended: status, iterations, errors [m, rad]",
    topics.MPC_STATUS: "what came of a solve: status, rows that bind, slack, times [s]; only under law mpc",
    topics.PLANNED_PATHS: "where the tools go by the plan in use, a line per arm; only under law mpc",
    topics.ROBOT_DESCRIPTION: "URDF of the robot",
    topics.APPLIED_VALUES: "JSON of conditions and inertias, read back from the plant",
    topics.TF: "every moving link in its parent [m], and in world base_link, deputy and targets",
    topics.TF_STATIC: "every link that does not move in its parent [m], and the grasp frames in deputy",
    topics.RUN_STATE: "whether the run waits, runs, pauses or is over",
    topics.RUN_READY: "name of a node that is ready to begin",
    topics.RUN_PUBLISHED: "how many messages a node has published on each topic, once at the end",
    topics.RUN_EVENTS: "decisions of a node: a watchdog, a rejected message, a retried phase",
    topics.RUN_RECORDED: "up to which stamp all is in the bag; the plant goes at most 45 ms ahead",
    topics.LOOP_TIMING: "late ticks, held commands, the real period [s] and the real-time factor",
    topics.CLOCK: "simulation time",
    topics.DIAGNOSTICS: "what a node is doing or waiting for",
    topics.target_pose(""): "target pose of the tool in world [m]",
    topics.tool_pose(""): "pose of the tool in world [m]",
}


def contents_of(topic: Topic) -> str:
    """Return what a topic of the graph carries; raises KeyError if it has no description."""
    of_an_arm = topic.name[topic.name.find("/") :]
    return _CONTENTS[of_an_arm if of_an_arm in _CONTENTS else topic.name]
