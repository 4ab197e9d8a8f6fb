"""The viewer node."""

import webbrowser
from collections.abc import Callable, Sequence
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
    ROBOT_DESCRIPTION,
    SAMPLED_BASE_ODOMETRY,
    SAMPLED_JOINT_STATES,
    TASK_PHASE,
    VIEWER,
    graph_topics,
    target_pose,
)
from sms_handover.model.poses import pose_row
from sms_handover.ros.codecs.events import read_grasp_event
from sms_handover.ros.codecs.loop_messages import PoseCodec, Stamped, StateCodec, stamped, state_of
from sms_handover.ros.codecs.task_phase import PhaseCodec
from sms_handover.ros.message_types import message_class
from sms_handover.ros.node.message_filter import MessageFilter, Read, Receive
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

_LOOK_S = 0.2  # [s] of wall time between two looks whether to stop
_GLANCE = QoSProfile(  # a slow viewer loses messages; it never holds the graph up
    depth=5,
    reliability=QoSReliabilityPolicy.BEST_EFFORT,
    durability=QoSDurabilityPolicy.VOLATILE,
)


class ViewerNode(RunnableNode):
    """Shows a graph that runs or is played back in a browser; nothing in the graph waits for it.

    It listens to robot_description, deputy/marker, the sampled states, deputy/pose, the target poses,
    task/phase and task/grasp_event, best effort where they are many.
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
        self.refusals = MessageFilter(self.get_logger().warning, lambda topic, error: None)
        self._pose_wire = PoseCodec(WORLD)
        self._state_wire: StateCodec | None = None  # known with the robot
        self._shown_ns = -1  # stamp of what is shown
        self._wanted: tuple[str, ...] = (SAMPLED_JOINT_STATES, SAMPLED_BASE_ODOMETRY, DEPUTY_POSE)
        self._listen(ROBOT_DESCRIPTION, self._on_robot, LATCHED)
        self._listen(DEPUTY_MARKER, self._on_deputy, LATCHED)
        self._take(GRASP_EVENT, self._on_event, read_grasp_event, LATCHED)
        self._take(TASK_PHASE, self._on_phase, PhaseCodec().read, _GLANCE)
        for name in self._wanted:
            self._take(name, partial(self._add, name), stamped, _GLANCE)
        self.server = SceneServer(self.find_scene, self.parameters.port, "Handover, live")

    def run(self, executor: Executor, stop: Stop) -> int:
        """Serve until asked to stop."""
        print(f"the handover is shown at {self.server.address}", flush=True)
        if self.parameters.browser:
            webbrowser.open(self.server.address)
        try:
            while not stop.asked:
                executor.spin_once(timeout_sec=_LOOK_S)
        finally:
            self.server.close()
        return EXIT_OK

    def find_scene(self) -> LiveScene | str:
        """Return the scene, or in words what is still waited for."""
        if self._scene is not None:
            return self._scene
        missing = [ROBOT_DESCRIPTION] if not self._urdf else []
        missing += [DEPUTY_MARKER] if not self._deputy_size else []
        return f"Waiting for {' and '.join(self.resolve_topic_name(name) for name in missing)}"

    def _listen(self, name: str, take: Callable[[Any], None], profile: QoSProfile) -> None:
        """Take the messages of a topic of the graph as they come."""
        self.create_subscription(self._kind(name), name, take, profile)

    def _take(self, name: str, take: Receive[T], read: Read[T], profile: QoSProfile) -> None:
        """Take what is in the good messages of a topic of the graph; the others are counted and told."""
        deliver = self.refusals.guarding(name, take, read)

        def callback(data: Any) -> None:
            deliver(data, 0, b"")

        self.create_subscription(self._kind(name), name, callback, profile, raw=True)

    def _kind(self, name: str) -> Any:
        """Return the class of the messages of a topic of the graph."""
        return message_class(next(topic.type for topic in graph_topics(self._arms) if topic.name == name))

    @property
    def _arms(self) -> tuple[str, ...]:
        """Return the arms of the robot that is shown."""
        return self._scene.arms if self._scene else ()

    def _on_robot(self, message: Any) -> None:
        """Take the description of the robot."""
        self._urdf = message.data
        self._describe()

    def _on_deputy(self, message: Any) -> None:
        """Take the size of the deputy."""
        self._deputy_size = (message.scale.x, message.scale.y, message.scale.z)
        self._describe()

    def _describe(self) -> None:
        """Begin to show robot and deputy once both are known, and listen for the targets of the arms."""
        if self._scene is not None or not self._urdf or not self._deputy_size:
            return
        try:
            self._scene = LiveScene(self._urdf, np.array(self._deputy_size), self.parameters.frame_rate)
        except SmsHandoverError as error:
            self.get_logger().error(f"the robot cannot be shown: {error}")
            return
        self._state_wire = StateCodec(self._scene.joint_names, WORLD, BASE)
        targets = tuple(target_pose(arm) for arm in self._arms)
        self._wanted += targets
        for name in targets:
            self._take(name, partial(self._add, name), stamped, _GLANCE)

    def _on_phase(self, phase: TaskPhase, sent_ns: int) -> None:
        """Show the phase."""
        if self._scene:
            self._scene.set_phase(phase)

    def _on_event(self, event: GraspEvent, sent_ns: int) -> None:
        """Show what came of a grasp."""
        if self._scene:
            self._scene.add_event(event)

    def _add(self, name: str, message: Stamped[bytes], sent_ns: int) -> None:
        """Keep what is in a good message until all of its stamp are there, then show them."""
        scene, wire = self._scene, self._state_wire
        if scene is None or wire is None:
            return
        reads: dict[str, Read[Stamped[Any]]] = {
            SAMPLED_JOINT_STATES: wire.joints.checked,
            SAMPLED_BASE_ODOMETRY: wire.odometry.checked,
        }
        stamp_ns, content = reads.get(name, self._pose_wire.checked)(message[1])
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
