"""The graph split over hosts: whatever the network does, lock step gives the same bits and loses nothing."""

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from time import sleep

import pytest

from sms_handover.analysis.equality import compare_runs
from sms_handover.bag.info import read_info
from sms_handover.bag.run.reader import read_run
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate

from .hosts import Host, Network, network, why_not
from .runs import Running, running

pytestmark = [pytest.mark.system, pytest.mark.slow]

NEEDED = "SMS_HANDOVER_NEEDS_HOSTS"  # set where hosts that cannot be made are a failure, not a reason to skip
DOMAIN = 7  # no other graph is on the networks made here
DURATION_S = 1.0  # s of simulated time
CUT_S = 3.0  # s: many times as long as the loop takes for what it may be ahead of the recorder
EACH_ITS_HOST = ("plant,trajectory", "ik", "controller", "recorder")
BAD = {"delay": 0.001, "jitter": 0.002, "loss": 0.02, "reorder": 0.2, "duplicate": 0.05, "corrupt": 0.02}


@pytest.fixture(scope="module", autouse=True)
def _hosts_can_be_made() -> None:
    """Skip where the system does not permit namespaces."""
    reason = why_not()
    if reason and os.environ.get(NEEDED):
        pytest.fail(reason)
    if reason:
        pytest.skip(reason)


@pytest.fixture(scope="module")
def one_process() -> RunData:
    """The same run in one process."""
    return simulate(load_scenario(values={"common": {"duration": DURATION_S}}))


@pytest.fixture
def pair() -> Iterator[Network]:
    """Two hosts."""
    with network(2) as made:
        yield made


@pytest.fixture
def four() -> Iterator[Network]:
    """Four hosts."""
    with network(4) as made:
        yield made


class Split:
    """One run, with a command on each host."""

    def __init__(self, runs: Mapping[str, Running], folder: Path) -> None:
        """Take the commands by the name of their host."""
        self.runs = dict(runs)
        self.recorder = list(runs)[-1]
        self.bag = folder / self.recorder / "bag"

    def until_recorded(self, size: int) -> None:
        """Wait until so many bytes are in the bag."""
        self.runs[self.recorder].until_recorded(self.bag, size)

    def assert_whole(self) -> None:
        """Wait for the end; assert that every command says all is well, and that nothing is missing."""
        codes = {name: run.end() for name, run in self.runs.items()}
        assert set(codes.values()) == {0}, "\n".join(run.text for run in self.runs.values())
        ledger = read_info(self.bag).ledger
        assert ledger is not None and ledger.complete


def split(
    stack: ExitStack, hosts: Sequence[Host], nodes: Sequence[str], folder: Path, *options: str
) -> Split:
    """Start a run with these nodes on these hosts, the recorder on the last one."""
    runs = {}
    for host, names in zip(hosts, nodes, strict=True):
        peers = ",".join(other.address for other in hosts if other is not host)
        place = ("--nodes", names, "--peers", peers, "--domain-id", DOMAIN, "--duration", DURATION_S)
        command = running("run", *place, "-o", host.name, *options, cwd=folder, on=host)
        runs[host.name] = stack.enter_context(command)
    return Split(runs, folder)


def test_a_bad_network_and_a_cut_change_no_bit(four: Network, one_process: RunData, tmp_path: Path) -> None:
    """Each node on its host. The recorder's cable delays, loses, reorders, doubles and spoils frames.

    In the midst of the run every cable is cut for a while, which costs nothing but time.
    """
    four.set(four.hosts[-1], **BAD)
    with ExitStack() as stack:
        run = split(stack, four.hosts, EACH_ITS_HOST, tmp_path)
        run.until_recorded(200_000)
        dropped = four.hosts[0].cable.dropped
        four.set(cut=True)
        sleep(CUT_S)
        assert all(each.process.poll() is None for each in run.runs.values()), "it was over before the cut"
        assert four.hosts[0].cable.dropped > dropped
        four.set()
        four.set(four.hosts[-1], **BAD)
        run.assert_whole()
        assert all("open to the network, announced to 10.77.0" in each.text for each in run.runs.values())
        assert (
            "this host runs ik; waiting for plant, trajectory, controller, recorder" in run.runs["host2"].text
        )
    assert compare_runs(read_run(run.bag), one_process) == ()
    assert all(host.cable.carried > 1000 for host in four.hosts)
    assert four.hosts[-1].cable.dropped > 100


def test_a_run_of_this_machine_cannot_be_reached_from_another(pair: Network, tmp_path: Path) -> None:
    """Not even by one who knows address and domain; a neighbour on the same machine sees it."""
    here, stranger = pair.hosts
    with running("run", "--domain-id", DOMAIN, "-o", "run", cwd=tmp_path, on=here) as run:
        run.until_recorded(tmp_path / "run" / "bag", 200_000)
        assert "this machine only" in run.text
        assert seen_from(stranger, tmp_path, peers=here.address) == set()
        assert {"/joint_states", "/joint_command"} <= seen_from(here, tmp_path, peers="")


def seen_from(host: Host, folder: Path, peers: str) -> set[str]:
    """Return the topics of a graph that a ROS process on a host finds within some seconds."""
    script = Path(__file__).with_name("stranger.py")
    command = host.command(folder, [sys.executable, str(script)])
    environment = {**os.environ, "ROS_DOMAIN_ID": str(DOMAIN), "ROS_STATIC_PEERS": peers}
    for closed in ("ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTRTPS_DEFAULT_PROFILES_FILE"):
        environment.pop(closed, None)
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return set(done.stdout.split())
