"""However a run ends, no process is left, and what was recorded can be read."""

import os
import shutil
import signal
import subprocess
from contextlib import suppress
from pathlib import Path

import pytest

from sms_handover.bag.info import read_info
from sms_handover.bag.run.reader import read_run
from sms_handover.graph.topics import NODES
from sms_handover.run_data import RunData

from ..core.terminal import Terminal
from ..ros.short_handover import short_handover
from .conftest import Command
from .runs import DEADLINE_S, Ended, Running, command_of, has_ended, nodes_of, running, sms_handover

pytestmark = [pytest.mark.system, pytest.mark.slow]

UNDER_WAY = 200_000  # bytes of a bag; more than it begins with, less than one second of the loop gives


def beginning(bag: Path) -> RunData:
    """Return what a bag holds of a run that was cut short, and make sure that nothing of it is missing."""
    run = read_run(bag)
    ticks = len(run.tick_ns)
    assert 0 < ticks < 60_001
    assert run.tick_ns.tolist() == [k * 1_000_000 for k in range(ticks)]
    info = read_info(bag)
    assert info.ledger is not None and info.ledger.complete
    assert set(info.parameters) == set(NODES)
    return run


def ends_in_order(run: Running, number: signal.Signals, bag: Path) -> None:
    """Send a signal: the plant ends at the tick it is at, the others tell their counts, all is recorded."""
    assert set(run.nodes) == set(NODES)
    run.send(number)
    assert run.end() == 130
    assert "stopped on request at" in run.text
    run.wait_for_nodes()
    every_state_is_there(bag)


def every_state_is_there(bag: Path) -> None:
    """Assert that a bag has every state up to the end, and as many as were published."""
    ledger = read_info(bag).ledger
    assert ledger is not None
    states = {account.name: account for account in ledger.topics}["/joint_states"]
    assert states.received == states.published == len(beginning(bag).tick_ns)


def test_a_request_to_end_leaves_a_complete_bag(tmp_path: Path) -> None:
    bag = tmp_path / "run" / "bag"
    with running("run", "-o", "run", cwd=tmp_path) as run:
        run.until_recorded(bag, UNDER_WAY)
        ends_in_order(run, signal.SIGTERM, bag)


def test_a_suspended_node_is_named_and_the_run_goes_on_with_it_up_to_an_interrupt(tmp_path: Path) -> None:
    """While it stands still another run wants its folder, and does not get it."""
    bag = tmp_path / "run" / "bag"
    with running("run", "-o", "run", cwd=tmp_path) as run:
        run.until_recorded(bag, UNDER_WAY)
        pid = run.nodes["ik"]
        os.kill(pid, signal.SIGSTOP)
        refused = sms_handover("run", "-o", "run", "--overwrite", cwd=tmp_path)
        assert (refused.code, len(refused.errors)) == (2, 1)
        assert "a run still writes to output folder run" in refused.errors[0]
        run.until(lambda: "node 'ik' is suspended; " in run.text, "the news")
        assert f"'kill -CONT {pid}' lets it go on" in run.text
        size = (bag / "bag_0.mcap").stat().st_size
        os.kill(pid, signal.SIGCONT)
        run.until_recorded(bag, size + UNDER_WAY)  # far more than without an answer of it
        ends_in_order(run, signal.SIGINT, bag)


def test_an_interrupt_before_the_start_ends_everything(tmp_path: Path) -> None:
    with running("run", "-o", "run", cwd=tmp_path) as run:
        run.until_all_nodes(NODES)
        run.send(signal.SIGINT)
        assert run.end() == 130
        assert "Traceback" not in run.text
        run.wait_for_nodes()


def test_a_second_interrupt_ends_everything_at_once(tmp_path: Path) -> None:
    bag = tmp_path / "run" / "bag"
    with running("run", "-o", "run", cwd=tmp_path) as run:
        run.until_recorded(bag, UNDER_WAY)
        os.kill(run.nodes["plant"], signal.SIGSTOP)  # it will not end on request
        run.send(signal.SIGINT)
        run.until(lambda: "ending the run" in run.text, "the first interrupt")
        run.send(signal.SIGINT)
        run.until(lambda: run.text.count("ending the run") == 2, "the second interrupt")
        os.kill(run.nodes["plant"], signal.SIGCONT)
        assert run.end() == 130
        assert "Traceback" not in run.text
        run.wait_for_nodes()
    assert len(read_run(bag).tick_ns) > 0


def test_a_quit_ends_everything_at_once(tmp_path: Path) -> None:
    """Ctrl and backslash in a terminal: nothing is waited for, and still nothing is lost that had come."""
    bag = tmp_path / "run" / "bag"
    with running("run", "-o", "run", cwd=tmp_path) as run:
        run.until_recorded(bag, UNDER_WAY)
        run.send(signal.SIGQUIT)
        assert run.end() == 130
        run.wait_for_nodes()
    beginning(bag)


def test_a_closed_terminal_ends_the_run_in_order(tmp_path: Path) -> None:
    """The launcher can print no more; that must not keep it from waiting for the recorder."""
    bag = tmp_path / "run" / "bag"
    terminal, inside = os.openpty()
    os.set_blocking(terminal, False)
    command = ["setsid", "--ctty", *command_of(("run", "-o", "run"))]  # of util-linux; it becomes the command
    with subprocess.Popen(command, cwd=tmp_path, stdin=inside, stdout=inside, stderr=inside) as process:
        os.close(inside)
        try:
            nodes = read_until_recorded(terminal, process.pid, bag)
        finally:
            os.close(terminal)
        assert process.wait(DEADLINE_S) == 130
    assert set(nodes) == set(NODES)
    assert all(has_ended(pid, DEADLINE_S) for pid in nodes.values())
    every_state_is_there(bag)


