"""How much of a run is lost if its recorder is killed (SIGKILL) at a random moment.

A separate witness subscribes to the states that the plant publishes. The recorder is killed, the bag is
recovered, and the latest state in it is compared with the latest that had been published when the recorder
had exited.
"""

import os
import random
import signal
import subprocess
import sys
import tempfile
from argparse import ArgumentParser
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from select import select
from time import monotonic, sleep, time_ns

import rclpy
from rclpy.context import Context
from rclpy.node import Node

from benchmarks.results import FOLDER, Result, Table, publish
from sms_handover.bag.ledger import TopicLedger
from sms_handover.bag.repair.recover import recover
from sms_handover.bag.repair.recovery import Recovery
from sms_handover.bag.run.reader import read_run
from sms_handover.errors import BagError
from sms_handover.graph.topics import BASE_ODOMETRY, JOINT_STATES
from sms_handover.messages.stamps import stamp_ns
from sms_handover.ros.message_types import message_class
from sms_handover.ros.process.launcher_process import LAUNCHER_PID
from sms_handover.ros.qos import LOSSLESS
from sms_handover.ros.transport.direct import DirectInputs
from sms_handover.units import NS_PER_S

_NS_PER_MS = 1e6
_LATEST_S = 3.0  # [s] of simulated time before which the recorder is killed
_JITTER_S = 0.03  # [s] of wall time added, so that the kill falls anywhere between two flushes
_PATIENCE_S = 120.0  # [s] of wall time for anything to happen
_ON_THE_WAY_S = 0.5  # [s] of wall time in which the witness hears the last of what was sent
_POLL_S = 0.005  # [s] of wall time
_DOMAIN = "running on ROS domain "
_STATES = f"/{JOINT_STATES}"


@dataclass(frozen=True)
class Kill:
    """One kill: what had been published, what the recovered bag holds, both as stamps in ns."""

    published_ns: int
    recovered_ns: int
    opened_at_once: bool
    opened: bool
    missing: int
    lost_bytes: int

    @property
    def loss_ms(self) -> float:
        """Return how far the bag is behind."""
        return (self.published_ns - self.recovered_ns) / _NS_PER_MS


class Witness:
    """Hears the states of a running graph, with when each was sent."""

    def __init__(self, domain: int) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = Node("witness", context=self._context, start_parameter_services=False)
        kind = message_class("sensor_msgs/msg/JointState")
        self._inputs = DirectInputs(self._node)
        self._inputs.subscribe(kind, _STATES, LOSSLESS, self._take)
        self._heard: list[tuple[int, int]] = []  # [ns] sent on the wall clock, stamp

    def _take(self, data: bytes, sent_ns: int, publisher: bytes) -> None:
        """Note one state."""
        self._heard.append((sent_ns, stamp_ns(data)))

    def newest_ns(self, before_ns: int | None = None) -> int:
        """Return the newest stamp heard, of those sent before a wall time; -1 if there is none."""
        self._inputs.poll()
        return max(
            (stamp for sent, stamp in self._heard if before_ns is None or sent <= before_ns), default=-1
        )

    def close(self) -> None:
        """Leave the domain."""
        self._inputs.destroy()
        self._node.destroy_node()  # type: ignore[no-untyped-call]
        rclpy.shutdown(context=self._context)


