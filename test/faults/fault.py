"""The fault campaign: every promise that the graph makes when a part of it fails, tried one by one.

``make faults`` tries all of them and writes docs/reliability.md; ``python test/faults --help`` tells how
to try some. (Not ``python -m test.faults``: Python has a package ``test`` of its own.)

**To add a fault** write it into the table of its family, a file of this folder such as ``processes.py``;
a new file is a new family, found by itself. A table is two names::

    TITLE = "Processes that die"  # heading on the page
    FAULTS = (
        Fault(
            name="plant-killed",  # lower case with hyphens; --only processes/plant-killed tries it alone
            injected="SIGKILL of the plant at a random moment",
            promise="the run ends with 1 and names it; the bag holds all that it published",
            inject=kill_plant,
            check=died_and_bag_is_whole,
            seeded=True,  # it draws from trial.random
        ),
    )

``inject(trial)`` does it and returns what was seen, mostly how a command ended::

    def kill_plant(trial: Trial) -> Ended:
        with trial.start("run", "-o", "run") as run:
            run.until_recorded(trial.folder / "run" / "bag", 200_000)
            os.kill(run.nodes["plant"], signal.SIGKILL)
            return trial.ended(run)

``check(trial, seen)`` holds it against the promise and returns ``Kept``: exit code, what was lost of the
data, and a note where something is worth knowing. A promise is broken when it raises ``PromiseBroken``,
best by ``require(condition, "what was seen instead")``, or an AssertionError, or any other error.
``CannotTry(reason)``, from either, says that this machine does not have what it takes.

**Each fault is tried** in a process of its own with a folder of its own (``trial.folder``, also the
current folder of the commands), a session, a ROS domain (``trial.domain``) for nodes it starts itself,
random numbers (``trial.random``, from the seed of the campaign and the name) and, where the system
permits it, its own mounts with an empty /dev/shm: ``trial.mount`` puts a small file system somewhere and
nobody else sees it. After ``timeout_s`` everything is killed and the promise counts as broken.

**After each** these hold without asking, or the promise is broken: no process of it is left, found by an
environment variable and by its sessions; every bag in the folder is whole, or ``bag recover`` makes one
of it that is (``damages_bags=True`` where the fault is the damage). Shared memory that is left is noted.

The checks that many faults share are in ``promises.py``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from .outcome import Kept
from .trial import Trial

Seen = TypeVar("Seen")


@dataclass(frozen=True)
class Fault(Generic[Seen]):
    """One row of the campaign.

    ``seeded`` says that it draws from the trial's random numbers, so that another seed tries something else.
    """

    name: str
    injected: str
    promise: str
    inject: Callable[[Trial], Seen]
    check: Callable[[Trial, Seen], Kept]
    seeded: bool = False
    damages_bags: bool = False
    timeout_s: float = 600.0  # [s] of wall time, on a machine that is very busy; nothing is measured by it

    def attempt(self, trial: Trial) -> Kept:
        """Inject it and return what was kept; raises PromiseBroken or CannotTry."""
        return self.check(trial, self.inject(trial))


@dataclass(frozen=True)
class Family:
    """The faults of one file."""

    name: str
    title: str
    faults: tuple[Fault[Any], ...]
