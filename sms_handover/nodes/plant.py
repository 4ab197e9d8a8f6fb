"""Plant node: the simulated robot and deputy, and the clock of the loop."""

import gc
from collections.abc import Sequence
from functools import partial
from time import monotonic
from typing import Any

import numpy as np
from rclpy.executors import Executor
from sms_handover_interfaces.msg import RunState
from std_msgs.msg import String

from sms_handover.graph.topics import (
    GRASP_EVENT,
    JOINT_COMMAND,
    LOOP_TIMING,
    PLANT,
    RUN_READY,
    RUN_RECORDED,
    RUN_STATE,
    TASK_PHASE,
)
from sms_handover.nodes.parts.base_wrench_input import BaseWrenchInput
from sms_handover.nodes.parts.plant_clearance import PlantClearance
from sms_handover.nodes.parts.plant_description import PlantDescription
from sms_handover.nodes.parts.plant_outputs import PlantOutputs
from sms_handover.nodes.parts.plant_transforms import PlantTransforms
from sms_handover.nodes.parts.recording_progress import RecordingProgress
from sms_handover.nodes.parts.run_control import RunControl
from sms_handover.nodes.parts.watchdogs import AnswerWatchdog, CommandWatchdog, lag_skipped
from sms_handover.plant.parameters import PlantParameters
from sms_handover.ros.codecs.convert import event_message, header
from sms_handover.ros.codecs.loop_messages import JointStateCodec, Stamped, stamped
from sms_handover.ros.codecs.task_phase import PhaseCodec
from sms_handover.ros.node.diagnostics import NodeReport
from sms_handover.ros.node.graph_node import GraphNode
from sms_handover.ros.process.main import run_node
from sms_handover.ros.transport.loop_clock import LoopClock
from sms_handover.ros.transport.stamp_sync import StampOrder, StampSync
from sms_handover.simulation.parameters import LOCKSTEP
from sms_handover.simulation.wiring import make_plant
from sms_handover.types import JointCommand, TaskPhase

_COMMAND = (JOINT_COMMAND,)
_PHASE_AND_COMMAND = (TASK_PHASE, JOINT_COMMAND)
_RUNNING = int(RunState.RUNNING)  # asking the message class for it takes a call each time
_TIMING_PERIOD_S = 1.0  # [s] of wall time
_LAST_POLLS = 3  # of the inputs: the state is taken, the command is taken, and one for what came between
_WATCHDOG_PERIOD_S = 0.5  # [s] of wall time between two polls of the watchdog


