"""Starts the graph, watches it to the end of the run, and ends it whatever happens."""

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path

import rclpy
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sms_handover_interfaces.msg import RunState

from sms_handover.errors import GraphError
from sms_handover.graph.events import RunEvent
from sms_handover.graph.topics import NODES, PLANT, RECORDER
from sms_handover.launcher.display import Display
from sms_handover.launcher.interrupts import Interrupts, let_go_of_closed_output
from sms_handover.launcher.lifecycle_driver import LifecycleDriver
from sms_handover.launcher.monitor import RunMonitor
from sms_handover.launcher.processes import Death, NodeProcesses
from sms_handover.launcher.shared_memory import SharedMemory
from sms_handover.launcher.timeouts import ActiveTime, SuspensionMonitor, WaitNotice
from sms_handover.ros.launching.composition import ProcessArguments, nodes_together, process_arguments
from sms_handover.ros.node.node_inputs import INPUTS
from sms_handover.ros.process.main import EXIT_LOSS, EXIT_OK
from sms_handover.ros.process.network_scope import THIS_MACHINE, NetworkScope
from sms_handover.simulation.scenario import COMMON, Scenario
from sms_handover.types import GraspEvent
from sms_handover.units import ns_to_seconds

_LOG_FOLDER = "ROS_LOG_DIR"  # environment variable that ROS reads
_POLL_S = 0.1  # [s] longest wait for a message before the processes are looked at again
_START_PATIENCE_S = 60.0  # [s] of wall time until the run must have begun
_HOSTS_PATIENCE_S = 600.0  # [s] of wall time likewise, where somebody has to start nodes on other hosts
_BEGUN_PATIENCE_S = 10.0  # [s] of wall time for the news that the run has begun, when it is interrupted
_STALL_PATIENCE_S = 30.0  # [s] of wall time without progress of simulated time
_NEWS_PATIENCE_S = 20.0  # [s] of wall time for the news that the run is over, once the recorder has ended
_SHUTDOWN_PATIENCE_S = 3.0  # [s] of wall time for the nodes to end when they are shut down
_SHUTDOWN_POLL_S = 0.01  # [s] longest wait for an answer then
_DRAIN_PATIENCE_S = 60.0  # [s] of wall time for the recorder to finish
_GONE_PATIENCE_S = 60.0  # [s] of wall time for nodes of other hosts to end; more than the lease of DDS


@dataclass(frozen=True)
class LaunchPlan:
    """What to start and where its logs go; ``compose``: few processes.

    ``nodes`` are those to start here, ``elsewhere`` those that somebody starts on other hosts; ``bag``
    is where the recorder writes, None if it is not among ``nodes``.
    ``controller`` is the command line of an external controller; empty if the user starts it, or if it
    is ours. Every process keeps the ``inherited`` file descriptors open: what they lock is free after the
    last one.
    """

    scenario: Scenario
    parameter_files: tuple[Path, ...]
    domain: int
    log_folder: Path
    bag: Path | None
    compose: bool = False
    controller: tuple[str, ...] = ()
    inherited: tuple[int, ...] = ()
    nodes: tuple[str, ...] = NODES
    elsewhere: tuple[str, ...] = ()
    reach: NetworkScope = THIS_MACHINE

    @property
    def external(self) -> frozenset[str]:
        """Return the nodes that are none of ours."""
        return frozenset(self.scenario.parameters.common.external)


@dataclass(frozen=True)
class Outcome:
    """How a run ended: what the plant said, the events, whether the bag has every message."""

    detail: str
    failed: bool
    stamp_ns: int
    events: tuple[GraspEvent, ...]
    run_events: tuple[RunEvent, ...]
    recorder_code: int
    recorder_said: str
    interrupted: bool


def launch(plan: LaunchPlan) -> Outcome:
    """Run the graph of a plan to its end; raises GraphError if it could not go on."""
    with Interrupts() as interrupts, SharedMemory() as memory:
        try:
            return _run(plan, interrupts, memory)
        finally:
            let_go_of_closed_output()


