"""The launcher: starts the graph, monitors the run to its end, and ends every process whatever happens."""

import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from math import inf
from pathlib import Path

import rclpy
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sms_handover_interfaces.msg import RunState

from sms_handover.configuration.scenario_file import COMMON
from sms_handover.errors import GraphError
from sms_handover.graph.topics import NODES, PLANT, RECORDER
from sms_handover.launcher.display import Display
from sms_handover.launcher.interrupts import Interrupts, let_go_of_closed_output
from sms_handover.launcher.lifecycle_driver import LifecycleDriver
from sms_handover.launcher.monitor import Progress, RunMonitor
from sms_handover.launcher.node_server import NodeServer
from sms_handover.launcher.processes import Death, NodeProcesses
from sms_handover.launcher.shared_memory import SharedMemory
from sms_handover.launcher.timeouts import ActiveTime, SuspensionMonitor, WaitNotice
from sms_handover.ros.launching.composition import ProcessArguments, nodes_together, process_arguments
from sms_handover.ros.node.node_inputs import INPUTS
from sms_handover.ros.process.main import EXIT_LOSS, EXIT_OK
from sms_handover.ros.process.network_scope import THIS_MACHINE, NetworkScope
from sms_handover.simulation.scenario import Scenario
from sms_handover.units import ns_to_seconds

_LOG_FOLDER = "ROS_LOG_DIR"  # environment variable that ROS reads
_POLL_S = 0.1  # [s] longest wait for a message before the processes are checked again
_START_POLL_S = 0.02  # [s] likewise, as long as nodes appear, which is no message
_START_TIMEOUT_S = 60.0  # [s] of wall time until the run must have begun
_HOSTS_TIMEOUT_S = 600.0  # [s] of wall time likewise, where somebody has to start nodes on other hosts
_BEGUN_TIMEOUT_S = 10.0  # [s] of wall time for the message that the run has begun, when it is interrupted
_STALL_TIMEOUT_S = 30.0  # [s] of wall time without progress of simulated time
_NEWS_TIMEOUT_S = 20.0  # [s] of wall time for the message that the run is over, once the recorder has ended
_SHUTDOWN_TIMEOUT_S = 3.0  # [s] of wall time for the nodes to end when they are shut down
_SHUTDOWN_POLL_S = 0.01  # [s] longest wait for an answer then
_DRAIN_TIMEOUT_S = 60.0  # [s] of wall time for the recorder to finish
_LEAVE_TIMEOUT_S = 60.0  # [s] of wall time for nodes of other hosts to end; more than the lease of DDS


