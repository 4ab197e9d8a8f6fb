"""Hosts on one machine: each with a network, shared memory and a name of its own, and a cable to a switch.

Namespaces of the kernel make them. They need the rights of root and leave nothing behind: a host ends
with the process that made it.
"""

import os
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from .cables import Cable, Switch

_NAMESPACES = ("--net", "--mount", "--uts", "--ipc")
_NETWORK = "10.77.0"  # of addresses that no other network here has
_BEGIN = (
    'mount -t tmpfs tmpfs /dev/shm && hostname "$0" && ip link set lo up && echo up && exec cat >/dev/null'
)


def why_not() -> str:
    """Return why hosts cannot be made here, "" if they can."""
    missing = [tool for tool in ("unshare", "nsenter", "ip") if shutil.which(tool) is None]
    if missing:
        return f"needs {' and '.join(missing)} (util-linux, iproute2)"
    if subprocess.run(["unshare", *_NAMESPACES, "true"], capture_output=True, check=False).returncode:
        return "needs the right to make network namespaces (root, CAP_SYS_ADMIN)"
    if not os.access("/dev/net/tun", os.R_OK | os.W_OK):
        return "needs /dev/net/tun"
    return ""


class Host:
    """One host; commands run on it by the prefix :attr:`enter`."""

    def __init__(self, name: str, address: str, cable: Cable) -> None:
        """Make the host, and give it the network device of a cable."""
        self.name, self.address, self.cable = name, address, cable
        self._holder = subprocess.Popen(
            ["unshare", *_NAMESPACES, "sh", "-c", _BEGIN, name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        assert self._holder.stdout is not None
        assert self._holder.stdout.readline() == b"up\n", f"{name} did not come up"
        pid = self._holder.pid
        self.enter = ("nsenter", f"--target={pid}", *_NAMESPACES, "--")
        _run("ip", "link", "set", cable.device, "netns", str(pid))
        self.run("ip", "addr", "add", f"{address}/24", "dev", cable.device)
        self.run("ip", "link", "set", cable.device, "up")

    def run(self, *command: str) -> str:
        """Run a command on this host and return what it printed."""
        return _run(*self.enter, *command)

    def command(self, cwd: Path, command: Sequence[str]) -> list[str]:
        """Return the command line that runs a command on this host in a folder."""
        return [*self.enter, "sh", "-c", 'cd "$0" && exec "$@"', str(cwd), *command]

    def close(self) -> None:
        """End the host; what still runs on it keeps running without a cable."""
        assert self._holder.stdin is not None
        self._holder.stdin.close()
        self._holder.wait()


class Network:
    """Some hosts on one switch."""

    def __init__(self, count: int, seed: int) -> None:
        """Make the hosts."""
        self.switch = Switch(seed)
        self.hosts = [
            Host(f"host{index}", f"{_NETWORK}.{index}", self.switch.plug()) for index in range(1, count + 1)
        ]

    def set(self, *hosts: Host, **fault: float | bool) -> None:
        """Make the cables of hosts (of all, if none is given) bad, or good again where no fault is given."""
        self.switch.set(*(host.cable for host in hosts or self.hosts), **fault)

    def close(self) -> None:
        """End every host."""
        for host in self.hosts:
            host.close()
        self.switch.close()


@contextmanager
def network(count: int, seed: int = 1) -> Iterator[Network]:
    """Make hosts on one switch, and end them."""
    made = Network(count, seed)
    try:
        yield made
    finally:
        made.close()


def _run(*command: str) -> str:
    """Run a command that must succeed; return what it printed."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{' '.join(command)}: {done.stderr}"
    return done.stdout
