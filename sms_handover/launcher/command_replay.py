"""Command replay: answers the plant with recorded commands, in place of controller and trajectory."""

import struct
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from rclpy.node import Node
from sms_handover_interfaces.msg import RunState, TaskPhase
from std_msgs.msg import String

from sms_handover.analysis.deviation import LargestDeviation, state_deviation
from sms_handover.bag.run.ticks import RecordedTick
from sms_handover.frames import BASE, WORLD
from sms_handover.graph.topics import (
    BASE_ODOMETRY,
    BASE_WRENCH,
    CONTROLLER,
    GRASP_EVENT,
    JOINT_COMMAND,
    JOINT_STATES,
    PLANT,
    RUN_READY,
    RUN_STATE,
    TASK_PHASE,
    graph_topics,
)
from sms_handover.model.robot_model import RobotModel
from sms_handover.ros.codecs.base_wrench import wrench_message
from sms_handover.ros.codecs.convert import header
from sms_handover.ros.codecs.loop_messages import JointStateCodec, Stamped, StateCodec, decoded
from sms_handover.ros.node.endpoints import CountedPublisher, Endpoints
from sms_handover.ros.node.message_filter import Decode, MessageFilter
from sms_handover.ros.transport.inputs import OnSerialized
from sms_handover.ros.transport.stamp_sync import StampSync
from sms_handover.types import BaseWrench
from sms_handover.units import NS_PER_S

PEERS = (PLANT, CONTROLLER)

_MATCHING_PERIOD_S = 0.02  # [s] of wall time between two checks of who has matched
_STAMP = struct.Struct("<iI")  # seconds, nanoseconds
_STAMP_AT = 4  # [byte] after the encapsulation header
_STATE = (JOINT_STATES, BASE_ODOMETRY)


class CommandReplay:
    """Feeds a live plant in lock step from a recording, and compares every state with the recorded one."""

    def __init__(
        self,
        node: Node,
        ticks: Iterator[RecordedTick],
        robot: RobotModel,
        reference_ns: int,
        base_wrenches: Sequence[BaseWrench] = (),
    ) -> None:
        """Create the endpoints on a node with the name of the controller.

        Each ``reference_ns`` the plant needs a phase. Where none was recorded, as at the end of a run in
        real time, it gets one without grasp commands. Where no command was recorded the last one, zero at
        first, is held, as by a plant in real time. ``base_wrenches`` are those that acted on the base.
        """
        self.deviation = LargestDeviation()
        self.stamp_ns = -1  # of the latest state
        self.held = 0  # ticks without a recorded command
        self.done = False
        self._ticks = ticks
        self._next = next(ticks, None)
        self._reference_ns = reference_ns
        zero = np.zeros(robot.n_joints)  # N m
        self._last_command = JointStateCodec(robot.joint_names, ("effort",)).pack(0, effort=zero)
        self._codec = StateCodec(robot.joint_names, WORLD, BASE)
        self._inputs: StampSync[bytes] = StampSync()
        self._endpoints = Endpoints(node, graph_topics(robot.arms), PEERS)
        self._command = self._endpoints.publisher(JOINT_COMMAND)
        self._phase = self._endpoints.publisher(TASK_PHASE)
        self._ready = self._endpoints.publisher(RUN_READY)
        self._wrenches = base_wrenches
        self._wrench = self._endpoints.publisher(BASE_WRENCH) if base_wrenches else None
        self._answers: list[tuple[CountedPublisher, Any]] = []  # to the last state
        self.refusals = MessageFilter(node.get_logger().warning, lambda topic, error: None)
        reads = dict(zip(_STATE, (self._codec.joints.checked, self._codec.odometry.checked), strict=True))
        for name, read in reads.items():
            self._subscribe(name, self.refusals.wrap(name, partial(self._on_state, name), _raw(read)))
        # a controller hears of grasps; the recorded commands know of them
        self._endpoints.subscribe(GRASP_EVENT, lambda data: None, raw=True)
        self._subscribe(RUN_STATE, self.refusals.wrap(RUN_STATE, self._on_run_state, _run_state))
        self._matching = node.create_timer(_MATCHING_PERIOD_S, self._check_matched)

    @property
    def unmatched(self) -> list[str]:
        """Which endpoints of the plant have not matched yet, in words."""
        return self._endpoints.unmatched

    def _check_matched(self) -> None:
        if not self._endpoints.unmatched:
            self._matching.cancel()
            for wrench in self._wrenches:  # before the run, so that each is there when its tick comes
                if self._wrench:
                    self._wrench.publish(wrench_message(wrench))
            self._ready.publish(String(data=CONTROLLER))

    def _subscribe(self, name: str, deliver: OnSerialized) -> None:
        self._endpoints.subscribe(name, lambda data: deliver(data, 0, b""), raw=True)

    def _on_run_state(self, message: RunState, sent_ns: int) -> None:
        self.done = self.done or message.state in (RunState.FINISHED, RunState.FAILED)

    def _on_state(self, name: str, part: Stamped[bytes], sent_ns: int) -> None:
        """Handle one part of a state; a state that the plant repeats gets the same answers again."""
        stamp, data = part
        if stamp == self.stamp_ns:
            if name == JOINT_STATES:
                for publisher, message in self._answers:
                    publisher.publish(message)
            return
        self._inputs.add(stamp, name, data)
        state = self._inputs.take(stamp, _STATE)
        if state is not None and not self.done:
            self._tick(stamp, state[JOINT_STATES], state[BASE_ODOMETRY])

    def _tick(self, stamp: int, joints: bytes, odometry: bytes) -> None:
        """Answer one state, then compare it with the recorded one."""
        self.stamp_ns = stamp
        while self._next is not None and self._next.stamp_ns < stamp:
            self._next = next(self._ticks, None)
        if self._next is None:
            self.done = True
            return
        tick = self._next if self._next.stamp_ns == stamp else RecordedTick(stamp, None, None, None, None)
        self._answers.clear()
        if tick.task_phase is not None:
            self._answer(self._phase, tick.task_phase)
        elif stamp % self._reference_ns == 0:
            self._answer(self._phase, TaskPhase(header=header(stamp)))
        self._answer(self._command, self._command_for(stamp, tick.joint_command))
        if tick.joint_states is None or tick.base_odometry is None:
            return
        if (joints, odometry) == (tick.joint_states, tick.base_odometry):
            self.deviation.add_same()
        else:
            recorded = self._codec.read(tick.joint_states, tick.base_odometry)
            self.deviation.add(state_deviation(recorded, self._codec.read(joints, odometry)))

    def _command_for(self, stamp: int, command: bytes | None) -> bytes:
        """Return the recorded command, or hold the last one where none was recorded."""
        if command is None:
            self.held += 1
            command = _restamped(self._last_command, stamp)
        self._last_command = command
        return command

    def _answer(self, publisher: CountedPublisher, message: Any) -> None:
        publisher.publish(message)
        self._answers.append((publisher, message))


def _raw(read: Decode[Stamped[Any]]) -> Decode[Stamped[bytes]]:
    """Return a reader of the stamp and the unchanged bytes of valid messages."""
    return lambda data: (read(data)[0], data)


def _run_state(data: bytes) -> RunState:
    return decoded(data, RunState)


def _restamped(data: bytes, stamp: int) -> bytes:
    """Return a message in little endian CDR with another stamp in its header."""
    return data[:_STAMP_AT] + _STAMP.pack(*divmod(stamp, NS_PER_S)) + data[_STAMP_AT + _STAMP.size :]
