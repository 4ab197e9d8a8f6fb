"""One attempt at a fault, in the process that was started for it."""

import json
import os
import traceback
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from random import Random
from subprocess import TimeoutExpired
from time import monotonic
from typing import Any

from sms_handover.launcher.domain import reserved_domain

from .fault import Fault
from .leftovers import MARK, SHARED_MEMORY, shared_memory, wait_for_none
from .outcome import CannotTry, Loss, Outcome, PromiseBroken, Status, require
from .promises import every_bag_is_usable
from .trial import Trial

OWN_MOUNTS = "SMS_HANDOVER_FAULT_MOUNTS"  # environment variable: this process has mounts of its own

_FILE = "outcome.json"


def attempt(fault: Fault[Any], family: str, seed: int, folder: Path) -> Outcome:
    """Try a fault and return what came of it."""
    name = f"{family}/{fault.name}"
    own_mounts = OWN_MOUNTS in os.environ
    begin = monotonic()
    with ExitStack() as stack:
        domain = stack.enter_context(reserved_domain(None))
        trial = Trial(
            folder=folder,
            domain=domain,
            random=Random(f"{seed} {name}"),
            mark=os.environ[MARK],
            own_mounts=own_mounts,
        )
        if own_mounts:
            trial.mount(SHARED_MEMORY)
        status, reason, kept = Status.KEPT, "", None
        try:
            kept = fault.attempt(trial)
            left = wait_for_none(trial.mark)
            require(not left, f"left behind: {'; '.join(left.values())}")
            every_bag_is_usable(folder, damaged=fault.damages_bags)
        except CannotTry as reason_given:
            status, reason = Status.NOT_TRIED, str(reason_given)
        except (PromiseBroken, AssertionError) as broken:
            status, reason = Status.BROKEN, str(broken) or _place(broken)
        except TimeoutExpired as late:
            status, reason = Status.BROKEN, f"{late.cmd[0]} hung for {late.timeout:g} s"
        except Exception as error:  # whatever else it raises is no promise kept either
            status, reason = Status.BROKEN, f"{type(error).__name__}: {error} {_place(error)}"
            traceback.print_exc()
        return Outcome(
            fault=name,
            status=status,
            reason=" ".join(reason.split()),
            exit_code=kept.exit_code if kept else None,
            lost=kept.lost if kept else Loss(),
            note=kept.note if kept else "",
            shared_memory=shared_memory() if own_mounts else None,
            wall_s=monotonic() - begin,
        )


def write_outcome(outcome: Outcome, folder: Path) -> None:
    """Leave an outcome for the process that asked for it."""
    (folder / _FILE).write_text(to_json(outcome), encoding="utf-8")


def read_outcome(folder: Path) -> Outcome | None:
    """Return the outcome in a folder, None if there is none."""
    try:
        return from_json((folder / _FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def to_json(outcome: Outcome) -> str:
    """Return an outcome as a line of JSON."""
    return json.dumps({**asdict(outcome), "status": outcome.status.name})


def from_json(text: str) -> Outcome:
    """Return the outcome in a line of JSON."""
    values = json.loads(text)
    return Outcome(**{**values, "status": Status[values["status"]], "lost": Loss(**values["lost"])})


def _place(error: BaseException) -> str:
    """Return the file and line in which an error was raised."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return f"({Path(frame.filename).name}:{frame.lineno})"
