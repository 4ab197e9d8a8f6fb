"""Collector of the messages of a recorded run, by topic, for an analysis."""

from collections.abc import Callable, Iterator
from typing import Any

from sms_handover.bag.files import read_messages
from sms_handover.bag.info import BagInfo
from sms_handover.bag.run.columns import BlockCollector
from sms_handover.bag.run.series import RowCollector
from sms_handover.errors import BagError
from sms_handover.graph import topics
from sms_handover.graph.events import RunEvent
from sms_handover.messages.layout import joint_state, odometry
from sms_handover.messages.stamps import stamp_ns
from sms_handover.messages.values import (
    base_wrench,
    energy_values,
    grasp_event,
    plan_report,
    planned_paths,
    pose_values,
    run_event,
    status_values,
    task_phase,
    twist_values,
    vector_values,
)
from sms_handover.plan_report import PlannedPaths, PlanReport
from sms_handover.types import BaseWrench, GraspEvent, TaskPhase

JOINT_TOPICS = (
    topics.JOINT_STATES,
    topics.JOINT_COMMAND,
    topics.JOINT_REFERENCE,
    topics.MEASURED_JOINT_STATES,
)
POSITION, VELOCITY, EFFORT = range(3)  # blocks gathered from a JointState
BASE_POSE, BASE_TWIST = range(2)  # blocks gathered from an Odometry

_POSE_WITHOUT_COVARIANCE = (0, 2)  # where these are among the blocks of the layout


class RunCollector:
    """The content of one run by topic name, without the namespace."""

    def __init__(self, info: BagInfo, prefix: str) -> None:
        """Prepare for each topic of a run; ``prefix`` is the namespace, '' for the root."""
        self.info = info
        self._prefix = prefix
        self.arms = tuple(self._found_arms())
        self._check_types()
        self.joints = {
            name: BlockCollector(joint_state, (POSITION, VELOCITY, EFFORT)) for name in JOINT_TOPICS
        }
        self.odometry = BlockCollector(odometry, _POSE_WITHOUT_COVARIANCE)
        self.measured_odometry = BlockCollector(odometry, _POSE_WITHOUT_COVARIANCE)
        self.rows = {
            topics.DEPUTY_POSE: RowCollector(7, pose_values),
            topics.MEASURED_DEPUTY_POSE: RowCollector(7, pose_values),
            topics.LINEAR_MOMENTUM: RowCollector(3, vector_values),
            topics.ANGULAR_MOMENTUM: RowCollector(3, vector_values),
            topics.LINEAR_IMPULSE: RowCollector(3, vector_values),
            topics.ANGULAR_IMPULSE: RowCollector(3, vector_values),
            topics.DEPUTY_ODOMETRY: RowCollector(6, twist_values),
            topics.ENERGY: RowCollector(4, energy_values),
            topics.IK_STATUS: RowCollector(1, status_values),
            **{topics.target_pose(arm): RowCollector(7, pose_values) for arm in self.arms},
            **{topics.tool_pose(arm): RowCollector(7, pose_values) for arm in self.arms},
        }
        self.phases: list[TaskPhase] = []
        self.events: list[GraspEvent] = []
        self.run_events: list[RunEvent] = []
        self.plans: list[PlanReport] = []
        self.base_wrenches: list[BaseWrench] = []
        self.applied = ""
        self.planned_paths: list[PlannedPaths] = []
        self._first_ns: int | None = None
        self._newest_ns = 0

    def collect(self) -> None:
        """Read the messages of the bag once."""
        decoders: dict[str, Callable[[Any], None]] = {
            topics.TASK_PHASE: lambda message: self.phases.append(task_phase(message)),
            topics.GRASP_EVENT: lambda message: self.events.append(grasp_event(message)),
            topics.RUN_EVENTS: lambda message: self.run_events.append(run_event(message)),
            topics.APPLIED_VALUES: self._take_applied,
            topics.APPLIED_BASE_WRENCH: lambda message: self.base_wrenches.append(base_wrench(message)),
            topics.MPC_STATUS: lambda message: self.plans.append(plan_report(message)),
            topics.PLANNED_PATHS: lambda message: self.planned_paths.append(planned_paths(message)),
            **{name: rows.add for name, rows in self.rows.items()},
        }
        takers: dict[str, Callable[[bytes], None]] = {
            **{name: collector.add for name, collector in self.joints.items()},
            topics.JOINT_STATES: self._take_state,
            topics.BASE_ODOMETRY: self.odometry.add,
            topics.MEASURED_BASE_ODOMETRY: self.measured_odometry.add,
            **{name: decoder(self.info, self.full_name(name), take) for name, take in decoders.items()},
        }
        by_name = {self.full_name(name): taker for name, taker in takers.items()}
        for message in read_messages(self.info.path, by_name):
            by_name[message.topic](message.data)

    def _take_applied(self, message: Any) -> None:
        """Take what acts in the plant; a run after a reset tells it again."""
        self.applied = str(message.data)

    def _take_state(self, data: bytes) -> None:
        """Take a joint state; one that begins a new run, after a reset, drops the events so far."""
        time_ns = stamp_ns(data)
        if self._first_ns is None:
            self._first_ns = time_ns
        elif time_ns < self._newest_ns and time_ns <= self._first_ns:
            self.events.clear()
            self.run_events.clear()
            self.plans.clear()
            self.base_wrenches.clear()
            self.planned_paths.clear()
        self._newest_ns = time_ns
        self.joints[topics.JOINT_STATES].add(data)

    def full_name(self, name: str) -> str:
        """Return the name of a topic of the run in the bag."""
        return f"{self._prefix}/{name}"

    def _check_types(self) -> None:
        for topic in topics.graph_topics(self.arms, clearance=True, sensors=topics.SENSOR_TYPES):
            recorded = self.info.topics.get(self.full_name(topic.name))
            if recorded is not None and (recorded.type, recorded.encoding) != (topic.type, "cdr"):
                raise BagError(
                    f"{self.info.path} holds no run of sms_handover: {recorded.name} has the type"
                    f" {recorded.type} ({recorded.encoding}), expected is {topic.type} (cdr)"
                )

    def _found_arms(self) -> Iterator[str]:
        head, tail = f"{self._prefix}/", topics.tool_pose("")
        for name in self.info.topics:
            arm = name.removeprefix(head).removesuffix(tail)
            if f"{head}{arm}{tail}" == name and "/" not in arm:  # else it is of another namespace
                yield arm


def decoder(info: BagInfo, name: str, take: Callable[[Any], None]) -> Callable[[bytes], None]:
    """Return a function that decodes a message of a topic by its schema in the bag and calls ``take``."""
    types = info.topics[name].types if name in info.topics else None

    def decode(data: bytes) -> None:
        try:
            take(None if types is None else types.decode(data))
        except (AttributeError, KeyError) as error:
            raise BagError(f"{info.path}: {name} is not as this version knows it: {error}") from error

    return decode
