"""Node server: imports once what every node needs, and forks a process per node.

The imports of a node take most of its start, and five nodes on two processors wait for each other's. The
server starts while the launcher itself is still importing, has no ROS context, and forks before a node makes
one. A node that it has forked is a child of the launcher, in a session of its own, with arguments,
environment and log as if it had been started by itself. Where the system cannot do that there is no server.

As a program, ``python -m sms_handover.launcher.node_server FD ROOM``, it is the server; FD is its end of a
socket, and ROOM fills the command line, so that there is room for that of a node.
"""

import ctypes
import gc
import json
import os
import select
import socket
import subprocess
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path

from sms_handover.errors import GraphError
from sms_handover.graph.topics import CONTAINER, NODES, SENSOR_TYPES, graph_topics
from sms_handover.launcher.timeouts import ActiveTime
from sms_handover.ros.process.launcher_process import launcher_environment

MODULE = "sms_handover.launcher.node_server"
NODE_MODULES = "sms_handover.nodes"

_PR_SET_CHILD_SUBREAPER = 36  # of prctl(2)
_ROOM = 4096  # characters of a command line
_LARGEST = 2**20  # [byte] of a request
_MOST_DESCRIPTORS = 64
_READY = b"ready"  # what the server sends once it can fork
_IMPORT_TIMEOUT_S = 60.0  # [s] of wall time for that
_POLL_S = 0.02  # [s] between two looks meanwhile at what else there is
_ANSWER_TIMEOUT_S = 20.0  # [s] of wall time for a fork, a millisecond's work
_ARGUMENTS_AT = 46  # field of /proc/PID/stat behind the name in which the address of the arguments stands


class NodeServer:
    """The server as its launcher has it; a context manager around everything that it starts."""

    def __init__(self) -> None:
        """Start it, if this system can have one; it is busy with its imports for a moment."""
        self._channel: socket.socket | None = None
        self._ready = False
        if not _adopts_orphans(True):
            return
        self._channel, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                (sys.executable, "-P", "-m", MODULE, str(theirs.fileno()), " " * _ROOM),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env={**os.environ, **launcher_environment(), **SERVED_ENVIRONMENT},
                start_new_session=True,
                pass_fds=[theirs.fileno()],
            )

    def __enter__(self) -> "NodeServer":
        return self

    def __exit__(self, *error: object) -> None:
        """End the server; the nodes stay."""
        if self._channel is not None:
            self._channel.close()
            self._process.kill()  # it may be importing still, or suspended: then another signal would wait
            self._process.wait()
            _adopts_orphans(False)

    def start(
        self, node: str, arguments: Sequence[str], environment: Mapping[str, str], descriptors: Sequence[int]
    ) -> "ForkedProcess | None":
        """Return the process of a node or of the container, None if there is no server to fork it.

        The first of the ``descriptors`` takes what it prints, the others are kept open. Raises GraphError if
        the server does not answer: it may have forked a node that nobody would know of.
        """
        if self._channel is None:
            return None
        self.wait_until_ready()
        request = {"node": node, "arguments": list(arguments), "environment": dict(environment)}
        try:
            socket.send_fds(self._channel, [json.dumps(request).encode()], descriptors)
            answer = self._channel.recv(_LARGEST)
        except TimeoutError as error:
            text = f"the node server has not started {node!r} within {_ANSWER_TIMEOUT_S:g} s (suspended?)"
            raise GraphError(text) from error
        except OSError:
            return None
        return ForkedProcess(int(answer)) if answer else None

    def wait_until_ready(self, meanwhile: Callable[[], None] = lambda: None) -> None:
        """Wait until the server has imported what it forks, or has ended: :meth:`start` then answers at once.

        Calls ``meanwhile`` again and again; raises GraphError after a minute.
        """
        time = ActiveTime()
        while self._channel is not None and not self._ready:
            if select.select([self._channel], [], [], _POLL_S)[0]:
                self._channel.settimeout(_ANSWER_TIMEOUT_S)
                with suppress(OSError):  # it has ended, which is noticed by the first request
                    self._channel.recv(_LARGEST)
                self._ready = True
            time.update()
            if time.seconds > _IMPORT_TIMEOUT_S:
                raise GraphError(
                    f"the node server has not imported its modules within {_IMPORT_TIMEOUT_S:g} s"
                )
            meanwhile()


