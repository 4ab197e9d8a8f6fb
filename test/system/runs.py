"""The command line as a user runs it, and the processes that it starts."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from select import select
from time import monotonic

from sms_handover.ros.process.launcher_process import LAUNCHER_PID

from .hosts import Host

DEADLINE_S = 180.0  # s of wall time after which something that hangs has failed; nothing is measured by it

_LOOK_S = 0.02  # s of wall time between two looks at a condition
_NODES, _SOLVER = "sms_handover.nodes.", "sms_handover.simulation.solver_"


@dataclass(frozen=True)
class Ended:
    """A command that has ended."""

    code: int
    out: str
    err: str

    @property
    def errors(self) -> list[str]:
        """Return the lines of standard error that tell an error."""
        return [line for line in self.err.splitlines() if "error:" in line]


def command_of(arguments: Sequence[object], *, dry_run: bool = False) -> list[str]:
    """Return the command line of ``sms-handover`` with arguments, by default without a dry run."""
    words = [str(word) for word in arguments]
    if words[:1] == ["run"] and not dry_run:
        words.insert(1, "--no-dry-run")
    return [sys.executable, "-m", "sms_handover.cli.main", *words]


def sms_handover(*arguments: object, cwd: Path, dry_run: bool = False) -> Ended:
    """Carry out a command to its end."""
    command = command_of(arguments, dry_run=dry_run)
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
    return Ended(done.returncode, done.stdout, done.stderr)


class Running:
    """A command that runs, and the nodes that it has started."""

    def __init__(self, process: "subprocess.Popen[str]", log: Path) -> None:
        """Take a process whose output goes to a file."""
        self.process = process
        self._log = log
        self._seen: dict[str, int] = {}

    @property
    def pid(self) -> int:
        """Return the process id."""
        return self.process.pid

    @property
    def text(self) -> str:
        """Return what it has printed so far."""
        return self._log.read_text(encoding="utf-8")

    @property
    def nodes(self) -> dict[str, int]:
        """Return the process ids of its nodes, by name; those that have ended stay."""
        self._seen.update(nodes_of(self.pid))
        return self._seen

    def send(self, number: signal.Signals) -> None:
        """Send a signal to the command alone."""
        self.process.send_signal(number)

    def until(self, condition: Callable[[], object], what: str) -> None:
        """Wait until a condition holds; fail if the command ends before that."""
        deadline = monotonic() + DEADLINE_S
        while not condition():
            try:
                code = self.process.wait(_LOOK_S)
            except subprocess.TimeoutExpired:
                code = None
            assert code is None, f"ended with {code} before {what}:\n{self.text}"
            assert monotonic() < deadline, f"waited in vain for {what}:\n{self.text}"

    def until_all_nodes(self, names: Sequence[str]) -> None:
        """Wait until every node has been started."""
        self.until(lambda: set(names) <= set(self.nodes), "its nodes")

    def until_recorded(self, bag: Path, size: int) -> None:
        """Wait until so many bytes have been written: the run is under way."""
        file = bag / f"{bag.name}_0.mcap"
        self.until(lambda: file.is_file() and file.stat().st_size > size, f"{size} bytes of the bag")
        assert self.nodes

    def end(self) -> int:
        """Wait for the end and return the exit code."""
        return self.process.wait(DEADLINE_S)

    def wait_for_nodes(self) -> None:
        """Wait until every node that was there has ended."""
        for name, pid in self.nodes.items():
            assert not is_node(pid) or has_ended(pid, DEADLINE_S), f"{name} is still there"


def has_ended(pid: int, patience_s: float) -> bool:
    """Wait for the end of a process that need not be a child; tell whether it has come."""
    try:
        handle = os.pidfd_open(pid)
    except ProcessLookupError:
        return True
    try:
        return bool(select([handle], [], [], patience_s)[0])
    finally:
        os.close(handle)


@contextmanager
def running(*arguments: object, cwd: Path, module: str = "", on: Host | None = None) -> Iterator[Running]:
    """Start a command, or the ``module`` of a node, and see to it that nothing of it is left at the end.

    It is started ``on`` a host of its own network, else on this machine.
    """
    log = cwd / f"printed_{len(list(cwd.glob('printed_*')))}"
    command = [sys.executable, "-m", module, *map(str, arguments)] if module else command_of(arguments)
    if on is not None:
        command = on.command(cwd, command)
    with log.open("w", encoding="utf-8") as stream:
        process = subprocess.Popen(command, cwd=cwd, stdout=stream, stderr=subprocess.STDOUT, text=True)
    run = Running(process, log)
    try:
        yield run
    finally:
        if process.poll() is None:
            process.kill()
        process.wait()
        for pid in run.nodes.values():
            if is_node(pid):
                os.kill(pid, signal.SIGKILL)
        run.wait_for_nodes()


@contextmanager
def busy_cores() -> Iterator[None]:
    """Keep every core of this machine busy."""
    loop = [sys.executable, "-c", "while True: pass"]
    loops = [subprocess.Popen(loop) for _ in range(os.cpu_count() or 1)]
    try:
        yield
    finally:
        for process in loops:
            process.kill()
            process.wait()


def nodes_of(launcher: int, prefix: str = _NODES) -> dict[str, int]:
    """Return the process ids of the nodes that a launcher has started, by name.

    With another ``prefix`` those of other modules of ours.
    """
    wanted = f"{LAUNCHER_PID}={launcher}".encode()
    found = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdecimal():
            try:
                environment = (folder / "environ").read_bytes().split(b"\0")
            except OSError:
                continue
            name = node_name(int(folder.name), prefix)
            if wanted in environment and name:
                found[name] = int(folder.name)
    return found


def solvers_of(launcher: int) -> list[int]:
    """Return the process ids of the solvers that nodes of a launcher have started."""
    return list(nodes_of(launcher, _SOLVER).values())


def is_node(pid: int) -> bool:
    """Whether a process is there and one of our nodes; one that has ended but is not reaped is not."""
    return bool(node_name(pid))


def node_name(pid: int, prefix: str = _NODES) -> str:
    """Return the name of the node that a process is, or ''; with another ``prefix`` that of a module."""
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return ""
    names = [word.removeprefix(prefix) for word in words if word.startswith(prefix)]
    return names[0] if names else ""
