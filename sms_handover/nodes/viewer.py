"""Viewer node: shows a graph in a browser."""

import webbrowser
from collections.abc import Sequence
from functools import partial
from typing import Any, TypeVar

import numpy as np
from rclpy.executors import Executor
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy

from sms_handover.errors import SmsHandoverError
from sms_handover.frames import BASE, WORLD
from sms_handover.graph.topics import (
    DEPUTY_MARKER,
    DEPUTY_POSE,
    GRASP_EVENT,
    PLANNED_PATHS,
    ROBOT_DESCRIPTION,
    SAMPLED_BASE_ODOMETRY,
    SAMPLED_JOINT_STATES,
    TASK_PHASE,
    VIEWER,
    graph_topics,
    target_pose,
)
from sms_handover.model.poses import pose_row
from sms_handover.plan_report import PlannedPaths
from sms_handover.ros.codecs.events import read_grasp_event
from sms_handover.ros.codecs.loop_messages import PoseCodec, Stamped, StateCodec, stamped, state_of
from sms_handover.ros.codecs.planned_paths import read_planned_paths
from sms_handover.ros.codecs.task_phase import PhaseCodec
from sms_handover.ros.message_types import message_class
from sms_handover.ros.node.message_filter import Decode, MessageFilter, OnMessage
from sms_handover.ros.parameters import declare, reject_unknown
from sms_handover.ros.process.main import EXIT_OK, RunnableNode, Stop, run_node
from sms_handover.ros.qos import LATCHED
from sms_handover.ros.transport.stamp_sync import StampSync
from sms_handover.scene.live import LiveFrame, LiveScene
from sms_handover.scene.parameters import ViewerParameters
from sms_handover.scene.server import SceneServer
from sms_handover.simulation.parameters import CommonParameters
from sms_handover.types import GraspEvent, TaskPhase

T = TypeVar("T")

_POLL_S = 0.2  # [s] of wall time between two polls whether to stop
_LOSSY = QoSProfile(  # a slow viewer loses messages; it never holds the graph up
    depth=5,
    reliability=QoSReliabilityPolicy.BEST_EFFORT,
    durability=QoSDurabilityPolicy.VOLATILE,
)


