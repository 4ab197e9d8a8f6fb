"""The plant node."""

import gc
from collections.abc import Sequence
from time import monotonic
from typing import Any

import numpy as np
from rclpy.executors import Executor
from sms_handover_interfaces.msg import RunState
from sms_handover_interfaces.srv import StepTicks
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from sms_handover.bag.stamp import stamp_ns
from sms_handover.errors import MessageError, Reason
from sms_handover.plant.answer_watch import AnswerWatch
from sms_handover.plant.command_watch import CommandWatch
from sms_handover.plant.parameters import PlantParameters
from sms_handover.ros.convert import event_message, header, time_message
from sms_handover.ros.graph_node import GraphNode
from sms_handover.ros.loop_clock import LoopClock
from sms_handover.ros.main import EXIT_OK, Stop, run_node
from sms_handover.ros.marker import deputy_marker
from sms_handover.ros.phase_wire import PhaseWire
from sms_handover.ros.plant_outputs import PlantOutputs
from sms_handover.ros.stamp_sync import StampOrder, StampSync
from sms_handover.ros.wire import JointStateWire, arrival_ns, check_stamp
from sms_handover.simulation.parameters import LOCKSTEP
from sms_handover.simulation.scenario import load_task
from sms_handover.simulation.wiring import make_plant
from sms_handover.topics import (
    DEPUTY_MARKER,
    GRASP_EVENT,
    JOINT_COMMAND,
    LOOP_TIMING,
    PLANT,
    RECORDER,
    ROBOT_DESCRIPTION,
    RUN_READY,
    RUN_RECORDED,
    RUN_STATE,
    TASK_PHASE,
)
from sms_handover.types import JointCommand

_COMMAND = (JOINT_COMMAND,)
_PHASE_AND_COMMAND = (TASK_PHASE, JOINT_COMMAND)
_MOST_UNRECORDED_NS = 45_000_000  # [ns] of simulation time that may be lost with the recorder
_TIMING_PERIOD_S = 1.0  # [s] of wall time
_LOOK_PERIOD_S = 0.5  # [s] of wall time between two looks whether the loop goes on