class PlantNode(GraphNode[PlantParameters]):
    """Publishes the state of every tick and integrates to the next.

    In lock step it waits for the command of that tick, and at a reference period for the task phase
    too; in real time a tick begins when the wall clock says so, with the last command held.
    """

    def __init__(self) -> None:
        super().__init__(PLANT, PlantParameters)
        self.runs = 0

    def prepare(self) -> None:
        """Place robot and deputy at the start of the schedule."""
        schedule = self.schedule
        self._plant = make_plant(self.robot, schedule, self.common, self.parameters, self.conditions)
        self._end_ns = schedule.end_ns
        self.lockstep = self.common.mode == LOCKSTEP
        self._tick_ns, self._per_reference = self.common.tick_ns, self.common.ticks_per_reference
        self._recording = RecordingProgress(self.common)
        self._command_codec = JointStateCodec(self.robot.joint_names, ("effort",))
        self._phase_codec = PhaseCodec(self.robot.arms, tuple(schedule.deputy.grasp_frames))
        self._inputs: StampSync[Any] = StampSync(ahead_ns=self._tick_ns)
        self._orders = {topic: StampOrder(0) for topic in _PHASE_AND_COMMAND}
        self._loop_clock = LoopClock(
            self.common.tick_ns, paced=not self.lockstep, catch_up_s=self.parameters.catch_up
        )
        self._command_watchdog = CommandWatchdog(self.parameters)
        self._answer_watchdog = AnswerWatchdog(self.parameters)
        self.run_state = int(RunState.WAITING)
        self._reconfigured = self.runs > 0
        self._wait_for_others()
        self._make_endpoints()
        publisher = self.endpoints.publisher
        self._clearance = PlantClearance(self.robot, schedule, self.common, publisher)
        self._description = PlantDescription(self._plant, self.robot, schedule.deputy, publisher)
        self._transforms = PlantTransforms(self.robot, publisher)
        self.create_timer(_TIMING_PERIOD_S, self._publish_timing)
        if self.lockstep:
            self.create_timer(self.parameters.resend_after, self._resend)
            self.create_timer(_WATCHDOG_PERIOD_S, self._poll_answer_watchdog)

    def on_matched(self) -> None:
        """Publish what robot and deputy these are; the run begins when the other nodes are ready too."""
        if self._reconfigured:
            self._reconfigured, self.membership.finished = False, True
            self.restart()  # the others may still know of a run before
        elif not self.runs:
            self._description.publish()
        self._begin_if_ready()

    def report(self) -> NodeReport:
        """Return how far the run is, which joints were saturated, and how well real time is kept."""
        values: dict[str, object] = {"tick": self._plant.tick, "holder": self._plant.deputy.holder or "none"}
        if self._loop_clock.skipped_s:
            values["skipped_s"] = self._loop_clock.skipped_s
        values.update({f"saturated_{k}": v for k, v in self._plant.saturated_ticks.items() if v})
        return NodeReport(self._plant.stamp_ns, values, *self._loop_clock.diagnosis)

    def activate(self) -> None:
        """Begin, or go on at the tick where the plant was deactivated."""
        if not self.lockstep:
            gc.disable()  # a collection takes as long as ticks do; the young have one after each report
        if self.run_state == RunState.PAUSED and not self._control.paused:
            self.enter(RunState.RUNNING, "activated")
        super().activate()
        self.advance()

    def deactivate(self) -> None:
        """Hold the run at this tick."""
        self.inputs.loop.close(drop=False)
        if self.run_state == RunState.RUNNING:
            self.enter(RunState.PAUSED, "deactivated")
        gc.enable()

    def clean_up(self) -> None:
        """End the run, so that the other nodes do not wait for the next state."""
        if self.runs and not self.finished:
            self.finish("the plant was cleaned up")
        super().clean_up()

    def turn(self, executor: Executor) -> None:
        """Handle what has come, and in real time begin the tick that is due."""
        if not self.active or self.lockstep:
            super().turn(executor)
            return
        clock = self._loop_clock
        left_s = clock.wait_s() - self.parameters.busy_wait
        if left_s > 0.0:
            self.inputs.loop.spin_once(executor, left_s)
            return
        self.inputs.loop.spin_some(executor)
        if clock.due():
            self._give_last_turns()
            self._tick_now()
            self.inputs.loop.give_turn(executor)

    @property
    def awaited(self) -> str:
        """The last of the inputs that complete the tick."""
        if self._ahead_of_recorder:
            return RUN_RECORDED
        return self._inputs.missing(self._plant.stamp_ns, self._needed) or JOINT_COMMAND

    @property
    def answer_is_near(self) -> bool:
        """Whether only the controller has to work: at a reference period trajectory and ik have to before."""
        return self._needed is _COMMAND and not self._ahead_of_recorder

    @property
    def _ahead_of_recorder(self) -> bool:
        """Whether the next state would be more than may be lost if the recorder were killed."""
        return self._recording.holds(self._plant.stamp_ns)

    def _make_endpoints(self) -> None:
        names = [GRASP_EVENT, RUN_STATE, LOOP_TIMING]
        self._publish = {name: self.endpoints.publisher(name) for name in names}
        publisher = self.endpoints.publisher
        self._outputs = PlantOutputs(self.robot, publisher, self.common, self.conditions)
        BaseWrenchInput(self._plant, self.inputs, lambda: self._last_tick * self._tick_ns)
        for topic, codec in ((TASK_PHASE, self._phase_codec), (JOINT_COMMAND, self._command_codec)):
            self.inputs.subscribe(topic, partial(self._on_input, topic), codec.checked)
        self.inputs.subscribe(RUN_RECORDED, self._on_recorded, stamped)
        self.inputs.subscribe_news(RUN_READY, String, self._on_ready)
        self._control = RunControl(self, self)

    # The start of a run

    def _on_ready(self, message: String) -> None:
        self._waiting_for.discard(message.data)
        self._begin_if_ready()

    def _begin_if_ready(self) -> None:
        """Begin the run once the plant is active and has matched, and every node is ready."""
        if self.run_state != RunState.WAITING or not self.active or not self.membership.has_matched:
            return
        if self.endpoints.unmatched or not self._waiting_for <= self.endpoints.not_publishing(RUN_READY):
            return
        if self.runs:
            self._description.publish()
        self.runs += 1
        self.enter(self._control.first_state, "reset" if self.runs > 1 else "")
        self._publish_state()
        if self._control.finish_asked:
            self.finish("stopped on request")

    def _wait_for_others(self) -> None:
        """Wait at the start of a run until every other node is ready."""
        self._waiting_for = set(self.common.peers) - {PLANT}
        self._last_tick, self._failed_phase = self.common.last_tick(self._end_ns), ""
        self._command = JointCommand(0, np.zeros(self.robot.n_joints))  # N m
        self._command_watchdog.reset()
        self._needed: tuple[str, ...] = _PHASE_AND_COMMAND  # what completes this tick, by arrival
        self._recording.reset()
        self._silent_tick = -1

    # One tick

    def _publish_state(self) -> None:
        """Publish the state of this tick and, each reference period, everything that goes with it.

        What other nodes wait for goes first, so that they work while the rest is published.
        """
        with_reference = self._plant.tick % self._per_reference == 0
        self._needed = _PHASE_AND_COMMAND if with_reference else _COMMAND
        self._outputs.publish_loop(self._plant, with_reference=with_reference)
        self._loop_clock.published()
        self._outputs.publish_rest(self._plant, with_reference=with_reference)
        if excesses := self._plant.take_excesses():
            self.events.publish_all(excesses)
        if with_reference:
            self._clearance.state_published(self._plant)
            self._transforms.publish(self._plant)

    def _resend(self) -> None:
        """Publish the state of this tick again if nothing has answered it for a while (lock step).

        A node that has answered it sends the same bytes again; one that has missed it answers now.
        """
        tick = self._plant.tick
        waiting = self.active and tick == self._silent_tick and not self._ahead_of_recorder
        if waiting and not self._control.holds:
            self._outputs.publish_loop(self._plant, with_reference=self._needed is _PHASE_AND_COMMAND)
        self._silent_tick = tick

    def _poll_answer_watchdog(self) -> None:
        """End the run as failed if nothing has answered this tick for too long (lock step)."""
        waits = self.active and not self._control.holds
        stamp = self._plant.stamp_ns if waits else None
        event = self._answer_watchdog.poll(stamp, self.awaited, monotonic())
        if event is not None:
            self.events.publish(event)
            self.finish(event.detail, RunState.FAILED)

    def _on_input(self, topic: str, message: Stamped[Any], sent_ns: int) -> None:
        """Take a command or a phase; in lock step it may complete the tick."""
        stamp, content = message
        if self.lockstep:
            self._inputs.add(stamp, topic, content)
        elif self._inputs.admits(stamp, topic):
            self._orders[topic].accept(stamp, self._plant.stamp_ns)
            if topic == TASK_PHASE:
                self._execute(content)
            else:
                self._command = JointCommand(stamp, *content)
        else:
            return
        if topic == JOINT_COMMAND and stamp == self._plant.stamp_ns:
            self._loop_clock.answered()
        if self.lockstep:
            self.advance()

    def _on_recorded(self, recorded: Stamped[bytes], sent_ns: int) -> None:
        """Note how far the recorder has come; in lock step the plant may have waited for it."""
        if self.run_state == RunState.WAITING:
            return  # it is of the run before
        stamp, _ = recorded
        self._recording.recorded(stamp, self._plant.stamp_ns)
        self.advance()

    def advance(self) -> None:
        """Integrate one tick if its command has come and nothing holds the plant back (lock step)."""
        if (self.run_state != _RUNNING and self._control.holds) or self._ahead_of_recorder:
            return
        needed = self._needed
        inputs = self._inputs.take(self._plant.stamp_ns, needed)
        if inputs is None:
            return
        if needed is _PHASE_AND_COMMAND:
            self._execute(inputs[TASK_PHASE])
        if self._plant.tick >= self._last_tick:
            self._end_task()
            return
        self._plant.apply(*inputs[JOINT_COMMAND])
        self._loop_clock.ticked()
        if self._control.steps_left:
            self._control.stepped()
        self._publish_state()

    def _give_last_turns(self) -> None:
        """Let a controller of this thread answer the state of a tick that is due, if it has not (real time).

        It had no processor in time, as the plant had none, and takes a small part of a tick. One in
        another process gets no more time by this.
        """
        for _ in range(_LAST_POLLS):
            if self._command.stamp_ns == self._plant.stamp_ns or not self.inputs.loop.poll():
                return

    def _tick_now(self) -> None:
        """Integrate one tick with the last command that came (real time)."""
        self._loop_clock.ticked(held=self._command.stamp_ns != self._plant.stamp_ns)
        command, event = self._command_watchdog.poll(self._command, self._plant.stamp_ns)
        self._plant.apply(command.effort)
        self._publish_state()
        if event is not None:
            self.events.publish(event)
        if skipped_s := self._loop_clock.take_skipped():
            self.events.publish(lag_skipped(self._plant.stamp_ns, skipped_s, self.parameters.catch_up))
        if self._plant.tick >= self._last_tick:
            self._end_task()

    def _execute(self, task: TaskPhase) -> None:
        """Carry out the grasp commands of a phase, publish the results, and note when the task ends."""
        self._failed_phase = task.name if task.failed else ""
        if task.end_ns:
            self._last_tick = self.common.last_tick(task.end_ns, failed=task.failed)
        self._clearance.phase_begins(self._plant, task.index)
        for event in self._plant.execute(task.commands):
            self._publish[GRASP_EVENT].publish(event_message(event))
            self.get_logger().info(f"{event.command.action.value}: {event.status.value}, {event.detail}")
        self._clearance.commands_executed(self._plant)

    # What the services of the run's control ask for

    @property
    def recorder_has_ended(self) -> bool:
        """Whether the run has a recorder, but its process has ended."""
        return self._recording.is_recorded and not self.count_publishers(RUN_RECORDED)

    def ticks_to(self, most: int) -> tuple[int, int]:
        """Return how many ticks of so many there are to the end, and the time of the last of them in ns."""
        ticks = min(most, self._last_tick - self._plant.tick)
        return ticks, self._plant.stamp_ns + ticks * self._tick_ns

    def restart(self) -> None:
        """End this run and wait for the next one at time zero."""
        if not self.finished:
            self.events.publish_all(self._plant.end_excesses())
        self.enter(RunState.WAITING, "reset")
        if not self.finished:
            self.membership.end()
        self.membership.finished = False
        self._control.reset_run()
        self._plant.base_wrenches.clear()
        self._plant.reset()
        self._clearance.reset()
        self._inputs.reset_run()
        for order in self._orders.values():
            order.reset()
        self._loop_clock.reset()
        self._wait_for_others()
        self.membership.rejoin()

    def _end_task(self) -> None:
        if self._failed_phase:
            self.finish(f"phase {self._failed_phase!r} has failed", RunState.FAILED)
        else:
            self.finish("run complete")

    def finish(self, detail: str, state: int = RunState.FINISHED) -> None:
        """End the run and publish what real time has cost; every node then publishes its counts."""
        if not self.lockstep and self._loop_clock.misses:
            detail = f"{detail}; {self._loop_clock.misses}"
        self.events.publish_all(self._plant.end_excesses())
        self.membership.finished = True
        self.enter(state, detail)
        self.membership.end()

    def enter(self, state: int, detail: str) -> None:
        """Change the state of the run, with the clock of the loop, and publish it."""
        self.run_state = state
        if state == RunState.RUNNING:
            self._loop_clock.start()
        else:
            self._loop_clock.stop()
        message = RunState(header=header(self._plant.stamp_ns), state=state, tick=self._plant.tick)
        message.detail, message.wall_time = detail, self._loop_clock.ran
        self._publish[RUN_STATE].publish(message)

    def _publish_timing(self) -> None:
        """Publish how the loop has kept time over the last second."""
        if self.run_state == RunState.RUNNING and not self.finished:
            message = self._loop_clock.report()
            message.header = header(self._plant.stamp_ns)
            self._publish[LOOP_TIMING].publish(message)
            if not self.lockstep:
                gc.collect(0)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(PlantNode, args, name=PLANT)


if __name__ == "__main__":
    raise SystemExit(main())
