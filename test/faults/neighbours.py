"""Runs side by side: none hears or disturbs another."""

import signal
import sys

from sms_handover.graph.topics import CONTROLLER

from ..system.runs import Ended, command_of
from .fault import Fault
from .graph_run import DOMAIN, EARLIEST, bag_of, held, same_as_ever, short_run
from .outcome import CannotTry, Kept, require
from .promises import refused, whole
from .trial import Trial

TITLE = "Runs side by side"

_TAKE_ALL = """
import subprocess, sys
from contextlib import ExitStack
from sms_handover.launcher.domain import reservation
from sms_handover.errors import ConfigurationError
with ExitStack() as stack:
    try:
        while True:
            stack.enter_context(reservation(None))
    except ConfigurationError:
        sys.exit(subprocess.run(sys.argv[1:]).returncode)
"""


def two_at_once(trial: Trial) -> tuple[Ended, Ended]:
    """Start two runs at the same instant, without a folder or a domain of their own."""
    words = short_run(trial)[:-2]
    with trial.start(*words) as one, trial.start(*words) as other:
        return trial.ended(one), trial.ended(other)


def both_are_whole(trial: Trial, seen: tuple[Ended, Ended]) -> Kept:
    """Require two whole bags with the same bits as in one process, from different domains."""
    domains = {found[1] for ended in seen if (found := DOMAIN.search(ended.out))}
    require(len(domains) == 2, f"domains {sorted(domains)}")
    folders = sorted((trial.folder / "runs").iterdir())
    require(len(folders) == 2, f"output folders {folders}")
    for ended, folder in zip(seen, folders, strict=True):
        kept = whole(folder / "bag", ended)
        again = trial.sms_handover("verify", folder)
        require(again.code == 0, f"{folder.name} is not reproduced: {(again.err or again.out)[-300:]}")
    return kept


def all_domains_taken(trial: Trial) -> Ended:
    """Start a run where every domain is held, in a network of its own so that nobody else is kept out."""
    command = [
        "unshare",
        "--net",
        "sh",
        "-c",
        'ip link set lo up && exec "$0" -c "$@"',
        sys.executable,
        _TAKE_ALL,
    ]
    probe = trial.command([*command[:4], "ip link set lo up"])
    if probe.code:
        raise CannotTry(f"no network of its own: {probe.err.strip()}")
    return trial.command([*command, *command_of(short_run(trial))])


def no_domain_is_left(trial: Trial, ended: Ended) -> Kept:
    """Require that it is told and nothing was begun."""
    require(not (trial.folder / "run").exists(), "an output folder was made")
    return refused(ended, "all domains from 1 to 101 are in use on this machine")


def next_at_once(trial: Trial) -> Ended:
    """Kill the launcher of a run and start the next one while the nodes of the first still end."""
    with trial.start("run", "-o", "first") as first:
        first.until_recorded(trial.folder / "first" / "bag", EARLIEST)
        first.send(signal.SIGKILL)
        return trial.sms_handover(*short_run(trial))


def overwrite(trial: Trial) -> tuple[Ended, Ended]:
    """Let a run be overwritten by another while it goes on; it is held, as the other takes time to begin."""
    with trial.start(*short_run(trial)) as run:
        run.until_recorded(bag_of(trial), EARLIEST)
        with held(run, CONTROLLER):
            other = trial.sms_handover(*short_run(trial), "--overwrite")
        return other, trial.ended(run)


def is_not_overwritten(trial: Trial, seen: tuple[Ended, Ended]) -> Kept:
    """Require that the second run is refused and the first is whole."""
    other, run = seen
    refused(other, "a run still writes to output folder run")
    return whole(bag_of(trial), run)


FAULTS = (
    Fault(
        name="next-run-at-once",
        injected="a run that begins at the instant when the launcher of another is killed",
        promise="it does not hear the nodes that still end: whole, bit for bit as alone",
        inject=next_at_once,
        check=same_as_ever,
    ),
    Fault(
        name="overwritten-while-running",
        injected="`--overwrite` of the folder that a run still writes to",
        promise="exit code 2 and one line; the first run is whole",
        inject=overwrite,
        check=is_not_overwritten,
    ),
    Fault(
        name="two-runs-at-once",
        injected="two runs started at the same instant, without a folder or a domain given",
        promise="each takes its own domain and folder, both are whole, bit for bit as alone",
        inject=two_at_once,
        check=both_are_whole,
    ),
    Fault(
        name="all-domains-taken",
        injected="a run while others hold all 101 domains",
        promise="exit code 2 and one line, nothing is begun",
        inject=all_domains_taken,
        check=no_domain_is_left,
    ),
)