@dataclass(frozen=True)
class LaunchPlan:
    """What to start and where its logs go; ``compose``: few processes.

    ``nodes`` are started here, ``elsewhere`` on other hosts by somebody else; ``bag`` is where the
    recorder writes, None if it is not among ``nodes``. ``controller`` is the command line of an external
    controller; empty if the user starts it, or if it is ours. Every process keeps the ``inherited`` file
    descriptors open, so that what they lock is free after the last process. A ``server`` forks our nodes.
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
    scope: NetworkScope = THIS_MACHINE
    server: NodeServer | None = None

    @property
    def external(self) -> frozenset[str]:
        """The nodes that are not ours."""
        return frozenset(self.scenario.parameters.common.external)

    @property
    def own_nodes(self) -> tuple[str, ...]:
        """The nodes here that are ours, which the launcher takes through their lifecycle."""
        return tuple(name for name in self.nodes if name not in self.external)


@dataclass(frozen=True)
class Outcome:
    """How a run ended: its last progress, and what the recorder said about the bag."""

    progress: Progress
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
    common = plan.scenario.parameters.common
    end_ns = common.last_tick(plan.scenario.end_ns) * common.tick_ns
    with joined_graph(plan, "launcher") as (node, executor), ExitStack() as stack:
        inputs = INPUTS[common.transport](node)
        stack.callback(inputs.destroy)
        monitor = RunMonitor(node, plan.scenario.model.robot.arms, inputs)
        processes = stack.enter_context(
            NodeProcesses(plan.log_folder, graph_environment(plan), plan.inherited, plan.server)
        )
        driver = LifecycleDriver(node, plan.own_nodes)
        if plan.server is not None:
            plan.server.wait_until_ready(interrupts.heed)
        for name, arguments in arguments_of(plan).items():
            if name not in plan.external:
                processes.start(name, arguments.line)
            elif plan.controller:
                named = ("--remap", f"__node:={name}")
                processes.start(name, (*arguments.line, *named), plan.controller)
        display = stack.enter_context(Display(end_ns))
        return _Run(plan, monitor, driver, executor, processes, display, interrupts, memory).to_the_end()


@contextmanager
def joined_graph(plan: LaunchPlan, name: str) -> Iterator[tuple[Node, Executor]]:
    """Yield a node of this process in the graph, and its executor; raises GraphError if ROS cannot start."""
    os.environ.setdefault(_LOG_FOLDER, str(plan.log_folder / "ros"))  # its default needs a HOME
    os.environ.update(plan.scope.environment)
    try:
        rclpy.init(args=[], domain_id=plan.domain, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # such as no thread or no memory left
        raise GraphError(f"ROS cannot be started: {error}") from error
    node = Node(name, start_parameter_services=False, enable_rosout=False)
    executor = EventsExecutor()
    try:
        executor.add_node(node)
        yield node, executor
    finally:
        executor.shutdown()  # it would keep the middleware alive after the node
        node.destroy_node()
        rclpy.try_shutdown()


def graph_environment(plan: LaunchPlan) -> dict[str, str]:
    """Return the environment variables that keep the graph to itself."""
    return {
        **plan.scope.environment,
        "ROS_DOMAIN_ID": str(plan.domain),
        _LOG_FOLDER: str(plan.log_folder / "ros"),
        "OPENBLAS_NUM_THREADS": "1",  # matrices of 14 columns gain nothing from threads
        "PYTHONUNBUFFERED": "1",
    }


def arguments_of(plan: LaunchPlan) -> Mapping[str, ProcessArguments]:
    """Return what every process here is to be started with."""
    own = {name: dict(values) for name, values in plan.scenario.overrides.items()}
    for name in plan.own_nodes:
        own.setdefault(name, {})["autostart"] = False
    if plan.bag:
        own.setdefault(RECORDER, {})["folder"] = str(plan.bag)
    files = [str(path) for path in plan.parameter_files]
    together = nodes_together(plan.scenario.parameters.common.mode) if plan.compose else ()
    common = own.get(COMMON, {})
    record = RECORDER in {*plan.nodes, *plan.elsewhere}
    return process_arguments(common, own, files, record=record, together=together, here=plan.nodes)


@dataclass
class _Run:
    """One run from start to end."""

    plan: LaunchPlan
    monitor: RunMonitor
    driver: LifecycleDriver
    executor: Executor
    processes: NodeProcesses
    display: Display
    interrupts: Interrupts
    memory: SharedMemory
    time: ActiveTime = field(default_factory=ActiveTime)
    suspended: SuspensionMonitor = field(default_factory=SuspensionMonitor)
    recorder_ended: float = inf  # [s] of active time

    def to_the_end(self) -> Outcome:
        """Return how the run ended; raises GraphError if a node died or nothing went on.

        Raises KeyboardInterrupt on an interrupt before the run has begun, and on a second one.
        """
        self._wait_for_start()
        code = None
        while code is None:  # the run may be reset at any moment, also at its end
            self._wait_for_end()
            self._wait_for_events()
            code = self._wait_for_recorder() if self.plan.bag else EXIT_OK
        self._wait_for_other_hosts()
        self._shut_down()
        self._show(last=True)
        said = self.processes.text_of(RECORDER) if self.plan.bag else ""
        return Outcome(self.monitor.progress, code, said, self.interrupts.asked)

    def _wait_for_start(self) -> None:
        """Wait until every endpoint has matched and the plant has begun."""
        by_hand = bool(self.plan.external) and not self.plan.controller
        timeout_s = _HOSTS_TIMEOUT_S if self.plan.elsewhere else _START_TIMEOUT_S
        deadline = inf if by_hand else self.time.seconds + timeout_s
        interrupted = inf
        asked = False
        notice = WaitNotice()
        while self.monitor.progress.state == RunState.WAITING:
            self.driver.poll()
            self._poll(_START_POLL_S)
            self.memory.note((os.getpid(), *self.processes.ids.values()))
            if self.interrupts.asked:
                if self.interrupts.at_once or not self.driver.active:
                    raise KeyboardInterrupt
                interrupted = min(interrupted, self.time.seconds)
                asked = asked or self.monitor.ask_to_finish()  # it may run, and only the message be late
                if self.time.seconds - interrupted > _BEGUN_TIMEOUT_S:
                    raise KeyboardInterrupt
            why = self.driver.waiting_for or self.monitor.waiting_for()
            if self.time.seconds > deadline:
                raise GraphError(f"the run has not begun after {timeout_s:g} s: {why}")
            self.display.print(*notice.poll(self.time.seconds, why))
        self.display.start(self.monitor.progress.stamp_ns)

    def _wait_for_end(self) -> None:
        seen_ns, since = -1, self.time.seconds
        asked = False
        while not self.monitor.finished:
            self._poll()
            self._show()
            if self.interrupts.at_once:
                raise KeyboardInterrupt
            if self.interrupts.asked and not asked:
                asked = self.monitor.ask_to_finish()
            now_ns = self.monitor.progress.stamp_ns
            if now_ns != seen_ns or self.monitor.progress.state == RunState.PAUSED:
                seen_ns, since = now_ns, self.time.seconds
            elif self.time.seconds - since > _STALL_TIMEOUT_S:
                raise GraphError(
                    f"no progress for {_STALL_TIMEOUT_S:g} s at {ns_to_seconds(now_ns):g} s of simulated "
                    f"time: {self.monitor.waiting_for()}"
                )

    def _wait_for_events(self) -> None:
        """Wait for the events, which may arrive after the message of the end."""
        deadline = self.time.seconds + _NEWS_TIMEOUT_S
        while (
            not self.monitor.has_every_event and not self.interrupts.at_once and self.time.seconds < deadline
        ):
            self._poll()

    def _wait_for_recorder(self) -> int | None:
        """Wait until the recorder has everything and has closed the bag; return its exit code.

        Returns None if a new run begins instead.
        """
        deadline = self.time.seconds + _DRAIN_TIMEOUT_S
        while True:
            if not self.monitor.finished:
                return None
            code = self.processes.exit_code(RECORDER)
            if code is not None:
                return code
            self._poll()
            if self.interrupts.at_once:
                raise KeyboardInterrupt
            if self.time.seconds > deadline:
                raise GraphError(f"the recorder has not closed the bag; {self._remedy}")

    def _wait_for_other_hosts(self) -> None:
        """Wait until no node on another host needs those here; raises GraphError if the recorder stays.

        All nodes stay until the recorder has everything; the plant, which reports the end, ends last.
        """
        if RECORDER in self.plan.elsewhere and not self._have_left((RECORDER,)):
            raise GraphError("the recorder, on another host, has not ended; look at its bag there")
        if PLANT in self.plan.nodes:
            self._have_left(self.plan.elsewhere)

    def _have_left(self, names: Collection[str]) -> bool:
        deadline = self.time.seconds + _LEAVE_TIMEOUT_S
        while self.monitor.present(names):
            if not self.monitor.finished:  # the run has been reset
                deadline = self.time.seconds + _LEAVE_TIMEOUT_S
            if self.time.seconds > deadline or self.interrupts.at_once:
                return False
            self._poll()
        return True

    def _shut_down(self) -> None:
        """Shut every node down; what does not end then is ended as a process."""
        self.driver.shut_down()
        deadline = self.time.seconds + _SHUTDOWN_TIMEOUT_S
        while len(self.processes.dead()) < len(self.processes.ids) and self.time.seconds < deadline:
            self.executor.spin_once(timeout_sec=_SHUTDOWN_POLL_S)
            self.time.update()

    def _poll(self, longest_s: float = _POLL_S) -> None:
        """Handle what has arrived, and raise GraphError if a node has died."""
        self.executor.spin_once(timeout_sec=longest_s)
        self.monitor.poll()
        self.time.update()
        let_go_of_closed_output()
        self.display.print(*self.interrupts.poll())
        self.display.print(*self.suspended.poll(self.processes.suspended(), self.time.seconds))
        if dead := [death for death in self.processes.dead() if not self._recorder_is_done(death)]:
            raise GraphError(self._death_report(dead))

    def _recorder_is_done(self, death: Death) -> bool:
        """Whether a process that ended is the recorder at the end of the run.

        The recorder may close the bag and end before the launcher has the message of the end.
        """
        if death.name != RECORDER or death.code not in (EXIT_OK, EXIT_LOSS):
            return False
        self.recorder_ended = min(self.recorder_ended, self.time.seconds)
        return self.monitor.finished or self.time.seconds - self.recorder_ended < _NEWS_TIMEOUT_S

    def _show(self, *, last: bool = False) -> None:
        progress, common = self.monitor.progress, self.plan.scenario.parameters.common
        while progress.unseen:
            self.display.print_event(progress.unseen.pop(0))
        if progress.task_end_ns:
            last_tick = common.last_tick(progress.task_end_ns, failed=progress.task_failed)
            self.display.lasts_until(last_tick * common.tick_ns)
        if last:
            self.display.finish(progress.wall_time)
        self.display.show_run(progress.stamp_ns, progress.phase, progress.tool_error, last=last)

    def _death_report(self, dead: Sequence[Death]) -> str:
        """Return who died, how, what to do, and the end of the logs."""
        who = "; ".join(f"node {death.name!r} {death.how}" for death in dead)
        cut = any(death.name == RECORDER and death.code < 0 for death in dead)
        last = [death.last_lines for death in dead if death.last_lines]
        return who + (f"; {self._remedy}" if cut else "") + "".join(f":\n{lines}" for lines in last)

    @property
    def _remedy(self) -> str:
        return f"'sms-handover bag recover {self.plan.bag}' makes a whole bag of what was written"
