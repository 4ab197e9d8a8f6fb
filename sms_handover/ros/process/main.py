"""Runs one node as a process: start, spin, orderly end, and one line of text for every error."""

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
from sms_handover.ros.process.shared_memory_check import avoid_full_shared_memory
from sms_handover.terminal.streams import make_streams_safe

EXIT_OK, EXIT_FAILED, EXIT_USAGE = 0, 1, 2
EXIT_LOSS = 3  # the recorder: the bag is whole, but messages are missing in it
EXIT_STOPPED = 130  # the recorder: the bag is whole, but the run was not over when a signal came

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
WAIT_S = 0.2  # [s] longest wait for an event, so that a signal is noticed

_TEARDOWN_S = 15  # [s] of wall time for the middleware to let go; less than a launcher waits
_STANDARD_ERROR = 2  # file descriptor, whatever stands in for the stream


class Stop:
    """Asked for by a signal that ends things, and when the launcher that started this process is gone."""

    def __init__(self) -> None:
        """Install the handlers; a hang-up that is ignored, as under nohup(1), stays ignored."""
        self._signalled = False
        self._watch = None
        if launcher := launcher_of_this_process():
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
        """Return how far the process stands back behind others, as in nice(1); a node may override this."""
        return 0

    def start(self) -> None:
        """Do what is due before the node is spun; raises SmsHandoverError. A node may override this."""

    def accompany(self, others: Sequence["RunnableNode"]) -> None:
        """Let the loop of this node serve other nodes of the same process too."""

    @abstractmethod
    def run(self, executor: Executor, stop: Stop) -> int:
        """Work until asked to stop; return the exit code."""


def run_node(
    make: Callable[[], RunnableNode], args: Sequence[str] | None = None, *, name: str = "node"
) -> int:
    """Run the node that ``make`` returns until a signal ends it; return the exit code.

    ``name`` stands before an error as long as there is no node. ``--help`` tells what the node is for.
    """
    arguments = list(sys.argv if args is None else args)
    if {"-h", "--help"} & set(arguments[1:]):
        from sms_handover.ros.reference.help import show_help  # noqa: PLC0415  (loads what no node needs to run)

        show_help(name, make)
        return EXIT_OK
    return run_nodes([make], arguments, name=name)


def run_nodes(makes: Sequence[Callable[[], RunnableNode]], arguments: list[str], *, name: str) -> int:
    """Run nodes in this process and thread until a signal ends them; return the exit code.

    The loop is that of the first node. ``name`` stands before an error as long as there is no node.

    The executor is only ever used with a timeout: without one, EventsExecutor does not return in
    the wheels of rclpy 7.1.
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
        os.nice(first.niceness)
        gc.collect()
        gc.freeze()  # what start-up has made lives to the end; no collection needs to look at it again
        return first.run(executor, stop)
    except ConfigurationError as error:
        _tell(name, error)
        return EXIT_USAGE
    except SmsHandoverError as error:
        _tell(name, error)
        return EXIT_FAILED
    finally:
        _tear_down(nodes, executor)


def _tear_down(nodes: Sequence[RunnableNode], executor: Executor | None) -> None:
    """Let go of the middleware; if it hangs, write to the log where, and exit with 1.

    The watch is a thread of faulthandler's, which needs neither the interpreter nor any lock, so that
    not even a deadlock leaves a process behind when the launcher is gone.
    """
    faulthandler.dump_traceback_later(_TEARDOWN_S, exit=True, file=_STANDARD_ERROR)
    if executor is not None:
        executor.shutdown()  # it would keep the middleware up behind the last node
    for node in nodes:
        node.destroy_node()
    rclpy.try_shutdown()
    faulthandler.cancel_dump_traceback_later()


def _tell(name: str, error: SmsHandoverError) -> None:
    """Print an error in one line that begins with the name of the node, once."""
    print(f"{name}: error: {str(error).removeprefix(f'{name}: ')}", file=sys.stderr)


def _leave() -> None:
    """Keep the exit code and come to an end: what the interpreter calls last.

    A second signal while the interpreter ends would otherwise kill the process, and the middleware,
    which takes down the rest of itself after Python, can hang there: then SIGALRM ends the process.
    """
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    signal.alarm(_TEARDOWN_S)


def _init(args: list[str]) -> None:
    """Start ROS with the arguments of a command line; raises ConfigurationError where it cannot read them."""
    before_ros = args[1 : args.index("--ros-args")] if "--ros-args" in args else args[1:]
    if before_ros:
        raise ConfigurationError(
            f"unknown argument {before_ros[0]!r}; give a parameter as --ros-args -p NAME:=VALUE, see --help"
        )
    avoid_full_shared_memory()
    reach = apply_network_scope()
    if reach.is_open and LAUNCHER_PID not in os.environ:  # else the launcher has said so
        print(f"this process is {reach}", file=sys.stderr)
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except (rclpy_implementation.RCLError, rclpy_implementation.UnknownROSArgsError) as error:
        reason = str(error).split(", at /", 1)[0]  # the rest tells where in the sources of rcl
        raise ConfigurationError(" ".join(reason.split())) from error
