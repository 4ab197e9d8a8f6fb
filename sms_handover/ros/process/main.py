"""The main program of a node: start, spin, orderly end, and one line of text for every error."""

import atexit
import faulthandler
import gc
import os
import signal
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence

import rclpy
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from sms_handover.errors import ConfigurationError, SmsHandoverError
from sms_handover.ros.process.launcher_process import (
    LAUNCHER_PID,
    launcher_of_this_process,
    wake_when_parent_ends,
)
from sms_handover.ros.process.launcher_watch import LauncherWatch
from sms_handover.ros.process.network_scope import apply_network_scope
from sms_handover.ros.process.node_parameters import in_any_namespace
from sms_handover.ros.process.realtime import stand_back
from sms_handover.ros.process.shared_memory_check import avoid_full_shared_memory
from sms_handover.terminal.streams import make_streams_safe

EXIT_OK, EXIT_FAILED, EXIT_USAGE = 0, 1, 2
EXIT_LOSS = 3  # the recorder: the bag is whole, but messages are missing in it
EXIT_STOPPED = 130  # the recorder: the bag is whole, but the run was not over when a signal came

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
WAIT_S = 0.2  # [s] longest wait for an event, so that a signal is noticed

_TEARDOWN_S = 15  # [s] of wall time for the middleware to shut down; less than a launcher waits
_STANDARD_ERROR = 2  # file descriptor, whatever stands in for the stream


class Stop:
    """A request to end: by a signal, or because the launcher that started this process has ended."""

    def __init__(self) -> None:
        """Install the handlers; a hang-up that is ignored, as under nohup(1), stays ignored."""
        self._signalled = False
        self._watch = None
        if (launcher := launcher_of_this_process()) is not None:
            wake_when_parent_ends()
            self._watch = LauncherWatch(launcher)
        for number in _SIGNALS:
            if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._on_signal)

    @property
    def asked(self) -> bool:
        """Whether this process is to end."""
        return self._signalled or (self._watch is not None and self._watch.launcher_has_ended)

    def _on_signal(self, number: int, frame: object) -> None:
        self._signalled = True


class RunnableNode(Node, ABC):
    """A node that can be run as a process."""

    @property
    def niceness(self) -> int:
        """The niceness of the process, as in nice(1); a node may override this."""
        return 0

    def start(self) -> None:
        """Prepare before the node is spun; raises SmsHandoverError. A node may override this."""

    def accompany(self, others: Sequence["RunnableNode"]) -> None:
        """Let the loop of this node serve other nodes of the same process too."""

    @abstractmethod
    def run(self, executor: Executor, stop: Stop) -> int:
        """Work until asked to stop; return the exit code."""


def run_node(
    make: Callable[[], RunnableNode], args: Sequence[str] | None = None, *, name: str = "node"
) -> int:
    """Run the node that ``make`` returns until a signal ends it; return the exit code.

    ``name`` precedes an error as long as there is no node. ``--help`` describes the node.
    """
    arguments = list(sys.argv if args is None else args)
    if {"-h", "--help"} & set(arguments[1:]):
        from sms_handover.ros.reference.help import show_help  # noqa: PLC0415  (loads what no node needs to run)

        show_help(name, make)
        return EXIT_OK
    return run_nodes([make], arguments, name=name)


def run_nodes(makes: Sequence[Callable[[], RunnableNode]], arguments: list[str], *, name: str) -> int:
    """Run nodes in this process and thread until a signal ends them; return the exit code.

    The loop is that of the first node. ``name`` precedes an error as long as there is no node. The executor
    is only used with a timeout: without one, EventsExecutor does not return in the wheels of rclpy 7.1.
    """
    make_streams_safe()
    stop = Stop()
    atexit.register(_leave)
    nodes: list[RunnableNode] = []
    executor = None
    try:
        _init(arguments)
        executor = EventsExecutor()
        for make in makes:
            nodes.append(make())
            nodes[-1].start()
            executor.add_node(nodes[-1])
        first, *others = nodes
        if others:
            first.accompany(others)
        else:
            name = first.get_name()
        stand_back(first.niceness)
        gc.collect()
        gc.freeze()  # objects made at the start live to the end; no collection needs to visit them again
        return first.run(executor, stop)
    except ConfigurationError as error:
        _print_error(name, error)
        return EXIT_USAGE
    except SmsHandoverError as error:
        _print_error(name, error)
        return EXIT_FAILED
    finally:
        _tear_down(nodes, executor)


def _tear_down(nodes: Sequence[RunnableNode], executor: Executor | None) -> None:
    """Shut the middleware down; if it hangs, write to the log where, and exit with 1.

    That is done by a thread of faulthandler's, which needs neither the interpreter nor any lock, so that
    not even a deadlock leaves a process behind.
    """
    faulthandler.dump_traceback_later(_TEARDOWN_S, exit=True, file=_STANDARD_ERROR)
    if executor is not None:
        executor.shutdown()  # it would keep the middleware alive after the last node
    for node in nodes:
        node.destroy_node()
    rclpy.try_shutdown()
    faulthandler.cancel_dump_traceback_later()


def _print_error(name: str, error: SmsHandoverError) -> None:
    print(f"{name}: error: {str(error).removeprefix(f'{name}: ')}", file=sys.stderr)


def _leave() -> None:
    """Keep the exit code while the interpreter exits, and make sure that it does.

    A second signal would otherwise kill the process, and the middleware, which is torn down after Python,
    can hang there: then SIGALRM ends the process.
    """
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    signal.alarm(_TEARDOWN_S)


def _init(args: list[str]) -> None:
    """Start ROS with the arguments of a command line; raises ConfigurationError if they are invalid."""
    before_ros = args[1 : args.index("--ros-args")] if "--ros-args" in args else args[1:]
    if before_ros:
        raise ConfigurationError(
            f"unknown argument {before_ros[0]!r}; give a parameter as --ros-args -p NAME:=VALUE, see --help"
        )
    avoid_full_shared_memory()
    scope = apply_network_scope()
    if scope.is_open and LAUNCHER_PID not in os.environ:  # else the launcher has said so
        print(f"this process is {scope}", file=sys.stderr)
    try:
        with in_any_namespace(args) as words:
            rclpy.init(args=words, signal_handler_options=SignalHandlerOptions.NO)
    except (rclpy_implementation.RCLError, rclpy_implementation.UnknownROSArgsError) as error:
        reason = str(error).split(", at /", 1)[0]  # the rest is a place in the sources of rcl
        raise ConfigurationError(" ".join(reason.split())) from error
