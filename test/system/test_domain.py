"""No two runs on one machine share a domain, whoever started them and however they end."""

import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from threading import Barrier

import pytest

from sms_handover.errors import ConfigurationError
from sms_handover.launcher import domain as domains
from sms_handover.launcher.domain import FIRST_DOMAIN, LAST_DOMAIN, reservation, reserved_domain

HOLDER = """
import subprocess, sys
from sms_handover.launcher.domain import reservation
with reservation(None) as held:
    subprocess.Popen([sys.executable, "-c", "import sys; sys.stdin.read()"], pass_fds=held.descriptors)
    print(held.domain, flush=True)
    sys.stdin.read()
"""
TOGETHER = 12


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Let only so many domains exist, the last ones, which nobody else begins with."""

    def only(count: int) -> None:
        monkeypatch.setattr(domains, "FIRST_DOMAIN", LAST_DOMAIN - count + 1)

    return only


def test_domains_taken_at_the_same_instant_differ() -> None:
    barrier = Barrier(TOGETHER)
    taken = []

    def take(number: int) -> None:
        barrier.wait()
        with reserved_domain(None) as domain:
            taken.append(domain)
            barrier.wait()

    with ThreadPoolExecutor(TOGETHER) as pool:
        list(pool.map(take, range(TOGETHER)))
    assert len(set(taken)) == TOGETHER
    assert all(FIRST_DOMAIN <= domain <= LAST_DOMAIN for domain in taken)


def test_a_domain_is_free_again_afterwards(few: Callable[[int], None]) -> None:
    few(1)
    for _ in range(3):
        with reserved_domain(None) as domain:
            assert domain == LAST_DOMAIN


def test_when_all_are_taken_that_is_told(few: Callable[[int], None]) -> None:
    few(3)
    with ExitStack() as stack:
        for _ in range(3):
            stack.enter_context(reserved_domain(None))
        with pytest.raises(ConfigurationError, match=r"all domains from \d+ to 101 are in use"):
            stack.enter_context(reserved_domain(None))


def test_a_domain_that_was_asked_for_is_refused_while_a_run_holds_it() -> None:
    with (
        reserved_domain(None) as domain,
        pytest.raises(ConfigurationError, match=f"domain id is {domain}, which another run"),
    ):
        reserved_domain(domain).__enter__()
    with reserved_domain(domain) as again:
        assert again == domain


def test_the_parts_of_one_graph_share_a_domain() -> None:
    with reserved_domain(None) as domain, reservation(domain, shared=True) as one:
        assert one.domain == domain


@pytest.mark.parametrize("asked", [-1, LAST_DOMAIN + 1])
def test_a_domain_out_of_range_is_refused(asked: int) -> None:
    with pytest.raises(ConfigurationError, match=f"domain id is {asked}, must be 0 to 101"):
        reserved_domain(asked).__enter__()


@pytest.mark.parametrize("participant", [0, 1, 5])
def test_a_domain_in_which_a_stranger_takes_part_is_left_alone(
    participant: int, few: Callable[[int], None]
) -> None:
    few(2)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind(("0.0.0.0", 7400 + 250 * (LAST_DOMAIN - 1) + 10 + 2 * participant))
        with reserved_domain(None) as domain:
            assert domain == LAST_DOMAIN
        with reserved_domain(LAST_DOMAIN - 1) as asked:  # as one who wants to join asks for it
            assert asked == LAST_DOMAIN - 1


def test_a_domain_is_held_until_the_last_process_of_the_run_has_ended() -> None:
    """A run that begins when a launcher was killed must not hear the nodes that are still ending."""
    command = [sys.executable, "-c", HOLDER]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as launcher:
        assert launcher.stdin is not None and launcher.stdout is not None
        domain = int(launcher.stdout.readline())
        launcher.send_signal(signal.SIGKILL)
        launcher.wait()
        with pytest.raises(ConfigurationError, match="which another run"), reservation(domain):
            pass
        launcher.stdin.close()  # of which the node holds the other end: it ends
        launcher.stdout.read()  # until the node has closed it too
    with reservation(domain) as free:
        assert free.domain == domain


def test_a_machine_without_a_network_to_itself_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(domains, "_LOCALHOST", "240.0.0.1")  # of nobody, RFC 1112
    with pytest.raises(ConfigurationError, match=r"no domain can be reserved on 240.0.0.1: .*interface up\?"):
        reserved_domain(None).__enter__()