def test_the_progress_of_a_run_takes_one_line_of_a_narrow_terminal(schedule: Path, tmp_path: Path) -> None:
    command = ["run", "--schedule", str(schedule), "--duration", "0.1", "-o", str(tmp_path / "run")]
    program = f"from sms_handover.cli.main import main\nraise SystemExit(main({command}))"
    with Terminal(program, columns=40, TERM="xterm") as terminal:
        assert terminal.end() == 0, terminal.text
    (line,) = [line for line in terminal.screen if " of 0.1 s" in line]
    assert line.startswith("  0.10 of 0.1 s") and len(line) <= 40


def read_until_recorded(terminal: int, pid: int, bag: Path) -> dict[str, int]:
    """Read what a command prints on a terminal until its run is under way; return its nodes."""
    file = bag / "bag_0.mcap"
    while not (file.is_file() and file.stat().st_size > UNDER_WAY):
        assert not has_ended(pid, 0.02)
        with suppress(BlockingIOError):
            os.read(terminal, 4096)
    return nodes_of(pid)


def test_a_dead_node_ends_the_run_and_is_named(tmp_path: Path) -> None:
    """The run ends with exit code 1 and the name of who died; nobody else is left."""
    bag = tmp_path / "run" / "bag"
    with running("run", "-o", "run", cwd=tmp_path) as run:
        run.until_recorded(bag, UNDER_WAY)
        assert set(run.nodes) == set(NODES)
        os.kill(run.nodes["controller"], signal.SIGKILL)
        assert run.end() == 1
        (line,) = (line for line in run.text.splitlines() if "error:" in line)
        assert "node 'controller' was killed by signal 9" in line
        run.wait_for_nodes()
    beginning(bag)


def test_a_recorder_that_is_ended_closes_its_bag_and_is_missed(tmp_path: Path) -> None:
    """Without it the run is not what was asked for; the launcher must not go on and call it whole."""
    bag = tmp_path / "run" / "bag"
    with running("run", "-o", "run", cwd=tmp_path) as run:
        run.until_recorded(bag, UNDER_WAY)
        os.kill(run.nodes["recorder"], signal.SIGTERM)
        assert run.end() == 1
        assert "node 'recorder' ended with exit code 130" in run.text
        run.wait_for_nodes()
    beginning(bag)
    assert (bag / "metadata.yaml").is_file()


def test_nodes_end_when_their_launcher_is_gone(tmp_path: Path) -> None:
    """A launcher that is killed cannot end its nodes; they notice and end by themselves."""
    bag = tmp_path / "run" / "bag"
    with running("run", "-o", "run", cwd=tmp_path) as run:
        run.until_recorded(bag, UNDER_WAY)
        assert set(run.nodes) == set(NODES)
        run.send(signal.SIGKILL)
        assert run.end() == -9
        run.wait_for_nodes()
    beginning(bag)


def test_a_missed_grasp_has_an_exit_code_of_its_own(tmp_path: Path) -> None:
    """The target is in reach, but not within so short a phase: that shows only in the run.

    Nothing else does here: without a recorder nothing is recorded.
    """
    schedule = tmp_path / "schedule.yaml"
    schedule.write_text(short_handover(stretch=2.0, deputy_off=(0.0, 0.03, 0.04)), encoding="utf-8")
    step = ("--time-law", "step")
    graph = ("--no-record", "--compose", "--schedule", schedule, "-o", "run")
    done = sms_handover("run", *step, *graph, cwd=tmp_path)
    assert done.code == 4, done
    assert "grasp by arm_a: missed" in done.err
    assert "transfer by arm_b: rejected" in done.err
    assert "run complete at 0.68 s" in done.out
    assert not (tmp_path / "run" / "bag").exists()


def test_an_earlier_run_is_replaced_only_if_wanted(
    recorded: dict[str, tuple[Path, Ended]], schedule: Path, tmp_path: Path, called: Command
) -> None:
    shutil.copytree(recorded["nmpc"][0], tmp_path / "run")
    before = (tmp_path / "run" / "bag" / "bag_0.mcap").read_bytes()
    arguments = ("run", "--compose", "--schedule", schedule, "--duration", "0.2", "-o", "run")
    refused = called(*arguments, cwd=tmp_path)
    assert (refused.code, len(refused.errors)) == (2, 1)
    assert (tmp_path / "run" / "bag" / "bag_0.mcap").read_bytes() == before
    again = sms_handover(*arguments, "--overwrite", cwd=tmp_path)
    assert again.code == 0, again
    assert len(read_run(tmp_path / "run" / "bag").tick_ns) == 201


# A recorder alone


def test_a_second_recorder_on_the_same_folder_is_refused(tmp_path: Path) -> None:
    """It says so in one line and exits with 2, while the first one goes on and closes its bag."""
    arguments = ("--ros-args", "-p", "folder:=bag")
    module = "sms_handover.nodes.recorder"
    with running(*arguments, cwd=tmp_path, module=module) as first:
        first.until((tmp_path / "bag" / "bag_0.mcap").is_file, "the bag of the first")
        with running(*arguments, cwd=tmp_path, module=module) as second:
            assert second.end() == 2
            (line,) = (line for line in second.text.splitlines() if "error:" in line)
            assert "bag exists" in line
            assert "Traceback" not in second.text
        first.send(signal.SIGINT)
        assert first.end() == 130
    info = read_info(tmp_path / "bag")
    assert info.schedule_text and info.urdf_text and info.provenance
    assert info.ledger is not None
