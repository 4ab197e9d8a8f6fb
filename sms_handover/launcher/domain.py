"""A ROS domain of its own for every run, so that concurrent runs never receive each other's messages."""

import errno
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from sms_handover.errors import ConfigurationError

FIRST_DOMAIN, LAST_DOMAIN = 1, 101  # above 101 the ports of DDS meet the ephemeral ports of Linux

_LOCALHOST, _EVERYWHERE = "127.0.0.1", ""  # addresses to bind to
# The mapping of RTPS 2.2, 9.6.1: every domain has 250 ports from 7400 on; participant n of it receives at
# 10 + 2 n and 11 + 2 n. Ports 2 to 9 of a domain are unused, so that one of them can stand for it.
_FIRST_PORT, _PORTS = 7400, 250
_RESERVATION, _PARTICIPANT, _PER_PARTICIPANT = 2, 10, 2
_PARTICIPANTS = 8  # whose ports are checked


@dataclass(frozen=True)
class Reservation:
    """A domain, and the file descriptors that hold it: it is free when no process has them open."""

    domain: int
    descriptors: tuple[int, ...]


@contextmanager
def reservation(asked: int | None, *, shared: bool = False) -> Iterator[Reservation]:
    """Hold a domain within the context; raises ConfigurationError if there is none.

    A domain is held by a port of this machine, so between all users and containers that share the network,
    until the last process that has the port open ends, however it ends. Without an ``asked`` domain it is
    the first that no run holds and that has no participant. One that is asked for to be ``shared``, by
    launchers that each start a part of one graph, is not held.
    """
    if asked is not None and not 0 <= asked <= LAST_DOMAIN:
        raise ConfigurationError(f"domain id is {asked}, must be 0 to {LAST_DOMAIN}")
    if asked is not None and shared:
        yield Reservation(asked, ())
        return
    with ExitStack() as stack:
        for domain in (asked,) if asked is not None else range(FIRST_DOMAIN, LAST_DOMAIN + 1):
            held = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
            if _is_free(held, _LOCALHOST, domain, _RESERVATION) and (
                asked is not None or not _is_used(domain)
            ):
                yield Reservation(domain, (held.fileno(),))
                return
            held.close()
    if asked is not None:
        raise ConfigurationError(
            f"domain id is {asked}, which another run on this machine holds; "
            "choose another, or leave --domain-id away for a free one"
        )
    raise ConfigurationError(
        f"all domains from {FIRST_DOMAIN} to {LAST_DOMAIN} are in use on this machine; "
        "wait for a run to end, or give a --domain-id that you know to be free"
    )


@contextmanager
def reserved_domain(asked: int | None) -> Iterator[int]:
    """Hold a domain as ``reservation`` does, and yield its number."""
    with reservation(asked) as reserved:
        yield reserved.domain


def _is_used(domain: int) -> bool:
    """Whether a domain has participants, as of any other ROS program."""
    for number in range(_PARTICIPANTS):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            if not _is_free(probe, _EVERYWHERE, domain, _PARTICIPANT + _PER_PARTICIPANT * number):
                return True
    return False


def _is_free(port: socket.socket, address: str, domain: int, offset: int) -> bool:
    """Bind a socket to a port of a domain; return whether it was free. Raises ConfigurationError."""
    try:
        port.bind((address, _FIRST_PORT + _PORTS * domain + offset))
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            return False
        raise ConfigurationError(
            f"no domain can be reserved on {_LOCALHOST}: {error.strerror}; is its network interface up?"
        ) from error
    return True
