"""However a run ends, no process is left, and what was recorded can be read."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from sms_handover.bag.info import read_info
from sms_handover.bag.reader import read_run
from sms_handover.topics import NODES

from .commands import DEADLINE_S, nodes_of, sms_handover, started, wait_until

pytestmark = [pytest.mark.system, pytest.mark.slow]


def recording(bag: Path) -> bool:
    """Tell whether a run has got so far that its bag is being filled."""
    file = bag / "bag_0.mcap"
    return file.exists() and file.stat().st_size > 200_000  # byte, some hundred ticks


def test_an_interrupt_leaves_a_complete_bag(tmp_path: Path) -> None:
    """The plant ends at the tick it is at, the others tell their counts, the recorder takes all of it."""
    with started(tmp_path, "run", "-o", "run") as process:
        wait_until(lambda: recording(tmp_path / "run" / "bag"), "a recording")
        process.send_signal(signal.SIGINT)
        assert process.wait(DEADLINE_S) == 130
        assert nodes_of(process.pid) == {}
    info = read_info(tmp_path / "run" / "bag")
    assert info.ledger is not None and info.ledger.complete
    run = read_run(tmp_path / "run" / "bag")
    assert 0 < run.tick_ns.size < 60_000


def test_a_dead_node_ends_the_run_and_is_named(tmp_path: Path) -> None:
    """The run ends with exit code 1 and the name of who died; nobody else is left."""
    with started(tmp_path, "run", "-o", "run") as process:
        wait_until(lambda: recording(tmp_path / "run" / "bag"), "a recording")
        nodes = nodes_of(process.pid)
        assert set(nodes) == set(NODES)
        os.kill(nodes["controller"], signal.SIGKILL)
        output, _ = process.communicate(timeout=DEADLINE_S)
        assert process.returncode == 1
        assert "node 'controller' was killed by signal 9" in output
        assert nodes_of(process.pid) == {}
    assert read_run(tmp_path / "run" / "bag").tick_ns.size > 0


def test_nodes_end_when_their_launcher_is_gone(tmp_path: Path) -> None:
    """A launcher that is killed cannot end its nodes; they notice and end by themselves."""
    with started(tmp_path, "run", "-o", "run") as process:
        wait_until(lambda: recording(tmp_path / "run" / "bag"), "a recording")
        assert set(nodes_of(process.pid)) == set(NODES)
        process.kill()
        process.wait(DEADLINE_S)
        wait_until(lambda: nodes_of(process.pid) == {}, "the end of every node")
    assert read_run(tmp_path / "run" / "bag").tick_ns.size > 0


def test_runs_side_by_side_do_not_hear_each_other(schedule: Path, tmp_path: Path) -> None:
    """Each run takes a domain of its own, so both are whole."""
    arguments = ("run", "--schedule", str(schedule), "-o")
    with started(tmp_path, *arguments, "one") as process:
        other = sms_handover(tmp_path, *arguments, "two")
        output, _ = process.communicate(timeout=DEADLINE_S)
    assert (process.returncode, other.returncode) == (0, 0), output + other.stdout + other.stderr
    domains = {text.split("running on ROS domain ")[1].split(",")[0] for text in (output, other.stdout)}
    assert len(domains) == 2
    assert read_run(tmp_path / "one" / "bag").tick_ns.size == read_run(tmp_path / "two" / "bag").tick_ns.size


def test_a_second_recorder_on_the_same_folder_is_refused(schedule: Path, tmp_path: Path) -> None:
    """The recorder says so in one line and exits with 2; the bag that is there stays as it is."""
    assert sms_handover(tmp_path, "run", "--schedule", str(schedule), "-o", "run").returncode == 0
    bag = tmp_path / "run" / "bag"
    before = (bag / "bag_0.mcap").read_bytes()
    command = [sys.executable, "-m", "sms_handover.nodes.recorder", "--ros-args", "-p", f"folder:={bag}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
    assert done.returncode == 2
    assert "exists" in done.stderr and "Traceback" not in done.stderr
    assert (bag / "bag_0.mcap").read_bytes() == before