SERVED_ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}  # what counts while modules load


class ForkedProcess:
    """A child of this process that another one has forked, with what is used of ``subprocess.Popen``."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Return the exit code if it has ended, else None."""
        return self._reap(os.WNOHANG)

    def wait(self) -> int | None:
        """Wait for its end and return the exit code."""
        return self._reap(0)

    def _reap(self, flags: int) -> int | None:
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, flags)
            if pid:
                self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode


def _adopts_orphans(wanted: bool) -> bool:
    """Let this process be the parent of what its children leave behind; return whether that can be."""
    libc = ctypes.CDLL(None, use_errno=True)
    can = sys.version_info >= (3, 11) and Path("/proc/self/stat").exists() and hasattr(libc, "prctl")
    return can and libc.prctl(_PR_SET_CHILD_SUBREAPER, int(wanted), 0, 0, 0) == 0


def serve(channel: socket.socket) -> int:
    """Fork a process per request until the launcher has closed the channel; return the exit code.

    In a process of a node this returns too, when the node has ended.
    """
    gc.disable()  # nearly all that an import makes stays: to look for what does not takes a fifth of the time
    warnings.simplefilter(
        "ignore", DeprecationWarning
    )  # of forking beside threads: those of LTTng, which rest
    mains = {node: import_module(f"{NODE_MODULES}.{node}").main for node in (*NODES, CONTAINER)}
    message_class = import_module("sms_handover.ros.message_types").message_class
    for topic in graph_topics((), clearance=True, sensors=SENSOR_TYPES):
        message_class(topic.type).__class__.__import_type_support__()
    import_module("sms_handover.messages.message_types").MessageTypes()  # the definitions of rosbags
    gc.freeze()
    channel.send(_READY)
    while True:
        data, descriptors, _, _ = socket.recv_fds(channel, _LARGEST, _MOST_DESCRIPTORS)
        if not data:
            return 0
        request = json.loads(data)
        between, to_server = os.pipe()
        child = os.fork()
        if not child:
            if node := os.fork():
                os.write(to_server, b"%d" % node)
                os._exit(0)
            for descriptor in (between, to_server):
                os.close(descriptor)
            channel.close()
            _become(request, descriptors)
            return int(mains[request["node"]]())
        os.close(to_server)  # so that a child that could not fork is read as nothing
        os.waitpid(child, 0)  # from here on the node is a child of the launcher
        channel.send(os.read(between, _LARGEST))
        for descriptor in (between, *descriptors):
            os.close(descriptor)


def _become(request: Mapping[str, object], descriptors: Sequence[int]) -> None:
    """Give this process what a node has that was started by itself."""
    gc.enable()
    os.setsid()
    log, *kept = descriptors
    for stream in (1, 2):
        os.dup2(log, stream)
    os.close(log)
    for descriptor in kept:
        os.set_inheritable(descriptor, True)
    node, arguments, environment = request["node"], request["arguments"], request["environment"]
    assert isinstance(arguments, list) and isinstance(environment, dict)
    os.environ.clear()
    os.environ.update(environment)
    module = f"{NODE_MODULES}.{node}"
    sys.argv = [str(sys.modules[module].__file__), *arguments]
    _show_command([sys.executable, "-P", "-m", module, *arguments])


def _show_command(words: Sequence[str]) -> None:
    """Let ps(1) and the like show this command line, as far as there is room."""
    fields = Path("/proc/self/stat").read_bytes().rpartition(b")")[2].split()
    begin, end = map(int, fields[_ARGUMENTS_AT - 1 : _ARGUMENTS_AT + 1])
    room = end - begin
    text = "".join(f"{word}\0" for word in words).encode()[: room - 1]
    ctypes.memmove(begin, text.ljust(room, b"\0"), room)


if __name__ == "__main__":
    raise SystemExit(serve(socket.socket(fileno=int(sys.argv[1]))))