class ViewerNode(RunnableNode):
    """Shows a graph that runs or is played back in a browser; nothing in the graph waits for it.

    It subscribes to robot_description, deputy/marker, the sampled states, deputy/pose, the target poses,
    task/phase, task/grasp_event and mpc/planned_paths, best effort where they are many.
    """

    def __init__(self) -> None:
        """Serve the page; raises ConfigurationError on a bad parameter or a port that is taken."""
        super().__init__(VIEWER, automatically_declare_parameters_from_overrides=True)
        self.parameters: ViewerParameters = declare(self, ViewerParameters, "viewer.yaml", VIEWER)
        reject_unknown(self, CommonParameters, ViewerParameters)  # a file may set those of every node
        self._urdf = ""
        self._deputy_size: tuple[float, ...] = ()
        self._scene: LiveScene | None = None
        self._inputs: StampSync[Any] = StampSync()
        self.message_filter = MessageFilter(self.get_logger().warning, lambda topic, error: None)
        self._pose_codec = PoseCodec(WORLD)
        self._state_codec: StateCodec | None = None  # known with the robot
        self._shown_ns = -1  # stamp of what is shown
        self._wanted: tuple[str, ...] = (SAMPLED_JOINT_STATES, SAMPLED_BASE_ODOMETRY, DEPUTY_POSE)
        for name, on_message in ((ROBOT_DESCRIPTION, self._on_robot), (DEPUTY_MARKER, self._on_deputy)):
            self.create_subscription(self._kind(name), name, on_message, LATCHED)
        self._subscribe(GRASP_EVENT, self._on_event, read_grasp_event, LATCHED)
        self._subscribe(TASK_PHASE, self._on_phase, PhaseCodec().read, _LOSSY)
        self._subscribe(PLANNED_PATHS, self._on_paths, read_planned_paths, _LOSSY)
        for name in self._wanted:
            self._subscribe(name, partial(self._add, name), stamped, _LOSSY)
        self.server = SceneServer(self.find_scene, self.parameters.port, "Handover, live")

    def run(self, executor: Executor, stop: Stop) -> int:
        """Serve until asked to stop."""
        print(f"the handover is shown at {self.server.address}", flush=True)
        if self.parameters.browser:
            webbrowser.open(self.server.address)
        try:
            while not stop.asked:
                executor.spin_once(timeout_sec=_POLL_S)
        finally:
            self.server.close()
        return EXIT_OK

    def find_scene(self) -> LiveScene | str:
        """Return the scene, or a text with what it waits for."""
        if self._scene is not None:
            return self._scene
        missing = [ROBOT_DESCRIPTION] if not self._urdf else []
        missing += [DEPUTY_MARKER] if not self._deputy_size else []
        return f"Waiting for {' and '.join(self.resolve_topic_name(name) for name in missing)}"

    def _subscribe(self, name: str, on_message: OnMessage[T], decode: Decode[T], profile: QoSProfile) -> None:
        """Hand on the content of the good messages of a topic; the others are counted and reported."""
        on_data = self.message_filter.wrap(name, on_message, decode)

        def callback(data: Any) -> None:
            on_data(data, 0, b"")

        self.create_subscription(self._kind(name), name, callback, profile, raw=True)

    def _kind(self, name: str) -> Any:
        return message_class(next(topic.type for topic in graph_topics(self._arms) if topic.name == name))

    @property
    def _arms(self) -> tuple[str, ...]:
        return self._scene.arms if self._scene else ()

    def _on_robot(self, message: Any) -> None:
        self._urdf = message.data
        self._describe()

    def _on_deputy(self, message: Any) -> None:
        self._deputy_size = (message.scale.x, message.scale.y, message.scale.z)
        self._describe()

    def _describe(self) -> None:
        """Begin to show robot and deputy once both are known, and subscribe to the targets of the arms."""
        if self._scene is not None or not self._urdf or not self._deputy_size:
            return
        try:
            self._scene = LiveScene(self._urdf, np.array(self._deputy_size), self.parameters.frame_rate)
        except SmsHandoverError as error:
            self.get_logger().error(f"the robot cannot be shown: {error}")
            return
        self._state_codec = StateCodec(self._scene.joint_names, WORLD, BASE)
        targets = tuple(target_pose(arm) for arm in self._arms)
        self._wanted += targets
        for name in targets:
            self._subscribe(name, partial(self._add, name), stamped, _LOSSY)

    def _on_phase(self, phase: TaskPhase, sent_ns: int) -> None:
        if self._scene:
            self._scene.set_phase(phase)

    def _on_event(self, event: GraspEvent, sent_ns: int) -> None:
        if self._scene:
            self._scene.add_event(event)

    def _on_paths(self, paths: PlannedPaths, sent_ns: int) -> None:
        if self._scene:
            self._scene.add_paths(paths)

    def _add(self, name: str, message: Stamped[bytes], sent_ns: int) -> None:
        """Keep the content of a good message until all of its stamp are there, then show them."""
        scene, codec = self._scene, self._state_codec
        if scene is None or codec is None:
            return
        reads: dict[str, Decode[Stamped[Any]]] = {
            SAMPLED_JOINT_STATES: codec.joints.checked,
            SAMPLED_BASE_ODOMETRY: codec.odometry.checked,
        }
        stamp_ns, content = reads.get(name, self._pose_codec.checked)(message[1])
        if stamp_ns < self._shown_ns:  # another run, or a playback that goes back
            self._inputs.reset()
            self._shown_ns = stamp_ns
        self._inputs.add(stamp_ns, name, content)
        inputs = self._inputs.take(stamp_ns, self._wanted)
        if inputs is None:
            return
        self._shown_ns = stamp_ns
        state = state_of(stamp_ns, inputs[SAMPLED_JOINT_STATES], inputs[SAMPLED_BASE_ODOMETRY])
        scene.add(
            LiveFrame(
                stamp_ns=stamp_ns,
                joint_names=scene.joint_names,
                joint_position=state.joint_position,
                base_in_world=pose_row(state.base_in_world),
                deputy_in_world=pose_row(inputs[DEPUTY_POSE]),
                target_in_world={arm: pose_row(inputs[target_pose(arm)]) for arm in scene.arms},
            )
        )


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(ViewerNode, args, name=VIEWER)


if __name__ == "__main__":
    raise SystemExit(main())
