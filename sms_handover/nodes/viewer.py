"""The viewer node."""

import webbrowser
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from rclpy.executors import Executor
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy

from sms_handover.bag.decode import grasp_event, pose_values, task_phase
from sms_handover.errors import SmsHandoverError
from sms_handover.ros.convert import stamp_ns_of
from sms_handover.ros.main import EXIT_OK, RunnableNode, Stop, run_node
from sms_handover.ros.message_types import message_class
from sms_handover.ros.parameters import declare, refuse_unknown
from sms_handover.ros.qos import LATCHED
from sms_handover.ros.stamp_sync import StampSync
from sms_handover.scene.live import LiveFrame, LiveScene
from sms_handover.scene.parameters import ViewerParameters
from sms_handover.scene.server import SceneServer
from sms_handover.simulation.parameters import CommonParameters
from sms_handover.topics import (
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
        refuse_unknown(self, CommonParameters, ViewerParameters)  # a file may set those of every node
        self._urdf = ""
        self._deputy_size: tuple[float, ...] = ()
        self._scene: LiveScene | None = None
        self._inputs: StampSync[Any] = StampSync()
        self._wanted: tuple[str, ...] = (SAMPLED_JOINT_STATES, SAMPLED_BASE_ODOMETRY, DEPUTY_POSE)
        self._listen(ROBOT_DESCRIPTION, self._on_robot, LATCHED)
        self._listen(DEPUTY_MARKER, self._on_deputy, LATCHED)
        self._listen(GRASP_EVENT, self._on_event, LATCHED)
        self._listen(TASK_PHASE, self._on_phase, _GLANCE)
        for name in self._wanted:
            self._listen(name, partial(self._take, name), _GLANCE)
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
        """Subscribe to a topic of the graph."""
        kind = next(topic.type for topic in graph_topics(self._arms) if topic.name == name)
        self.create_subscription(message_class(kind), name, take, profile)

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
        targets = tuple(target_pose(arm) for arm in self._arms)
        self._wanted += targets
        for name in targets:
            self._listen(name, partial(self._take, name), _GLANCE)

    def _on_phase(self, message: Any) -> None:
        """Show the phase."""
        if self._scene:
            self._scene.enter(task_phase(message))

    def _on_event(self, message: Any) -> None:
        """Show what came of a grasp."""
        if self._scene:
            self._scene.tell(grasp_event(message))

    def _take(self, name: str, message: Any) -> None:
        """Keep a message until all of its stamp are there, then show them."""
        stamp_ns = stamp_ns_of(message.header.stamp)
        if self._inputs.begins_anew(stamp_ns):
            self._inputs.reset()
        self._inputs.add(stamp_ns, name, message)
        inputs = self._inputs.take(stamp_ns, self._wanted) if self._scene else None
        if inputs is None or self._scene is None:
            return
        joints = inputs[SAMPLED_JOINT_STATES]
        self._scene.add(
            LiveFrame(
                stamp_ns=stamp_ns,
                joint_names=tuple(joints.name),
                joint_position=np.array(joints.position),
                base_in_world=np.array(pose_values(inputs[SAMPLED_BASE_ODOMETRY].pose)),
                deputy_in_world=np.array(pose_values(inputs[DEPUTY_POSE])),
                target_in_world={arm: np.array(pose_values(inputs[target_pose(arm)])) for arm in self._arms},
            )
        )


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(ViewerNode, args, name=VIEWER)


if __name__ == "__main__":
    raise SystemExit(main())