class PlantNode(GraphNode[PlantParameters]):
    """Publishes the state of every tick and integrates to the next.

    In lock step it waits for the command of that tick, and at a reference period for the task phase
    too; in real time a tick begins when the wall clock says so, with the last command held.
    """

    def __init__(self) -> None:
        """Place robot and deputy at the start of the schedule."""
        super().__init__(PLANT, PlantParameters)
        schedule = load_task(self.common, self.robot)
        self._plant = make_plant(self.robot, schedule, self.common, self.parameters)
        self._deputy_size = schedule.deputy.size
        self._end_ns = schedule.end_ns
        self._last_tick, self._failed_phase = self.common.last_tick(self._end_ns), ""
        self._lockstep = self.common.mode == LOCKSTEP
        self._tick_ns, self._per_reference = self.common.tick_ns, self.common.ticks_per_reference
        self._is_recorded = RECORDER in self.common.peers
        self._command_wire = JointStateWire(self.robot.joint_names, ("effort",))
        self._phase_wire = PhaseWire(self.robot.arms, tuple(schedule.deputy.grasp_frames))
        self._inputs: StampSync[bytes] = StampSync(ahead_ns=self._tick_ns)
        self._orders = {topic: StampOrder(0) for topic in _PHASE_AND_COMMAND}
        self._loop_clock = LoopClock(self.common.tick_ns, paced=not self._lockstep)
        self._command = JointCommand(0, np.zeros(self.robot.n_joints))  # N m
        self._command_watch = CommandWatch(self.parameters)
        self._answer_watch = AnswerWatch(self.parameters)
        self._run_state = RunState.WAITING
        self._steps_left = 0
        self._reset_asked = False
        self._recorded_ns = 0
        self._waiting_for = set(self.common.peers) - {PLANT}
        self._make_endpoints()
        self._silent_tick = -1
        self.create_timer(_TIMING_PERIOD_S, self._publish_timing)
        if self._lockstep:
            self.create_timer(self.parameters.resend_after, self._send_again)
            self.create_timer(_LOOK_PERIOD_S, self._look_for_answer)

    def on_matched(self) -> None:
        """Say what robot and deputy these are; the run begins when the other nodes are ready too."""
        self._publish[ROBOT_DESCRIPTION].publish(String(data=self.robot.urdf))
        self._publish[DEPUTY_MARKER].publish(deputy_marker(self._deputy_size))
        self._begin_if_ready()

    def diagnostic_values(self) -> dict[str, object]:
        """Return how far the run is and which joints were saturated."""
        saturated = {f"saturated_{k}": v for k, v in self._plant.saturated_ticks.items() if v}
        return {"tick": self._plant.tick, "holder": self._plant.deputy.holder or "none", **saturated}

    def diagnosis(self) -> tuple[int, str]:
        """Return how well real time is kept."""
        return self._loop_clock.diagnosis

    def diagnostic_stamp_ns(self) -> int:
        """Return simulation time."""
        return self._plant.stamp_ns

    def run(self, executor: Executor, stop: Stop) -> int:
        """Handle events until asked to stop, and in real time begin every tick at its deadline."""
        if self._lockstep:
            return super().run(executor, stop)
        clock = self._loop_clock
        gc.disable()  # a collection takes as long as ticks do; there is one of the young after each report
        try:
            while not stop.asked:
                left_s = clock.wait_s() - self.parameters.busy_wait
                if left_s > 0.0:
                    self.inputs.spin_once(executor, left_s, self.awaited)
                    continue
                self.inputs.poll()
                if clock.due():
                    self._tick_now()
        finally:
            gc.enable()
        return EXIT_OK

    @property
    def awaited(self) -> str:
        """Return what comes last of what completes the tick."""
        if self._ahead_of_recorder:
            return RUN_RECORDED
        return self._inputs.missing(self._plant.stamp_ns, self._needed) or JOINT_COMMAND

    @property
    def _ahead_of_recorder(self) -> bool:
        """Tell whether the next state would be more than may be lost if the recorder were killed."""
        next_ns = self._plant.stamp_ns + self._tick_ns
        return self._is_recorded and next_ns - self._recorded_ns > _MOST_UNRECORDED_NS

    @property
    def _needed(self) -> tuple[str, ...]:
        """Return the inputs that complete this tick, the last one to come last."""
        return _PHASE_AND_COMMAND if self._at_reference else _COMMAND

    @property
    def _at_reference(self) -> bool:
        """Tell whether a reference period begins with this tick."""
        return self._plant.tick % self._per_reference == 0

    def _make_endpoints(self) -> None:
        """Make publishers, subscriptions and services."""
        names = [GRASP_EVENT, ROBOT_DESCRIPTION, DEPUTY_MARKER, RUN_STATE, LOOP_TIMING]
        self._publish = {name: self.endpoints.publisher(name) for name in names}
        self._outputs = PlantOutputs(self.robot, self.endpoints.publisher)
        self.receive(TASK_PHASE, self._on_phase, self._phase_wire.check)
        self.receive(JOINT_COMMAND, self._on_command, self._command_wire.check)
        self.receive(RUN_RECORDED, self._on_recorded, check_stamp)
        self.endpoints.subscribe(RUN_READY, self._on_ready)
        self.create_service(SetBool, "~/pause", self._on_pause)
        self.create_service(StepTicks, "~/step", self._on_step)
        self.create_service(Trigger, "~/reset", self._on_reset)
        self.create_service(Trigger, "~/finish", self._on_finish)

    # The start of the run

    def _on_ready(self, message: String) -> None:
        """Note that another node is ready."""
        self._waiting_for.discard(message.data)
        self._begin_if_ready()

    def _begin_if_ready(self) -> None:
        """Begin the run once every node is ready."""
        waits = not self._waiting_for <= self.endpoints.silent(RUN_READY)
        if self._run_state == RunState.WAITING and not waits and not self.endpoints.unmatched:
            self._enter(RunState.RUNNING, "")
            self._publish_state()

    # One tick

    def _publish_state(self) -> None:
        """Publish the state of this tick and, each reference period, everything that goes with it.

        What other nodes wait for goes first, so that they work while the rest is published.
        """
        with_reference = self._at_reference
        self._outputs.publish_loop(self._plant, with_reference=with_reference)
        self._loop_clock.published()
        self._outputs.publish_rest(self._plant, with_reference=with_reference)

    def _send_again(self) -> None:
        """Publish the state of this tick once more if nothing has answered it for a while (lock step).

        Whoever has answered it sends the same bytes again; whoever has missed it answers now.
        """
        tick = self._plant.tick
        waiting = tick == self._silent_tick and not self._ahead_of_recorder
        if waiting and (self._run_state == RunState.RUNNING or self._steps_left):
            self._outputs.publish_loop(self._plant, with_reference=self._at_reference)
        self._silent_tick = tick

    def _look_for_answer(self) -> None:
        """End the run as failed if nothing has answered this tick for too long (lock step)."""
        waiting = self._run_state == RunState.RUNNING or self._steps_left > 0
        stamp = self._plant.stamp_ns if waiting else None
        event = self._answer_watch.look(stamp, self.awaited, monotonic())
        if event is not None:
            self.events.publish(event)
            self._finish(event.detail, RunState.FAILED)

    def _on_command(self, data: bytes, sent_ns: int) -> None:
        """Take a command; in lock step it may complete the tick."""
        if self._lockstep:
            stamp = arrival_ns(data)
            self._inputs.add(stamp, JOINT_COMMAND, data)
            if stamp == self._plant.stamp_ns:
                self._loop_clock.answered()
            self._advance()
        else:
            self._orders[JOINT_COMMAND].take(arrival_ns(data), self._plant.stamp_ns)
            self._command = self._read_command(data)
            if self._command.stamp_ns == self._plant.stamp_ns:
                self._loop_clock.answered()

    def _on_phase(self, data: bytes, sent_ns: int) -> None:
        """Take the phase of the task; in lock step it may complete the tick."""
        if self._lockstep:
            self._inputs.add(arrival_ns(data), TASK_PHASE, data)
            self._advance()
        else:
            self._orders[TASK_PHASE].take(arrival_ns(data), self._plant.stamp_ns)
            self._execute(data)

    def _on_recorded(self, data: bytes, sent_ns: int) -> None:
        """Note up to where the recorder has come; in lock step the plant may have waited for it."""
        stamp = arrival_ns(data)
        if not self._recorded_ns <= stamp <= self._plant.stamp_ns:
            reason = Reason.OLD if stamp < self._recorded_ns else Reason.FUTURE
            allowed = f"allowed is {self._recorded_ns} to {self._plant.stamp_ns} ns"
            raise MessageError(reason, f"recorded is said to be up to {stamp} ns, {allowed}")
        self._recorded_ns = stamp
        if self._lockstep:
            self._advance()

    def _advance(self) -> None:
        """Integrate one tick if its command has come and nothing holds the plant back (lock step)."""
        if self._ahead_of_recorder:
            return
        if self._run_state == RunState.PAUSED and self._steps_left == 0 and not self._reset_asked:
            return
        needed = self._needed
        inputs = self._inputs.take(self._plant.stamp_ns, needed)
        if inputs is None or self.finished:
            return
        if self._reset_asked:
            self._begin_anew()
            return
        if needed is _PHASE_AND_COMMAND:
            self._execute(inputs[TASK_PHASE])
        if self._plant.tick >= self._last_tick:
            self._end_task()
            return
        self._plant.step(self._read_command(inputs[JOINT_COMMAND]))
        self._loop_clock.ticked()
        if self._steps_left:
            self._steps_left -= 1
            if self._steps_left == 0:
                self._enter(RunState.PAUSED, "stepped")
        self._publish_state()

    def _tick_now(self) -> None:
        """Integrate one tick with the last command that came (real time)."""
        self._loop_clock.ticked(held=self._command.stamp_ns != self._plant.stamp_ns)
        command, event = self._command_watch.look(self._command, self._plant.stamp_ns)
        self._plant.step(command)
        self._publish_state()
        if event is not None:
            self.events.publish(event)
        if self._reset_asked:
            self._begin_anew()
        elif self._plant.tick >= self._last_tick:
            self._end_task()

    def _read_command(self, data: bytes) -> JointCommand:
        """Return the command in a message."""
        return JointCommand(stamp_ns(data), self._command_wire.read(data)["effort"])

    def _execute(self, phase: bytes) -> None:
        """Carry out the grasp commands of a phase, tell what came of them, and note when the task ends."""
        task = self._phase_wire.read(phase)
        self._failed_phase = task.name if task.failed else ""
        if task.end_ns:
            self._last_tick = self.common.last_tick(task.end_ns, failed=task.failed)
        for event in self._plant.execute(task.commands):
            self._publish[GRASP_EVENT].publish(event_message(event))
            self.get_logger().info(f"{event.command.action.value}: {event.status.value}, {event.detail}")

    # Pause, step, reset, end

    def _on_pause(self, request: Any, response: Any) -> Any:
        """Pause or resume."""
        response.success = self._run_state in (RunState.RUNNING, RunState.PAUSED)
        response.message = "" if response.success else "the run has not begun or is over"
        if response.success and request.data and self._run_state == RunState.RUNNING:
            self._enter(RunState.PAUSED, "on request")
        elif response.success and not request.data and self._run_state == RunState.PAUSED:
            self._steps_left = 0
            self._enter(RunState.RUNNING, "")
            self._advance()
        return response

    def _on_step(self, request: Any, response: Any) -> Any:
        """Let a paused plant go on for some ticks."""
        response.success = self._lockstep and self._run_state == RunState.PAUSED and request.ticks > 0
        if response.success:
            self._steps_left = min(request.ticks, self._last_tick - self._plant.tick)
            target_ns = self._plant.stamp_ns + self._steps_left * self.common.tick_ns
            response.stamp = time_message(target_ns)
            self._advance()
        else:
            response.message = "only a plant that is paused in lock step can step, by at least one tick"
        return response

    def _on_reset(self, request: Any, response: Any) -> Any:
        """Begin the run anew as soon as this tick has been answered, so that no answer is left over."""
        response.success = self._run_state != RunState.WAITING
        response.message = "" if response.success else "the run has not begun"
        if response.success and self.finished:
            self._begin_anew()
        elif response.success:
            self._reset_asked = True
            if self._lockstep:
                self._advance()
        return response

    def _on_finish(self, request: Any, response: Any) -> Any:
        """End the run at this tick."""
        response.success = not self.finished
        if response.success:
            self._finish("stopped on request")
        return response

    def _begin_anew(self) -> None:
        """Go back to time zero; the other nodes do so when they see the state of that time."""
        self._reset_asked = False
        self._steps_left = 0
        self._last_tick, self._failed_phase = self.common.last_tick(self._end_ns), ""
        self._recorded_ns = 0
        self.finished = False
        self._plant.reset()
        self._inputs.reset()
        for order in self._orders.values():
            order.reset()
        self._loop_clock.reset()
        self._command = JointCommand(0, np.zeros(self.robot.n_joints))  # N m
        self._command_watch.reset()
        self._enter(RunState.PAUSED if self._run_state == RunState.PAUSED else RunState.RUNNING, "reset")
        self._publish_state()

    def _end_task(self) -> None:
        """End the run where the task has ended."""
        if self._failed_phase:
            self._finish(f"phase {self._failed_phase!r} has failed", RunState.FAILED)
        else:
            self._finish("the whole run is done")

    def _finish(self, detail: str, state: int = RunState.FINISHED) -> None:
        """Say that the run is over, and what real time has cost; every node then tells its counts."""
        if not self._lockstep and self._loop_clock.misses:
            detail = f"{detail}; {self._loop_clock.misses}"
        self.finished = True
        self._enter(state, detail)
        self.publish_diagnostics()
        self.publish_counts()

    def _enter(self, state: int, detail: str) -> None:
        """Change the state of the run, with the clock of the loop, and tell everybody."""
        self._run_state = state
        if state == RunState.RUNNING:
            self._loop_clock.start()
        else:
            self._loop_clock.stop()
        message = RunState(header=header(self._plant.stamp_ns), state=state, tick=self._plant.tick)
        message.detail, message.wall_time = detail, self._loop_clock.ran
        self._publish[RUN_STATE].publish(message)

    def _publish_timing(self) -> None:
        """Publish how the loop has kept time over the last second."""
        if self._run_state == RunState.RUNNING and not self.finished:
            message = self._loop_clock.report()
            message.header = header(self._plant.stamp_ns)
            self._publish[LOOP_TIMING].publish(message)
            if not self._lockstep:
                gc.collect(0)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(PlantNode, args, name=PLANT)


if __name__ == "__main__":
    raise SystemExit(main())
