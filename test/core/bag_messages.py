"""CDR messages as the nodes publish them, and a made-up run; used by the tests of bags."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sms_handover.bag.qos import Durability, Qos
from sms_handover.bag.recording import Recording
from sms_handover.graph import topics
from sms_handover.graph.events import RunEvent, Severity
from sms_handover.messages.message_types import MessageTypes
from sms_handover.run_data import Array, RunData
from sms_handover.types import GraspAction, GraspCommand, GraspEvent, GraspStatus, TaskPhase

TICK_NS = 1_000_000
REFERENCE_NS = 20_000_000
WALL_NS = 1_700_000_000_000_000_000
JOINT_STATE = "sensor_msgs/msg/JointState"
OURS = "sms_handover_interfaces/msg"
ARMS = ("arm_a", "arm_b")
JOINTS = tuple(f"{arm}_joint_{number}" for arm in ARMS for number in range(1, 8))
TYPES = MessageTypes()

_ACTIONS = (GraspAction.GRASP, GraspAction.RELEASE, GraspAction.TRANSFER)
_SEVERITIES = (Severity.INFO, Severity.WARNING, Severity.ERROR)
_STATUSES = (GraspStatus.SUCCEEDED, GraspStatus.MISSED, GraspStatus.REJECTED)


def header(stamp_ns: int, frame: str = "") -> Any:
    time = TYPES.make("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return TYPES.make("std_msgs/msg/Header", stamp=time, frame_id=frame)


def joint_state(
    stamp_ns: int,
    names: Sequence[str] = JOINTS,
    position: Sequence[float] | Array = (),
    velocity: Sequence[float] | Array = (),
    effort: Sequence[float] | Array = (),
) -> Any:
    return TYPES.make(
        JOINT_STATE,
        header=header(stamp_ns),
        name=list(names),
        position=np.array(position, dtype=np.float64),
        velocity=np.array(velocity, dtype=np.float64),
        effort=np.array(effort, dtype=np.float64),
    )


def text(content: str) -> Any:
    return TYPES.make("std_msgs/msg/String", data=content)


def published_counts(node: str, counts: dict[str, int]) -> Any:
    numbers = np.array(list(counts.values()), dtype=np.uint64)
    return TYPES.make(f"{OURS}/PublishedCounts", node=node, topics=list(counts), counts=numbers)


def pose(values: Array) -> Any:
    x, y, z, *turn = values.tolist()
    return TYPES.make(
        "geometry_msgs/msg/Pose",
        position=TYPES.make("geometry_msgs/msg/Point", x=x, y=y, z=z),
        orientation=TYPES.make("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", turn, strict=True))),
    )


def pose_stamped(stamp_ns: int, values: Array) -> Any:
    return TYPES.make("geometry_msgs/msg/PoseStamped", header=header(stamp_ns, "world"), pose=pose(values))


def vector(values: Sequence[float] | Array) -> Any:
    return TYPES.make("geometry_msgs/msg/Vector3", **dict(zip("xyz", map(float, values), strict=True)))


def vector_stamped(stamp_ns: int, values: Array) -> Any:
    return TYPES.make(
        "geometry_msgs/msg/Vector3Stamped", header=header(stamp_ns, "world"), vector=vector(values)
    )


def odometry(stamp_ns: int, base_pose: Array, base_twist: Array, covariance: float = 0.0) -> Any:
    spread = np.full(36, covariance)
    twist = TYPES.make(
        "geometry_msgs/msg/Twist", linear=vector(base_twist[:3]), angular=vector(base_twist[3:])
    )
    return TYPES.make(
        "nav_msgs/msg/Odometry",
        header=header(stamp_ns, "world"),
        child_frame_id="base_link",
        pose=TYPES.make("geometry_msgs/msg/PoseWithCovariance", pose=pose(base_pose), covariance=spread),
        twist=TYPES.make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=spread),
    )


def grasp_command(command: GraspCommand) -> Any:
    return TYPES.make(
        f"{OURS}/GraspCommand",
        action=_ACTIONS.index(command.action),
        arm=command.arm,
        grasp_frame=command.grasp_frame,
        from_arm=command.from_arm,
    )


def grasp_event(event: GraspEvent) -> Any:
    return TYPES.make(
        f"{OURS}/GraspEvent",
        header=header(event.stamp_ns),
        command=grasp_command(event.command),
        status=_STATUSES.index(event.status),
        position_error=event.position_error,
        angle_error=event.angle_error,
        relative_speed=event.relative_speed,
        relative_rate=event.relative_rate,
        detail=event.detail,
        relative_twist=TYPES.make(
            "geometry_msgs/msg/Twist",
            linear=vector(event.relative_twist[:3]),
            angular=vector(event.relative_twist[3:]),
        ),
        impulse=TYPES.make(
            "geometry_msgs/msg/Wrench", force=vector(event.impulse[:3]), torque=vector(event.impulse[3:])
        ),
        energy_lost=event.energy_lost,
    )


def task_phase(phase: TaskPhase) -> Any:
    return TYPES.make(
        f"{OURS}/TaskPhase",
        header=header(phase.stamp_ns),
        index=phase.index,
        name=phase.name,
        commands=[grasp_command(command) for command in phase.commands],
        state=int(phase.failed),
        attempt=phase.attempt,
        end=header(phase.end_ns).stamp,
    )


def run_event(event: RunEvent) -> Any:
    return TYPES.make(
        f"{OURS}/RunEvent",
        header=header(event.stamp_ns),
        node=event.node,
        kind=event.kind,
        severity=_SEVERITIES.index(event.severity),
        phase=event.phase,
        detail=event.detail,
        value=event.value,
        limit=event.limit,
        unit=event.unit,
    )


def ik_status(stamp_ns: int, status: int) -> Any:
    return TYPES.make(
        f"{OURS}/IkStatus",
        header=header(stamp_ns),
        status=status,
        iterations=4,
        position_error=1e-9,
        orientation_error=1e-9,
        limit_margin=0.5,
        manipulability=np.array([0.1, 0.2]),
        seed_distance=0.01,
    )


def energy(stamp_ns: int, kinetic: float, work: float, external_work: float, lost: float) -> Any:
    values = {"kinetic": kinetic, "work": work, "external_work": external_work, "lost": lost}
    return TYPES.make(f"{OURS}/EnergyStamped", header=header(stamp_ns), **values)


def made_up_run(ticks: int = 101, seed: int = 0) -> RunData:
    """Return a run of random numbers, with a grasp and IK statuses of every kind."""
    random = np.random.default_rng(seed)
    n, periods = len(JOINTS), (ticks - 1) * TICK_NS // REFERENCE_NS + 1
    reference_ns = np.arange(periods, dtype=np.int64) * REFERENCE_NS
    grasp = GraspCommand(GraspAction.GRASP, "arm_a", "end_a")
    transfer = GraspCommand(GraspAction.TRANSFER, "arm_b", "end_b", "arm_a")
    return RunData(
        joint_names=JOINTS,
        arms=ARMS,
        tick_ns=np.arange(ticks, dtype=np.int64) * TICK_NS,
        joint_position=random.standard_normal((ticks, n)),
        joint_velocity=random.standard_normal((ticks, n)),
        joint_effort=random.standard_normal((ticks, n)),
        joint_command=random.standard_normal((ticks, n)),
        base_pose=random.standard_normal((ticks, 7)),
        base_twist=random.standard_normal((ticks, 6)),
        reference_ns=reference_ns,
        reference_position=random.standard_normal((periods, n)),
        reference_velocity=random.standard_normal((periods, n)),
        target_pose={arm: random.standard_normal((periods, 7)) for arm in ARMS},
        tool_pose={arm: random.standard_normal((periods, 7)) for arm in ARMS},
        deputy_pose=random.standard_normal((periods, 7)),
        deputy_twist=random.standard_normal((periods, 6)),
        linear_momentum=random.standard_normal((periods, 3)),
        angular_momentum=random.standard_normal((periods, 3)),
        kinetic_energy=random.standard_normal(periods),
        work=random.standard_normal(periods),
        external_work=random.standard_normal(periods),
        lost=random.standard_normal(periods),
        elastic_energy=np.zeros(periods),
        panel_position=np.zeros((periods, 0)),
        panel_velocity=np.zeros((periods, 0)),
        linear_impulse=np.zeros((periods, 3)),
        angular_impulse=np.zeros((periods, 3)),
        ik_status=np.arange(periods, dtype=np.int64) % 4 - 1,
        phases=tuple(
            TaskPhase(int(stamp_ns), row // 2, f"phase {row // 2}", (grasp, transfer) if row == 2 else ())
            for row, stamp_ns in enumerate(reference_ns)
        ),
        grasp_events=(
            GraspEvent(REFERENCE_NS * 2, grasp, GraspStatus.SUCCEEDED, 1e-3, 2e-3, 3e-3, ""),
            GraspEvent(REFERENCE_NS * 2, transfer, GraspStatus.MISSED, 0.1, 0.2, float("nan"), "too far"),
        ),
        run_events=(
            RunEvent(0, "plant", "begun", Severity.INFO, "all is well"),
            RunEvent(TICK_NS, "plant", "late", Severity.ERROR, "no command", "carry", 0.2, 0.1, "s"),
        ),
    )


def open_topics(recording: Recording, prefix: str = "", arms: Sequence[str] = ARMS) -> None:
    """Add every topic of the graph."""
    periods = {topics.Rate.TICK: TICK_NS, topics.Rate.REFERENCE: REFERENCE_NS}
    for topic in topics.graph_topics(arms):
        name = topic.name if topic.name.startswith("/") else f"{prefix}/{topic.name}"
        durability = Durability.TRANSIENT_LOCAL if topic.latched else Durability.VOLATILE
        recording.add_topic(name, topic.type, (Qos(durability=durability),), periods.get(topic.rate, 0))


def record_run(recording: Recording, run: RunData, prefix: str = "") -> None:
    """Hand the messages of a run to a recording in the order in which the nodes publish them."""

    def receive(name: str, message: Any) -> None:
        recording.receive(f"{prefix}/{name}", TYPES.serialize(message), WALL_NS)

    rows = {int(stamp_ns): row for row, stamp_ns in enumerate(run.reference_ns)}
    receive(topics.ROBOT_DESCRIPTION, text("<robot/>"))
    for k, stamp in enumerate(run.tick_ns):
        stamp_ns = int(stamp)
        receive(
            topics.JOINT_STATES,
            joint_state(
                stamp_ns, run.joint_names, run.joint_position[k], run.joint_velocity[k], run.joint_effort[k]
            ),
        )
        receive(topics.BASE_ODOMETRY, odometry(stamp_ns, run.base_pose[k], run.base_twist[k]))
        if stamp_ns in rows:
            record_reference(receive, run, rows[stamp_ns])
        for event in run.grasp_events:
            if event.stamp_ns == stamp_ns:
                receive(topics.GRASP_EVENT, grasp_event(event))
        for decision in run.run_events:
            if decision.stamp_ns == stamp_ns:
                receive(topics.RUN_EVENTS, run_event(decision))
        receive(topics.JOINT_COMMAND, joint_state(stamp_ns, run.joint_names, effort=run.joint_command[k]))


def record_reference(receive: Any, run: RunData, row: int) -> None:
    """Hand over the messages of one reference period."""
    stamp_ns = int(run.reference_ns[row])
    receive(topics.DEPUTY_POSE, pose_stamped(stamp_ns, run.deputy_pose[row]))
    receive(topics.LINEAR_MOMENTUM, vector_stamped(stamp_ns, run.linear_momentum[row]))
    receive(topics.ANGULAR_MOMENTUM, vector_stamped(stamp_ns, run.angular_momentum[row]))
    receive(topics.DEPUTY_ODOMETRY, odometry(stamp_ns, run.deputy_pose[row], run.deputy_twist[row]))
    account = (run.kinetic_energy, run.work, run.external_work, run.lost)
    receive(topics.ENERGY, energy(stamp_ns, *(float(values[row]) for values in account)))
    for arm in run.arms:
        receive(topics.tool_pose(arm), pose_stamped(stamp_ns, run.tool_pose[arm][row]))
        receive(topics.target_pose(arm), pose_stamped(stamp_ns, run.target_pose[arm][row]))
    if run.ik_status[row] >= 0:
        receive(topics.IK_STATUS, ik_status(stamp_ns, int(run.ik_status[row])))
    receive(topics.TASK_PHASE, task_phase(run.phases[row]))
    receive(
        topics.JOINT_REFERENCE,
        joint_state(
            stamp_ns,
            run.joint_names[::-1],  # matched by name, not by place
            run.reference_position[row][::-1],
            run.reference_velocity[row][::-1],
        ),
    )


def write_run(folder: Path, run: RunData, prefix: str = "") -> Path:
    """Write a bag of a run and return its folder."""
    with Recording(folder, types=TYPES) as recording:
        open_topics(recording, prefix)
        record_run(recording, run, prefix)
    return folder
