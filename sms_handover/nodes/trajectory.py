"""Trajectory node: phases, joint references and tool targets from the schedule."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import Pose as PoseMessage
from sms_handover_interfaces.srv import SolveIK

from sms_handover.errors import GraphError
from sms_handover.frames import BASE, WORLD, target_frame
from sms_handover.graph.topics import (
    CLEARANCE,
    GRASP_EVENT,
    IK_STATUS,
    JOINT_REFERENCE,
    SOLVE_IK,
    TASK_PHASE,
    TF,
    TRAJECTORY,
    sampled_topics,
    target_pose,
)
from sms_handover.messages.message_types import MessageTypes
from sms_handover.messages.transforms import TransformsCodec
from sms_handover.messages.values import time_ns
from sms_handover.model.poses import pose_row
from sms_handover.ros.codecs.convert import joints_in_order, set_joint_positions, set_pose
from sms_handover.ros.codecs.events import read_collisions, read_grasp_event
from sms_handover.ros.codecs.loop_messages import (
    JointStateCodec,
    PoseCodec,
    Stamped,
    StateCodec,
    stamped,
    state_of,
)
from sms_handover.ros.codecs.task_phase import PhaseCodec
from sms_handover.ros.node.diagnostics import NodeReport
from sms_handover.ros.node.endpoints import CountedPublisher
from sms_handover.ros.node.graph_node import GraphNode
from sms_handover.ros.process.main import run_node
from sms_handover.ros.transport.stamp_sync import StampSync
from sms_handover.simulation.parameters import LOCKSTEP
from sms_handover.simulation.wiring import make_generator
from sms_handover.trajectory.generator import Targets
from sms_handover.trajectory.parameters import TrajectoryParameters
from sms_handover.types import Array, RobotState, TaskPhase
from sms_handover.units import NS_PER_S


class TrajectoryNode(GraphNode[TrajectoryParameters]):
    """Each reference period: targets from the schedule, joints from ``solve_ik``, and the reference.

    While a request is under way a later state waits; in lock step none comes.
    """

    def __init__(self) -> None:
        super().__init__(TRAJECTORY, TrajectoryParameters)

    def prepare(self) -> None:
        """Set up the generator; that its targets are in reach, the IK node checks."""
        self._generator = make_generator(self.robot, self.schedule, self.common, self.parameters)
        self._reference_codec = JointStateCodec(self.robot.joint_names, ("position", "velocity"))
        self._pose_codec, self._phase_codec = PoseCodec(WORLD), PhaseCodec()
        self._lockstep = self.common.mode == LOCKSTEP
        ahead_ns = self.common.reference_ns if self._lockstep else NS_PER_S
        self._inputs: StampSync[Any] = StampSync(ahead_ns=ahead_ns, paced=not self._lockstep)
        self._stamp_ns = self._newest_ns = self._requested_ns = 0
        self._outputs: list[tuple[CountedPublisher, bytes]] = []
        self._failures = self._overdue = 0
        self._solver = self.inputs.loop.create_client(SolveIK, SOLVE_IK, self._on_response)
        self._names = list(self.robot.joint_names)
        self._request = SolveIK.Request()  # refilled each time: most of it never changes
        self._request.seed.name = self._names
        self._requested: tuple[RobotState, TaskPhase, Targets] | None = None
        self._phase = self.endpoints.publisher(TASK_PHASE)
        self._ik_status = self.endpoints.publisher(IK_STATUS)
        self._reference = self.endpoints.publisher(JOINT_REFERENCE)
        self._targets = {arm: self.endpoints.publisher(target_pose(arm)) for arm in self.robot.arms}
        frames = [(WORLD, target_frame(arm)) for arm in self.robot.arms]
        self._transforms, self._frames = self.endpoints.publisher(TF), TransformsCodec(MessageTypes(), frames)
        self.inputs.subscribe(GRASP_EVENT, self._on_grasp, stamped)
        self._unmeasured_ns: int | None = None  # the stamp of the clearance that decides on the next period
        if self.common.measures_clearance:
            self.inputs.subscribe(CLEARANCE, self._on_clearance, stamped)
        state = StateCodec(self.robot.joint_names, WORLD, BASE)
        checks = (state.joints.checked, state.odometry.checked, self._pose_codec.checked)
        self._needed = sampled_topics(measured=self.common.uses_measurements)
        self._joints, self._odometry, self._deputy = self._needed
        for topic, checked in zip(self._needed, checks, strict=True):
            self.inputs.subscribe(topic, partial(self._on_input, topic), checked)

    def is_ready(self) -> bool:
        """Whether the IK service is there."""
        return self._solver.service_is_ready()

    def reset_run(self) -> None:
        """Forget the run: phases, what waits of it, and the request that is under way."""
        self._generator.reset()
        self._inputs.reset_run()
        self._stamp_ns = self._newest_ns = self._failures = 0
        self._overdue += self._requested is not None
        self._outputs = []
        self._requested = self._unmeasured_ns = None

    def report(self) -> NodeReport:
        """Return how many references were given and how many IK requests did not converge."""
        values = {"references": self._reference.count, "ik_not_converged": self._failures}
        return NodeReport(self._stamp_ns, values)

    @property
    def awaited(self) -> str:
        """The response of the service while there is a request, else what comes last of a state."""
        if self._requested is not None:
            return SOLVE_IK
        if self._waits_for_grasps:
            return GRASP_EVENT
        if self._waits_for_clearance:
            return CLEARANCE
        stamp = self._inputs.oldest_ns
        return (self._inputs.missing(stamp, self._needed) if stamp is not None else "") or self._deputy

    def _on_input(self, topic: str, message: Stamped[Any], sent_ns: int) -> None:
        """Take one input; time zero after a later time restarts the run."""
        stamp, content = message
        if self._inputs.restarts_run(stamp):
            self._inputs.reset()
            self._generator.reset()
            self._unmeasured_ns = None
        if topic == self._deputy and self._requested is not None:
            self._repeat_request(stamp)
        elif topic == self._deputy and stamp == self._stamp_ns:
            self._publish_again()
        self._inputs.add(stamp, topic, content)
        self._newest_ns = stamp
        if self._requested is None:
            self._proceed(stamp)

    @property
    def _waits_for_grasps(self) -> bool:
        """Whether the task waits for the result of a grasp (lock step)."""
        return self._lockstep and self._generator.awaits_grasps

    def _on_grasp(self, message: Stamped[bytes], sent_ns: int) -> None:
        """Take the result of a grasp; the next state may have come before it."""
        event = read_grasp_event(message[1])
        if self._lockstep and (not self._outputs or event.stamp_ns > self._stamp_ns):
            return  # it is of the run before: the plant decides once it has the phase
        self._generator.grasped((event,))
        if self._requested is None:
            self._proceed(self._newest_ns)

    @property
    def _waits_for_clearance(self) -> bool:
        """Whether the task waits for the clearance of the period before (lock step)."""
        return self._lockstep and self._unmeasured_ns is not None

    def _on_clearance(self, message: Stamped[bytes], sent_ns: int) -> None:
        """Take the clearance of a period; the next state may have come before it."""
        stamp, content = message
        if self._lockstep and stamp != self._unmeasured_ns:
            return  # it is of the run before
        self._unmeasured_ns = None
        self._generator.collided(read_collisions(content))
        if self._requested is None:
            self._proceed(self._newest_ns)

    def _proceed(self, stamp: int) -> None:
        """Work on the state of a stamp if all of it is there."""
        if self._waits_for_grasps or self._waits_for_clearance:
            return
        inputs = self._inputs.take(stamp, self._needed)
        if inputs is None:
            return
        self._stamp_ns = stamp
        state = state_of(stamp, inputs[self._joints], inputs[self._odometry])
        phase, targets = self._generator.targets(state, inputs[self._deputy])
        for event in self._generator.take_decisions():
            self.events.publish(event)
        if targets.tool_in_world:
            self._call_solver(state, phase, targets)
        else:
            self._publish(state, phase, targets, targets.joint_position)

    def _call_solver(self, state: RobotState, phase: TaskPhase, targets: Targets) -> None:
        """Call the IK service; its response is published."""
        wanted = self._generator.ik_request(state, targets)
        request, poses = self._request, wanted.tool_in_world.values()
        set_pose(request.base_in_world, wanted.base_in_world)
        set_joint_positions(request.seed, wanted.seed, state.stamp_ns)
        if len(request.tool_in_world) != len(poses):
            request.tool_in_world = [PoseMessage() for _ in poses]
        request.arms = list(wanted.tool_in_world)
        for message, pose in zip(request.tool_in_world, poses, strict=True):
            set_pose(message, pose)
        self._requested, self._requested_ns = (state, phase, targets), state.stamp_ns
        self._solver.call(request)

    def _repeat_request(self, stamp: int) -> None:
        """Repeat a request without a response when the plant resends its state or, in real time, after 1 s.

        rmw_fastrtps loses a response to a client that the server has not found within 100 ms.
        """
        if stamp == self._stamp_ns or stamp - self._requested_ns > NS_PER_S:
            self._requested_ns = stamp
            self._overdue += 1
            self._solver.call(self._request)

    def _on_response(self, response: Any) -> None:
        """Publish the reference that follows from a solution, converged or not."""
        awaited_ns = None if self._requested is None else self._requested[0].stamp_ns
        if self._overdue and time_ns(response.solution.header.stamp) != awaited_ns:
            self._overdue -= 1  # it is of the run before, or to a request that was repeated
            return
        if self._requested is None:
            return
        requested, self._requested = self._requested, None
        if not response.valid:
            raise GraphError(f"the IK service rejected a request: {response.message}")
        converged = response.status.status == response.status.CONVERGED
        self._generator.solved(converged=converged)
        self._failures += not converged
        solution = response.solution
        joints = joints_in_order(self._names, solution.name, solution.position)
        self._publish(*requested, joints)
        self._ik_status.publish(response.status)
        self._proceed(self._newest_ns)

    def _publish(self, state: RobotState, phase: TaskPhase, targets: Targets, joints: Array) -> None:
        """Publish phase, reference and targets of one period; what the loop waits for goes first."""
        reference, targets_in_world = self._generator.reference(state, targets, joints)
        position, velocity = reference.position, reference.velocity
        packed = self._reference_codec.pack(state.stamp_ns, position=position, velocity=velocity)
        self._outputs = [(self._phase, self._phase_codec.pack(phase)), (self._reference, packed)]
        rows = {arm: pose_row(pose) for arm, pose in targets_in_world.items()}
        for arm, row in rows.items():
            self._outputs.append((self._targets[arm], self._pose_codec.pack(state.stamp_ns, row)))
        frames = self._frames.pack(state.stamp_ns, np.array([rows[arm] for arm in self.robot.arms]))
        self._outputs.append((self._transforms, frames))
        if self.common.measures_clearance:
            self._unmeasured_ns = state.stamp_ns
        self._publish_again()

    def _publish_again(self) -> None:
        """Publish what belongs to a period, for the first time or because the plant has resent its state."""
        for publisher, data in self._outputs:
            publisher.publish(data)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(TrajectoryNode, args, name=TRAJECTORY)


if __name__ == "__main__":
    raise SystemExit(main())
