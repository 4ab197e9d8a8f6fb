"""An own ROS domain for every run, so that runs side by side never hear each other."""

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sms_handover.errors import ConfigurationError

FIRST_DOMAIN, LAST_DOMAIN = 1, 101  # above 101 the ports of DDS meet the ephemeral ports of Linux


@contextmanager
def reserved_domain(asked: int | None) -> Iterator[int]:
    """Hold a domain for as long as the context lasts; raises ConfigurationError if there is none.

    A domain that was asked for is taken as it is, so that other tools can join it. Otherwise the
    first one whose lock file no other run holds is taken; the lock goes with the process.
    """
    if asked is not None:
        if not 0 <= asked <= LAST_DOMAIN:
            raise ConfigurationError(f"domain id is {asked}, allowed is 0 to {LAST_DOMAIN}")
        yield asked
        return
    folder = Path(tempfile.gettempdir()) / f"sms_handover_domains_{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    for domain in range(FIRST_DOMAIN, LAST_DOMAIN + 1):
        with (folder / str(domain)).open("w", encoding="ascii") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            yield domain
            return
    raise ConfigurationError(f"all domains from {FIRST_DOMAIN} to {LAST_DOMAIN} are in use; give --domain-id")
