"""The controller node."""

from collections.abc import Sequence
from typing import Any

from sms_handover.bag.decode import task_phase
from sms_handover.bag.stamp import stamp_ns
from sms_handover.control.parameters import ControllerParameters
from sms_handover.frames import BASE, WORLD
from sms_handover.ros.convert import stamp_ns_of
from sms_handover.ros.graph_node import GraphNode
from sms_handover.ros.main import run_node
from sms_handover.ros.stamp_sync import StampSync
from sms_handover.ros.wire import JointStateWire, StateWire
from sms_handover.simulation.parameters import LOCKSTEP
from sms_handover.simulation.scenario import load_task
from sms_handover.simulation.wiring import make_controller
from sms_handover.topics import (
    BASE_ODOMETRY,
    CONTROLLER,
    JOINT_COMMAND,
    JOINT_REFERENCE,
    JOINT_STATES,
    TASK_PHASE,
)
from sms_handover.types import JointReference

_STATE = (JOINT_STATES, BASE_ODOMETRY)
_STATE_AND_REFERENCE = (*_STATE, JOINT_REFERENCE, TASK_PHASE)


class ControllerNode(GraphNode[ControllerParameters]):
    """Answers every state with a joint command of the same stamp.

    In lock step a state that falls on a reference period waits for its reference; in real time the
    last reference holds.
    """

    def __init__(self) -> None:
        """Set up the law; raises UnstableLoopError if its gains cannot work at this tick."""
        super().__init__(CONTROLLER, ControllerParameters)
        schedule = load_task(self.common, self.robot)
        self._controller = make_controller(self.robot, schedule, self.common, self.parameters)
        self._lockstep = self.common.mode == LOCKSTEP
        self._state_wire = StateWire(self.robot.joint_names, WORLD, BASE)
        self._reference_wire = JointStateWire(self.robot.joint_names, ("position", "velocity"))
        self._command_wire = JointStateWire(self.robot.joint_names, ("effort",))
        self._inputs: StampSync[Any] = StampSync()
        self._answered_ns = 0
        self._command = self.endpoints.publisher(JOINT_COMMAND)
        for topic in (*_STATE, JOINT_REFERENCE):
            self.endpoints.subscribe(topic, self._taker(topic), raw=True)
        self.endpoints.subscribe(TASK_PHASE, self._on_phase)

    def diagnostic_values(self) -> dict[str, object]:
        """Return what has been answered and what came too late."""
        return {"law": self.parameters.law, "answered": self._command.count, "late": self._inputs.dropped}

    def diagnostic_stamp_ns(self) -> int:
        """Return the stamp of the last state answered."""
        return self._answered_ns

    def _taker(self, topic: str) -> Any:
        """Return the callback of a topic of raw messages."""
        return lambda data: self._take(topic, stamp_ns(data), data)

    def _on_phase(self, message: Any) -> None:
        """Take the phase of the task."""
        self._take(TASK_PHASE, stamp_ns_of(message.header.stamp), message)

    def _take(self, topic: str, stamp: int, value: Any) -> None:
        """Take one input; a state of time zero behind an answered one begins the run anew."""
        if self._inputs.begins_anew(stamp):
            self._inputs.reset()
            self._controller.reset()
        if not self._lockstep and topic in (JOINT_REFERENCE, TASK_PHASE):
            self._use(topic, value)
            return
        self._inputs.add(stamp, topic, value)
        self._answer(stamp)

    def _answer(self, stamp: int) -> None:
        """Publish the command of a state as soon as everything that belongs to it has come."""
        with_reference = self._lockstep and stamp % self.common.reference_ns == 0
        inputs = self._inputs.take(stamp, _STATE_AND_REFERENCE if with_reference else _STATE)
        if inputs is None:
            return
        if with_reference:
            self._use(TASK_PHASE, inputs[TASK_PHASE])
            self._use(JOINT_REFERENCE, inputs[JOINT_REFERENCE])
        state = self._state_wire.read(inputs[JOINT_STATES], inputs[BASE_ODOMETRY])
        command = self._controller.step(state)
        self._command.publish(self._command_wire.pack(stamp, effort=command.effort))
        self._answered_ns = stamp

    def _use(self, topic: str, value: Any) -> None:
        """Give a phase or a reference to the controller."""
        if topic == TASK_PHASE:
            self._controller.enter(task_phase(value))
        else:
            blocks = self._reference_wire.read(value)
            reference = JointReference(stamp_ns(value), blocks["position"], blocks["velocity"])
            self._controller.track(reference)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(ControllerNode, args)


if __name__ == "__main__":
    raise SystemExit(main())
