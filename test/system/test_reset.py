"""A run that is reset under the launcher: the second run has the same bits, and each run a bag of its own."""

import os
import random
import re
import signal
from pathlib import Path

import pytest
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

from sms_handover.analysis.equality import before, compare_runs
from sms_handover.bag.run.reader import read_run
from sms_handover.graph.topics import CONTROLLER, NODES, PLANT
from sms_handover.run_data import RunData

from .conftest import TICKS, Command
from .runs import DEADLINE_S, Running, running

pytestmark = [pytest.mark.system, pytest.mark.slow]

_DOMAIN = re.compile(r"running on ROS domain (\d+),")
_SEED = 6
_SIZE = 120_000  # bytes of a bag; some 90 000 are written before the first tick


def reset_agreed(run: Running) -> bool:
    """Ask for a reset, as `ros2 service call /plant/reset` does, and tell whether the plant has agreed.

    Until the plant has been found, which can take longer than the run, the run is held by its controller.
    """
    said = _DOMAIN.search(run.text)
    assert said
    os.kill(run.nodes[CONTROLLER], signal.SIGSTOP)
    rclpy.init(domain_id=int(said[1]), signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = Node("tester", start_parameter_services=False)
        client = node.create_client(Trigger, f"{PLANT}/reset")
        assert client.wait_for_service(timeout_sec=DEADLINE_S)
        os.kill(run.nodes[CONTROLLER], signal.SIGCONT)
        asked = client.call_async(Trigger.Request())
        rclpy.spin_until_future_complete(node, asked, timeout_sec=DEADLINE_S)
        node.destroy_node()
        return bool(asked.result().success)
    finally:
        rclpy.try_shutdown()


def test_a_second_run_has_the_same_bits_and_a_bag_of_its_own(
    simulated: dict[str, RunData],
    schedule: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    called: Command,
) -> None:
    """The first run is reset at a random place; no process is started again."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    law = "pid"  # whose integral must not outlive its run
    arguments = ("run", "--controller", law, "--schedule", schedule, "-o", "mine")
    size = random.Random(_SEED).randrange(_SIZE, 3 * _SIZE)
    with running(*arguments, cwd=tmp_path) as run:
        run.until_all_nodes(NODES)
        processes = dict(run.nodes)
        run.until_recorded(tmp_path / "mine" / "bag", size)
        assert reset_agreed(run)
        assert run.end() == 0, run.text
        assert run.nodes == processes
    first, second = (read_run(tmp_path / "mine" / name) for name in ("bag", "bag_2"))
    end_ns = int(first.tick_ns[-1])
    assert 10 < first.tick_ns.size < TICKS
    assert compare_runs(before(first, end_ns), before(simulated[law], end_ns)) == ()
    assert compare_runs(second, simulated[law]) == ()
    checked = called("bag", "check", "mine", cwd=tmp_path)
    assert checked.code == 0, checked
    assert checked.out.count(" is complete: ") == 2
    again = called("verify", "mine", cwd=tmp_path)
    assert again.code == 0, again
    assert "where the run was ended" in again.out.splitlines()[0]
    assert again.out.splitlines()[1].startswith(f"the same bit for bit: {TICKS} states")
    compared = called("compare", "mine/bag_2", cwd=tmp_path)
    assert compared.code == 0 and "mine_2" in compared.out, compared
    ambiguous = called("bag", "info", "mine", cwd=tmp_path)
    assert ambiguous.code and "has the bags of 2 runs" in ambiguous.err
