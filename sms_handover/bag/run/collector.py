"""Sort the messages of a recorded run by topic and take from each what an analysis needs."""

from collections.abc import Callable, Iterator

from sms_handover.bag.files import read_messages
from sms_handover.bag.info import BagInfo
from sms_handover.bag.run.columns import BlockCollector, joint_state_layout, odometry_layout
from sms_handover.bag.run.series import RowCollector
from sms_handover.errors import BagError
from sms_handover.graph import topics
from sms_handover.graph.events import RunEvent
from sms_handover.messages.message_types import MessageTypes
from sms_handover.messages.stamps import stamp_ns
from sms_handover.messages.values import (
    energy_values,
    grasp_event,
    pose_values,
    run_event,
    status_values,
    task_phase,
    vector_values,
)
from sms_handover.types import GraspEvent, TaskPhase

JOINT_TOPICS = (topics.JOINT_STATES, topics.JOINT_COMMAND, topics.JOINT_REFERENCE)
POSITION, VELOCITY, EFFORT = range(3)  # blocks gathered from a JointState
BASE_POSE, BASE_TWIST = range(2)  # blocks gathered from an Odometry

_POSE_WITHOUT_COVARIANCE = (0, 2)  # where these are among the blocks of the layout


class RunCollector:
    """What the messages of one run hold, by topic name without the namespace."""

    def __init__(self, info: BagInfo, prefix: str) -> None:
        """Make a collector for each topic of a run; ``prefix`` is the namespace, '' for the root."""
        self._info = info
        self._prefix = prefix
        self._types = MessageTypes(roots=())
        self.arms = tuple(self._found_arms())
        self._check_types()
        self.joints = {
            name: BlockCollector(joint_state_layout, (POSITION, VELOCITY, EFFORT)) for name in JOINT_TOPICS
        }
        self.odometry = BlockCollector(odometry_layout, _POSE_WITHOUT_COVARIANCE)
        self.rows = {
            topics.DEPUTY_POSE: RowCollector(7, pose_values),
            topics.LINEAR_MOMENTUM: RowCollector(3, vector_values),
            topics.ANGULAR_MOMENTUM: RowCollector(3, vector_values),
            topics.ENERGY: RowCollector(2, energy_values),
            topics.IK_STATUS: RowCollector(1, status_values),
            **{topics.target_pose(arm): RowCollector(7, pose_values) for arm in self.arms},
            **{topics.tool_pose(arm): RowCollector(7, pose_values) for arm in self.arms},
        }
        self.phases: list[TaskPhase] = []
        self.events: list[GraspEvent] = []
        self.run_events: list[RunEvent] = []
        self._first_ns: int | None = None
        self._newest_ns = 0

    def collect(self) -> None:
        """Go through the messages of the bag once."""
        takers: dict[str, Callable[[bytes], None]] = {
            topics.JOINT_STATES: self._take_state,
            topics.BASE_ODOMETRY: self.odometry.add,
            topics.TASK_PHASE: self._decoded(topics.TASK_PHASE, lambda m: self.phases.append(task_phase(m))),
            topics.GRASP_EVENT: self._decoded(
                topics.GRASP_EVENT, lambda m: self.events.append(grasp_event(m))
            ),
            topics.RUN_EVENTS: self._decoded(
                topics.RUN_EVENTS, lambda m: self.run_events.append(run_event(m))
            ),
        }
        takers.update(
            (name, self.joints[name].add) for name in (topics.JOINT_COMMAND, topics.JOINT_REFERENCE)
        )
        takers.update((name, self._decoded(name, rows.add)) for name, rows in self.rows.items())
        by_name = {self.full_name(name): taker for name, taker in takers.items()}
        for message in read_messages(self._info.path, by_name):
            by_name[message.topic](message.data)

    def _take_state(self, data: bytes) -> None:
        """Take a joint state; one that starts anew, after a reset, makes the events so far void."""
        time_ns = stamp_ns(data)
        if self._first_ns is None:
            self._first_ns = time_ns
        elif time_ns < self._newest_ns and time_ns <= self._first_ns:
            self.events.clear()
            self.run_events.clear()
        self._newest_ns = time_ns
        self.joints[topics.JOINT_STATES].add(data)

    def full_name(self, name: str) -> str:
        """Return the name that a topic of the run has in the bag."""
        return f"{self._prefix}/{name}"

    def _decoded(self, name: str, take: Callable[..., None]) -> Callable[[bytes], None]:
        """Return what decodes a message of a topic, by the schema in the bag, and hands it to ``take``."""
        topic = self._info.topics.get(self.full_name(name))
        type_name = "" if topic is None else topic.type
        if topic is not None:
            self._types.learn(type_name, topic.schema_text)

        def decode(data: bytes) -> None:
            try:
                take(self._types.deserialize(data, type_name))
            except (AttributeError, KeyError) as error:
                raise BagError(
                    f"{self._info.path}: {name} is not as this version knows it: {error}"
                ) from error

        return decode

    def _check_types(self) -> None:
        """Raise BagError if a topic of a run has another type in the bag."""
        for topic in topics.graph_topics(self.arms):
            recorded = self._info.topics.get(self.full_name(topic.name))
            if recorded is not None and (recorded.type, recorded.encoding) != (topic.type, "cdr"):
                raise BagError(
                    f"{self._info.path} holds no run of sms_handover: {recorded.name} has the type"
                    f" {recorded.type} ({recorded.encoding}), expected is {topic.type} (cdr)"
                )

    def _found_arms(self) -> Iterator[str]:
        """Yield the names of the arms whose tool pose is in the bag."""
        head, tail = f"{self._prefix}/", topics.tool_pose("")
        for name in self._info.topics:
            if name.startswith(head) and name.endswith(tail):
                yield name[len(head) : -len(tail)]