def kill_recorder(folder: Path, moment_s: float, jitter_s: float) -> Kill:
    """Run the graph, kill its recorder after a simulated time, and recover the bag."""
    command = [sys.executable, "-m", "sms_handover.cli.main", "run", "-o", str(folder / "run")]
    command += ["--no-dry-run"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        witness = Witness(_domain_of(process))
        try:
            _until(lambda: witness.newest_ns() >= moment_s * NS_PER_S, process)
            sleep(jitter_s)
            dead_ns = _kill(_recorder_of(process.pid))
            sleep(_ON_THE_WAY_S)
            published_ns = witness.newest_ns(before_ns=dead_ns)
        finally:
            witness.close()
    finally:
        if process.poll() is None:
            process.terminate()
        process.communicate()
    bag = folder / "run" / "bag"
    result = recover(bag, folder / "recovered")
    states = [account for account in _ledger(result) if account.name in (_STATES, f"/{BASE_ODOMETRY}")]
    return Kill(
        published_ns=published_ns,
        recovered_ns=min(-1 if account.last_ns is None else account.last_ns for account in states),
        opened_at_once=_opens(bag),
        opened=_opens(folder / "recovered"),
        missing=sum(account.missing for account in states),
        lost_bytes=result.lost_bytes,
    )


def _ledger(result: Recovery) -> tuple[TopicLedger, ...]:
    """Return the accounts of a recovered bag."""
    return () if result.ledger is None else result.ledger.topics


def _opens(bag: Path) -> bool:
    """Whether a bag can be read as a run."""
    try:
        read_run(bag)
    except BagError:
        return False
    return True


def _domain_of(process: "subprocess.Popen[str]") -> int:
    """Return the domain that a run says it is on."""
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith(_DOMAIN):
            return int(line.removeprefix(_DOMAIN).split(",")[0])
    raise SystemExit("the run ended before it began")


def _recorder_of(launcher: int) -> int:
    """Return the process id of the recorder that a launcher has started."""
    mine = f"{LAUNCHER_PID}={launcher}".encode()
    for folder in Path("/proc").iterdir():
        if folder.name.isdecimal():
            try:
                words = (folder / "cmdline").read_bytes().split(b"\0")
                if b"sms_handover.nodes.recorder" in words and mine in (folder / "environ").read_bytes():
                    return int(folder.name)
            except OSError:
                continue
    raise SystemExit("the run has no recorder")


def _kill(pid: int) -> int:
    """Kill a process; return the wall time in ns at which it was dead for sure."""
    handle = os.pidfd_open(pid)
    try:
        os.kill(pid, signal.SIGKILL)
        select([handle], [], [], _PATIENCE_S)
        return time_ns()
    finally:
        os.close(handle)


def _until(condition: Callable[[], bool], process: "subprocess.Popen[str]") -> None:
    """Wait until a condition holds of a running process."""
    deadline = monotonic() + _PATIENCE_S
    while not condition():
        if monotonic() > deadline or process.poll() is not None:
            raise SystemExit("the run did not come to the moment of the kill")
        sleep(_POLL_S)


def main() -> int:
    """Kill recorders; the exit code is 1 if more was lost than allowed or a bag did not open."""
    parser = ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--kills", type=int, default=20, metavar="N", help="runs (default: 20)")
    parser.add_argument("--seed", type=int, default=0, help="of the random moments (default: 0)")
    parser.add_argument("--bound", type=float, default=50.0, metavar="MS", help="loss allowed (default: 50)")
    parser.add_argument("--output", type=Path, default=FOLDER, metavar="FOLDER", help="where the figures go")
    options = parser.parse_args()
    os.environ.update(ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST", ROS_STATIC_PEERS="")
    moments = random.Random(options.seed)
    kills = []
    for number in range(options.kills):
        moment_s, jitter_s = moments.uniform(0.0, _LATEST_S), moments.uniform(0.0, _JITTER_S)
        with tempfile.TemporaryDirectory() as folder:
            kill = kill_recorder(Path(folder), moment_s, jitter_s)
        kills.append(kill)
        print(f"{number + 1}: {kill.loss_ms:.0f} ms lost at {kill.published_ns / NS_PER_S:.3f} s", flush=True)
    good = [kill.opened and kill.missing == 0 and kill.loss_ms <= options.bound for kill in kills]
    publish(_result(kills, options.bound, options.seed), options.output)
    return 0 if all(good) else 1


def _result(kills: list[Kill], bound_ms: float, seed: int) -> Result:
    """Return what was found."""
    rows = [
        (
            str(number),
            f"{kill.published_ns / NS_PER_S:.3f}",
            f"{kill.recovered_ns / NS_PER_S:.3f}",
            f"{kill.loss_ms:.0f}",
            str(kill.missing),
            str(kill.lost_bytes),
            "yes" if kill.opened_at_once else "no",
            "yes" if kill.opened else "no",
        )
        for number, kill in enumerate(kills, 1)
    ]
    worst = max(kill.loss_ms for kill in kills)
    heading = (
        "kill",
        "published up to [s]",
        "recovered up to [s]",
        "lost [ms]",
        "gaps before",
        "bytes unusable",
        "opens as it is",
        "opens recovered",
    )
    return Result(
        name="recorder_kill",
        question="How much is lost if the recorder is killed?",
        tables=[Table(heading, rows)],
        notes=[
            f"The recorder of a run of the graph was killed by SIGKILL {len(kills)} times at random moments "
            f"(seed {seed}). At most {worst:.0f} ms of simulated time were lost; {bound_ms:g} ms are allowed."
        ],
        values={"loss_ms": [kill.loss_ms for kill in kills], "worst_ms": worst},
    )


if __name__ == "__main__":
    sys.exit(main())
