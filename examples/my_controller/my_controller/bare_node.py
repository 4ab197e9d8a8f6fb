"""The same law as a bare node, without sms_handover: rclpy, standard messages and Pinocchio.

A node that replaces the controller answers every state, a JointState and an Odometry of equal stamp, with one
JointState with efforts and that stamp. docs/own_controller.md has the rules.
"""

from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin
import rclpy
from geometry_msgs.msg import Point, PoseStamped, Quaternion, Vector3
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

Array = npt.NDArray[np.float64]

ARMS = ("arm_a", "arm_b")
REFERENCE_NS = 20_000_000  # [ns] every 20 ms there are new targets
SPIN_TIMEOUT_S = 0.5  # [s] of wall time after which a signal is noticed at the latest
LAW = {
    "law": "task_space_pd_bare",  # the name of the law in reports
    "stiffness": 5.0,  # N/m
    "damping": 7.0,  # N s/m
    "angular_stiffness": 0.5,  # N m/rad
    "angular_damping": 0.4,  # N m s/rad
    "joint_damping": 0.1,  # N m s/rad
}
STATE = ("joint_states", "base_odometry")
TARGETS = tuple(f"{arm}/target_pose" for arm in ARMS)

LOSSLESS = QoSProfile(depth=1000)  # reliable; deep enough for slow subscribers, such as the recorder
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class BareController(Node):
    """Answers every state with the efforts of springs and dampers between the tools and their targets."""

    def __init__(self) -> None:
        super().__init__("controller")
        for name, value in LAW.items():
            self.declare_parameter(name, value)
        self._model: pin.Model | None = None
        self._waiting: dict[int, dict[str, Any]] = {}  # messages by stamp and topic
        self._answered_ns = -1
        self._answer = JointState()
        self._targets: dict[str, pin.SE3] = {}
        self.create_subscription(String, "robot_description", self._on_description, LATCHED)
        kinds = {STATE[0]: JointState, STATE[1]: Odometry, **dict.fromkeys(TARGETS, PoseStamped)}
        self._inputs = [
            self.create_subscription(kind, topic, partial(self._on_input, topic), LOSSLESS)
            for topic, kind in kinds.items()
        ]
        self._ready = self.create_publisher(String, "run/ready", LATCHED)
        self._matching = self.create_timer(0.05, self._announce)  # s of wall time
        self._command = self.create_publisher(
            JointState, "joint_command", LOSSLESS
        )  # last: the run waits for it

    def _announce(self) -> None:
        """Announce that this node is ready once its endpoints have matched."""
        found = all(subscription.get_publisher_count() for subscription in self._inputs)
        if found and self._command.get_subscription_count():
            self._matching.cancel()
            self._ready.publish(String(data=self.get_name()))

    def _on_description(self, message: String) -> None:
        """Build the model, and answer the states that waited for it."""
        self._model = pin.buildModelFromXML(message.data, pin.JointModelFreeFlyer())
        self._data = self._model.createData()
        for stamp in sorted(self._waiting):
            self._answer_if_complete(stamp)

    def _on_input(self, topic: str, message: Any) -> None:
        """Keep a message until all messages with its stamp have arrived."""
        stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        if stamp == self._answered_ns and topic == STATE[1]:
            self._command.publish(self._answer)  # the plant asks again: the answer was lost
        elif stamp > self._answered_ns:
            self._waiting.setdefault(stamp, {})[topic] = message
            self._answer_if_complete(stamp)

    def _answer_if_complete(self, stamp: int) -> None:
        """Answer a state; at a reference period it waits for the targets."""
        needed = (*STATE, *TARGETS) if stamp % REFERENCE_NS == 0 else STATE
        inputs = self._waiting.get(stamp, {})
        if self._model is None or not inputs.keys() >= set(needed):
            return
        del self._waiting[stamp]
        for arm, topic in zip(ARMS, TARGETS, strict=True):
            if topic in inputs:
                pose = inputs[topic].pose
                self._targets[arm] = pin.XYZQUATToSE3(_numbers(pose.position, pose.orientation))
        q, v = self._state(inputs["joint_states"], inputs["base_odometry"])
        names = list(self._model.names[2:])
        self._answer = JointState(name=names, effort=self._effort(self._model, q, v).tolist())
        self._answer.header.stamp = inputs["joint_states"].header.stamp
        self._command.publish(self._answer)
        self._answered_ns = stamp

    def _state(self, joints: JointState, odometry: Odometry) -> tuple[Array, Array]:
        """Return configuration and velocity: the base, its twist in its own axes, then the joints by name."""
        assert self._model is not None
        place = [joints.name.index(name) for name in self._model.names[2:]]
        pose, twist = odometry.pose.pose, odometry.twist.twist
        q = np.concatenate([_numbers(pose.position, pose.orientation), np.array(joints.position)[place]])
        v = np.concatenate([_numbers(twist.linear, twist.angular), np.array(joints.velocity)[place]])
        return q, v

    def _effort(self, model: pin.Model, q: Array, v: Array) -> Array:
        """Return u = J*^T f - d q_m', with J* = J_m - J_b H_b^-1 H_bm the generalised Jacobian of a tool."""
        gain = {name: self.get_parameter(name).value for name in LAW}
        stiffness = np.repeat([gain["stiffness"], gain["angular_stiffness"]], 3)
        damping = np.repeat([gain["damping"], gain["angular_damping"]], 3)
        inertia = pin.crba(model, self._data, q, pin.Convention.WORLD)
        base_per_joint = -np.linalg.solve(inertia[:6, :6], inertia[:6, 6:])
        pin.computeJointJacobians(model, self._data, q)
        rates = v[6:]
        effort = -gain["joint_damping"] * rates
        for arm, target in self._targets.items():
            frame = model.getFrameId(f"{arm}_tool")
            tool = pin.updateFramePlacement(model, self._data, frame)
            both = pin.getFrameJacobian(model, self._data, frame, pin.LOCAL_WORLD_ALIGNED)
            jacobian = both[:, 6:] + both[:, :6] @ base_per_joint
            turn = pin.log3(tool.rotation @ target.rotation.T)
            error = np.concatenate([tool.translation - target.translation, turn])
            effort += jacobian.T @ -(stiffness * error + damping * (jacobian @ rates))
        limited: Array = np.clip(effort, -model.effortLimit[6:], model.effortLimit[6:])
        return limited


def _numbers(*parts: Point | Quaternion | Vector3) -> Array:
    """Return the components of points, vectors and quaternions in a row, x y z (w) each."""
    return np.array([getattr(part, axis) for part in parts for axis in "xyzw" if hasattr(part, axis)])


def main(args: list[str] | None = None) -> None:
    """Run the node until a signal ends it.

    ``rclpy.spin`` waits without a timeout: rclpy wakes it before it shuts the context down, and a node that
    checks in between continues to wait. Here it checks again after SPIN_TIMEOUT_S.
    """
    rclpy.init(args=args)
    node = BareController()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while rclpy.ok():
            executor.spin_once(timeout_sec=SPIN_TIMEOUT_S)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