def _run(plan: LaunchPlan, interrupts: Interrupts, memory: SharedMemory) -> Outcome:
    """Take part in the graph, and let go of the middleware at the end."""
    os.environ.setdefault(_LOG_FOLDER, str(plan.log_folder / "ros"))  # its default needs a HOME
    os.environ.update(plan.reach.environment)  # the launcher's own ear reaches no further than the nodes
    try:
        rclpy.init(domain_id=plan.domain, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # such as no thread or no memory left
        raise GraphError(f"ROS cannot be started: {error}") from error
    node = Node("launcher", start_parameter_services=False, enable_rosout=False)
    inputs = INPUTS[plan.scenario.parameters.common.transport](node)
    executor = EventsExecutor()
    try:
        monitor = RunMonitor(node, plan.scenario.robot.arms, inputs)
        executor.add_node(node)
        with NodeProcesses(plan.log_folder, graph_environment(plan), plan.inherited) as processes:
            for name, arguments in arguments_of(plan).items():
                if name not in plan.external:
                    processes.start(name, arguments.line)
                elif plan.controller:
                    named = ("--remap", f"__node:={name}")
                    processes.start(name, (*arguments.line, *named), plan.controller)
            driver = LifecycleDriver(node, nodes_of(plan))
            return _Watch(plan, monitor, driver, executor, processes, interrupts, memory).to_the_end()
    finally:
        executor.shutdown()  # it would keep the middleware up behind the node
        inputs.destroy()
        node.destroy_node()
        rclpy.try_shutdown()


def graph_environment(plan: LaunchPlan) -> dict[str, str]:
    """Return the environment variables that keep the graph to itself."""
    return {
        **plan.reach.environment,
        "ROS_DOMAIN_ID": str(plan.domain),
        _LOG_FOLDER: str(plan.log_folder / "ros"),
        "OPENBLAS_NUM_THREADS": "1",  # matrices of 14 columns gain nothing from threads
        "PYTHONUNBUFFERED": "1",
    }


def nodes_of(plan: LaunchPlan) -> tuple[str, ...]:
    """Return the nodes here that are ours, which the launcher takes through their lifecycle."""
    return tuple(name for name in plan.nodes if name not in plan.external)


def arguments_of(plan: LaunchPlan) -> Mapping[str, ProcessArguments]:
    """Return what every process here is to be started with."""
    own = {name: dict(values) for name, values in plan.scenario.overrides.items()}
    for name in nodes_of(plan):
        own.setdefault(name, {})["autostart"] = False
    if plan.bag:
        own.setdefault(RECORDER, {})["folder"] = str(plan.bag)
    files = [str(path) for path in plan.parameter_files]
    together = nodes_together(plan.scenario.parameters.common.mode) if plan.compose else ()
    common = own.get(COMMON, {})
    record = RECORDER in {*plan.nodes, *plan.elsewhere}
    return process_arguments(common, own, files, record=record, together=together, here=plan.nodes)


class _Watch:
    """Looks after one run from start to end."""

    def __init__(
        self,
        plan: LaunchPlan,
        monitor: RunMonitor,
        driver: LifecycleDriver,
        executor: Executor,
        processes: NodeProcesses,
        interrupts: Interrupts,
        memory: SharedMemory,
    ) -> None:
        common = plan.scenario.parameters.common
        end_ns = common.last_tick(plan.scenario.schedule.end_ns) * common.tick_ns
        self._plan, self._monitor, self._executor, self._processes = plan, monitor, executor, processes
        self._driver, self._common = driver, common
        self._display = Display(end_ns)
        self._events_shown = self._run_events_shown = 0
        self._interrupts, self._memory = interrupts, memory
        self._time, self._suspended = ActiveTime(), SuspensionMonitor()
        self._recorder_seen_gone = inf

    def to_the_end(self) -> Outcome:
        """Return how the run ended; raises GraphError if a node died or nothing went on.

        Raises KeyboardInterrupt on an interrupt before the run has begun, and on a second one.
        """
        self._wait_for_start()
        code = None
        while code is None:  # the run may be reset at any moment, also at its end
            self._wait_for_end()
            self._wait_for_events()
            code = self._wait_for_recorder() if self._plan.bag else EXIT_OK
        self._wait_for_other_hosts()
        self._shut_down()
        progress = self._monitor.progress
        self._show(last=True)
        return Outcome(
            detail=progress.detail,
            failed=progress.state == RunState.FAILED,
            stamp_ns=progress.stamp_ns,
            events=tuple(progress.events),
            run_events=tuple(progress.run_events),
            recorder_code=code,
            recorder_said=self._processes.text_of(RECORDER) if self._plan.bag else "",
            interrupted=self._interrupts.asked,
        )

    def _wait_for_start(self) -> None:
        """Wait until every endpoint has matched and the plant has begun."""
        by_hand = bool(self._plan.external) and not self._plan.controller
        patience_s = _HOSTS_PATIENCE_S if self._plan.elsewhere else _START_PATIENCE_S
        deadline = inf if by_hand else self._time.seconds + patience_s
        interrupted = inf
        asked = False
        delay = WaitNotice()
        while self._monitor.progress.state == RunState.WAITING:
            self._driver.look()
            self._look()
            self._memory.note((os.getpid(), *self._processes.ids.values()))
            if self._interrupts.asked:
                if self._interrupts.at_once or not self._driver.active:
                    raise KeyboardInterrupt
                interrupted = min(interrupted, self._time.seconds)
                asked = asked or self._monitor.ask_to_finish()  # it may run, and only the news be late
                if self._time.seconds - interrupted > _BEGUN_PATIENCE_S:
                    raise KeyboardInterrupt
            why = self._driver.waiting_for or self._monitor.waiting_for()
            if self._time.seconds > deadline:
                raise GraphError(f"the run has not begun after {patience_s:g} s: {why}")
            if told := delay.note(self._time.seconds, why):
                self._display.tell(told)
        self._display.start(self._monitor.progress.stamp_ns)

    def _wait_for_end(self) -> None:
        """Wait until the plant says that the run is over."""
        seen_ns, since = -1, self._time.seconds
        asked = False
        while not self._monitor.finished:
            self._look()
            self._show()
            if self._interrupts.at_once:
                raise KeyboardInterrupt
            if self._interrupts.asked and not asked:
                asked = self._monitor.ask_to_finish()
            now_ns = self._monitor.progress.stamp_ns
            if now_ns != seen_ns or self._monitor.progress.state == RunState.PAUSED:
                seen_ns, since = now_ns, self._time.seconds
            elif self._time.seconds - since > _STALL_PATIENCE_S:
                raise GraphError(
                    f"no progress for {_STALL_PATIENCE_S:g} s at {ns_to_seconds(now_ns):g} s of simulated "
                    f"time: {self._monitor.waiting_for()}"
                )

    def _wait_for_events(self) -> None:
        """Wait for the events, which may come behind the news of the end."""
        deadline = self._time.seconds + _NEWS_PATIENCE_S
        while (
            not self._monitor.heard_every_event
            and not self._interrupts.at_once
            and self._time.seconds < deadline
        ):
            self._look()

    def _wait_for_recorder(self) -> int | None:
        """Wait until the recorder has everything and has closed the bag; return its exit code.

        Returns None if a new run begins instead.
        """
        deadline = self._time.seconds + _DRAIN_PATIENCE_S
        while True:
            if not self._monitor.finished:
                return None
            code = self._processes.exit_code(RECORDER)
            if code is not None:
                return code
            self._look()
            if self._interrupts.at_once:
                raise KeyboardInterrupt
            if self._time.seconds > deadline:
                raise GraphError(f"the recorder has not closed the bag; {self._remedy}")

    def _wait_for_other_hosts(self) -> None:
        """Wait until no node on another host needs those here; raises GraphError if the recorder stays.

        Everybody stays until the recorder has everything, and the plant, which tells of the end, to the last.
        """
        if RECORDER in self._plan.elsewhere and not self._are_gone((RECORDER,)):
            raise GraphError("the recorder, on another host, has not ended; look at its bag there")
        if PLANT in self._plan.nodes:
            self._are_gone(self._plan.elsewhere)

    def _are_gone(self, names: Collection[str]) -> bool:
        """Wait until nodes have left the graph; tell whether they have."""
        deadline = self._time.seconds + _GONE_PATIENCE_S
        while self._monitor.present(names):
            if not self._monitor.finished:  # the run has been reset
                deadline = self._time.seconds + _GONE_PATIENCE_S
            if self._time.seconds > deadline or self._interrupts.at_once:
                return False
            self._look()
        return True

    def _shut_down(self) -> None:
        """Let every node end in order; whoever does not is ended with its process."""
        self._driver.shut_down()
        deadline = self._time.seconds + _SHUTDOWN_PATIENCE_S
        while len(self._processes.dead()) < len(self._processes.ids) and self._time.seconds < deadline:
            self._executor.spin_once(timeout_sec=_SHUTDOWN_POLL_S)
            self._time.look()

    def _look(self) -> None:
        """Handle what has come, and raise GraphError if a node has died."""
        self._executor.spin_once(timeout_sec=_POLL_S)
        self._monitor.look()
        self._time.look()
        let_go_of_closed_output()
        self._interrupts.tell()
        self._suspended.look(self._processes.suspended(), self._time.seconds)
        if dead := [death for death in self._processes.dead() if not self._recorder_is_done(death)]:
            raise GraphError(self._death_report(dead))

    def _recorder_is_done(self, death: Death) -> bool:
        """Whether a process that ended is the recorder at the end of the run.

        The recorder may close the bag and end before the news of the end has come to the launcher.
        """
        if death.name != RECORDER or death.code not in (EXIT_OK, EXIT_LOSS):
            return False
        self._recorder_seen_gone = min(self._recorder_seen_gone, self._time.seconds)
        return self._monitor.finished or self._time.seconds - self._recorder_seen_gone < _NEWS_PATIENCE_S

    def _show(self, *, last: bool = False) -> None:
        """Show progress, and every event once."""
        progress = self._monitor.progress
        self._events_shown = min(self._events_shown, len(progress.events))
        self._run_events_shown = min(self._run_events_shown, len(progress.run_events))
        for event in progress.events[self._events_shown :]:
            self._display.event(event)
        for decision in progress.run_events[self._run_events_shown :]:
            self._display.event(decision)
        self._events_shown, self._run_events_shown = len(progress.events), len(progress.run_events)
        if progress.task_end_ns:
            last_tick = self._common.last_tick(progress.task_end_ns, failed=progress.task_failed)
            self._display.lasts_until(last_tick * self._common.tick_ns)
        if last:
            self._display.finish(progress.wall_time)
        self._display.show(progress.stamp_ns, progress.phase, progress.tool_error, last=last)

    def _death_report(self, dead: Sequence[Death]) -> str:
        """Return who died, how, what to do, and the last they said."""
        who = "; ".join(f"node {death.name!r} {death.how}" for death in dead)
        cut = any(death.name == RECORDER and death.code < 0 for death in dead)
        last = [death.last_lines for death in dead if death.last_lines]
        return who + (f"; {self._remedy}" if cut else "") + "".join(f":\n{lines}" for lines in last)

    @property
    def _remedy(self) -> str:
        """What to do about a bag that was not closed."""
        return f"'sms-handover bag recover {self._plan.bag}' makes a whole bag of what was written"
