"""A disk that is full, slow, gone or not allowed, at several moments of a run."""

import shutil
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from time import sleep

from benchmarks.recorder_kill import Witness

from ..ros.short_handover import short_handover
from ..system.runs import Ended, Running
from .fault import Fault
from .graph_run import domain_of
from .outcome import NOTHING_LOST, CannotTry, Kept, Loss, require
from .promises import exit_code, lost_since, one_line, readable, refused, whole
from .trial import Trial

TITLE = "Disk and folders"

_BOUND_MS = 50.0  # [ms] of simulated time: the plant goes no further ahead of what has been written
_UNDER_WAY = (200_000, 900_000)  # [byte] of the bag at which a fault comes: within some seconds of a run
_STALL_S = 3.0  # [s] of wall time for which the disk takes nothing
_SHORT_S = 6.0  # [-] stretch of the short handover: two seconds of simulated time
_NO_RIGHTS = ("setpriv", "--bounding-set=-dac_override,-dac_read_search")  # root as anybody else is


def schedule(trial: Trial) -> Path:
    """Return a schedule of two seconds in which both grasps succeed."""
    path = trial.folder / "schedule.yaml"
    path.write_text(short_handover(stretch=_SHORT_S), encoding="utf-8")
    return path


def watched(trial: Trial, output: Path, *more: object) -> tuple[Ended, int]:
    """Run until it ends by itself; return how, and the newest state [ns] that had been published."""
    with trial.start("run", "-o", output, *more) as run:
        witness = Witness(domain_of(run))
        try:
            while run.process.poll() is None:
                witness.newest_ns()  # takes what has come: a reader that keeps all would hold the loop up
                sleep(0.01)
            return trial.ended(run), witness.newest_ns()
        finally:
            witness.close()


def under_way(act: Callable[[Trial, Running], None], trial: Trial, *arguments: object) -> Ended:
    """Run, do something at a random moment, and wait for the end."""
    with trial.start("run", "-o", "run", *arguments) as run:
        run.until_recorded(trial.folder / "run" / "bag", trial.random.randint(*_UNDER_WAY))
        act(trial, run)
        return trial.ended(run)


# Full


def fill_under_way(trial: Trial) -> tuple[Ended, int]:
    """Record onto a file system with little room."""
    trial.mount(trial.folder / "small", size=f"{trial.random.randint(400, 1500)}k")
    return watched(trial, trial.folder / "small" / "run")


def fill_at_start(trial: Trial) -> Ended:
    """Record onto a file system with next to no room."""
    trial.mount(trial.folder / "small", size=f"{trial.random.choice((4, 8, 16))}k")
    return trial.sms_handover("run", "-o", "small/run")


def fill_at_end(trial: Trial) -> tuple[Ended, int]:
    """Record onto a file system on which the end of the bag has no room: ledger, index, metadata.yaml."""
    whole_run = ("run", "--schedule", schedule(trial))
    first = trial.sms_handover(*whole_run, "-o", "first")
    exit_code(first, 0)
    size = sum(file.stat().st_size for file in (trial.folder / "first").rglob("*") if file.is_file())
    room = size // 1024 - trial.random.randint(5, 60)
    trial.mount(trial.folder / "small", size=f"{room}k")
    return watched(trial, trial.folder / "small" / "run", *whole_run[1:])


def limit_size(trial: Trial) -> tuple[Ended, int]:
    """Let the system refuse files beyond a size."""
    blocks = trial.random.randint(500_000, 1_500_000)
    output = trial.folder / "small" / "run"
    output.parent.mkdir()
    with trial.start("run", "-o", output, prefix=("prlimit", f"--fsize={blocks}")) as run:
        return trial.ended(run), -1


def fill_at_seam(trial: Trial) -> tuple[Ended, int]:
    """Record onto a file system with little room, in files of one second."""
    trial.mount(trial.folder / "small", size=f"{trial.random.randint(800, 2500)}k")
    return watched(trial, trial.folder / "small" / "run", "-p", "recorder.split_duration:=1")


def ends_full(reason: str, trial: Trial, seen: tuple[Ended, int]) -> Kept:
    """Require one line that tells why, and that what had been published is there but for the last 50 ms."""
    ended, published_ns = seen
    exit_code(ended, 1)
    require("Traceback" not in ended.err, "a traceback")
    said = reason in ended.err or (_NO_LOG in ended.err and reason == _FULL)
    require(said, f"{reason!r} is not said: {ended.err[-300:]}")
    path = readable(trial, trial.folder / "small" / "run" / "bag")
    lost = lost_since(path, published_ns, bound_ms=_BOUND_MS) if published_ns >= 0 else Loss()
    return Kept(ended.code, lost)


def fails_in_words(trial: Trial, ended: Ended) -> Kept:
    """Require one line and a code that tells failure; nothing had begun that could be lost."""
    exit_code(ended, 1, 2)
    one_line(ended)
    return Kept(ended.code, NOTHING_LOST)


def fill_inodes(trial: Trial) -> Ended:
    """Record onto a file system that takes only a few more files."""
    trial.mount(trial.folder / "small", inodes=trial.random.randint(2, 7))
    return trial.sms_handover("run", "-o", "small/run")


def recover_onto_full(trial: Trial) -> Ended:
    """Recover a bag onto a file system that is too small for it."""
    exit_code(trial.sms_handover("run", "--schedule", schedule(trial), "-o", "run"), 0)
    trial.mount(trial.folder / "small", size="100k")
    return trial.sms_handover("bag", "recover", "run", "-o", "small/new")


def leaves_nothing(trial: Trial, ended: Ended) -> Kept:
    """Require one line, and no half of a bag."""
    exit_code(ended, 1)
    one_line(ended, "No space left on device")
    require(not list((trial.folder / "small").iterdir()), "something is left on the full disk")
    return Kept(ended.code, NOTHING_LOST)


# Not allowed


def read_only(trial: Trial) -> Ended:
    """Give an output folder on a file system that is read-only."""
    trial.mount(trial.folder / "fixed", read_only=True)
    return trial.sms_handover("run", "-o", "fixed/run")


def no_permission(trial: Trial) -> Ended:
    """Give an output folder in a folder that may not be written."""
    (trial.folder / "locked").mkdir(mode=0o555)
    prefix = _NO_RIGHTS if trial.is_root else ()
    return trial.sms_handover("run", "-o", "locked/run", prefix=prefix)


def long_name(trial: Trial) -> Ended:
    """Give an output folder whose name no file system takes."""
    return trial.sms_handover("run", "-o", "n" * trial.random.randint(256, 3000))


def existing(trial: Trial) -> Ended:
    """Give an output folder that an earlier run has made."""
    arguments = ("run", "--schedule", schedule(trial), "--duration", "0.1", "-o", "run")
    exit_code(trial.sms_handover(*arguments), 0)
    before = (trial.folder / "run" / "bag" / "bag_0.mcap").read_bytes()
    ended = trial.sms_handover(*arguments)
    require((trial.folder / "run" / "bag" / "bag_0.mcap").read_bytes() == before, "the first bag has changed")
    return ended


def no_temporary_folder(trial: Trial) -> Ended:
    """Let no folder for temporary files be writable, where domains are reserved."""
    trial.mount(trial.folder / "fixed", read_only=True)
    for place in ("/tmp", "/var/tmp", "/usr/tmp"):
        if Path(place).is_dir() and not trial.folder.is_relative_to(place):
            trial.mount(Path(place), read_only=True)
    return trial.sms_handover(
        "run", "--schedule", schedule(trial), "-o", "run", environment={"TMPDIR": str(trial.folder / "fixed")}
    )


def is_refused(*words: str) -> Callable[[Trial, Ended], Kept]:
    """Require exit code 2 and one line with some words."""
    return lambda trial, ended: refused(ended, *words)


# Gone, moved, slow


def delete_bag(trial: Trial, run: Running) -> None:
    """Delete the bag while it is being written."""
    shutil.rmtree(trial.folder / "run" / "bag")


def delete_all(trial: Trial, run: Running) -> None:
    """Delete the whole output folder."""
    shutil.rmtree(trial.folder / "run")


def move_bag(trial: Trial, run: Running) -> None:
    """Move the bag away."""
    (trial.folder / "run" / "bag").rename(trial.folder / "moved")


def move_all(trial: Trial, run: Running) -> None:
    """Move the whole output folder away."""
    (trial.folder / "run").rename(trial.folder / "moved")


def says_deleted(trial: Trial, ended: Ended) -> Kept:
    """Require that the run ended and says why; the bag is gone, which nobody can help."""
    exit_code(ended, 1)
    require("Traceback" not in ended.err, "a traceback")
    require("it was deleted while it was being written" in ended.err, f"not said why: {ended.err[-300:]}")
    return Kept(ended.code, note="the bag was deleted, and all in it")


def is_whole(bag: str, trial: Trial, ended: Ended) -> Kept:
    """Require a complete bag at a place."""
    return whole(trial.folder / bag, ended)


def stall(arguments: Sequence[object], trial: Trial) -> Ended:
    """Record onto a disk that takes nothing for some seconds."""
    place = _own_disk(trial)
    with trial.start("run", "-o", place / "run", *arguments) as run:
        run.until_recorded(place / "run" / "bag", trial.random.randint(*_UNDER_WAY))
        try:
            trial.command(["fsfreeze", "--freeze", place])
            sleep(_STALL_S)
        finally:
            trial.command(["fsfreeze", "--unfreeze", place])
        return trial.ended(run)


def _own_disk(trial: Trial) -> Path:
    """Return a file system with a disk of its own, which can be made to stall."""
    image, place = trial.folder / "disk.img", trial.folder / "disk"
    place.mkdir()
    with image.open("wb") as file:
        file.truncate(200_000_000)
    for command in (["mkfs.ext4", "-q", image], ["mount", "-o", "loop", image, place]):
        try:
            done = trial.command(command)
        except FileNotFoundError:
            raise CannotTry(f"there is no {command[0]}") from None
        if not trial.own_mounts or done.code:
            raise CannotTry(f"{command[0]}: {done.err.strip()}")
    return place


_FULL = "No space left on device"
_NO_LOG = "is full, so its log may be cut short"  # where the log of the recorder had no room for the reason
_SHORT = ("--duration", "8")  # [s] of the shipped schedule: enough to be in the middle of it

FAULTS = (
    Fault(
        name="full-at-start",
        injected="the disk has 4 to 16 KiB left when the run begins",
        promise="exit code 1 or 2 and one line",
        inject=fill_at_start,
        check=fails_in_words,
        seeded=True,
    ),
    Fault(
        name="full-under-way",
        injected="the disk is full at a random moment",
        promise="exit code 1 and the reason; `bag recover` makes a bag without a gap, at most 50 ms behind",
        inject=fill_under_way,
        check=partial(ends_full, _FULL),
        seeded=True,
    ),
    Fault(
        name="full-at-end",
        injected="the disk has no room for the end of the bag: ledger, index or `metadata.yaml`",
        promise="exit code 1 and the reason; no message is lost in a recovery",
        inject=fill_at_end,
        check=partial(ends_full, _FULL),
        seeded=True,
    ),
    Fault(
        name="full-in-several-files",
        injected="the disk is full at a random moment of a recording in files of 1 s",
        promise="exit code 1 and the reason; the files before are whole, at most 50 ms are lost",
        inject=fill_at_seam,
        check=partial(ends_full, _FULL),
        seeded=True,
    ),
    Fault(
        name="file-size-limit",
        injected="a file may not grow beyond a random size (RLIMIT_FSIZE)",
        promise="exit code 1 and the reason; `bag recover` makes a bag without a gap",
        inject=limit_size,
        check=partial(ends_full, "File too large"),
        seeded=True,
    ),
    Fault(
        name="inodes-full",
        injected="the file system takes one to six more files or folders",
        promise="exit code 1 or 2 and one line",
        inject=fill_inodes,
        check=fails_in_words,
        seeded=True,
    ),
    Fault(
        name="full-in-recovery",
        injected="`bag recover` onto a disk that is too small",
        promise="exit code 1 and one line; no half of a bag is left",
        inject=recover_onto_full,
        check=leaves_nothing,
    ),
    Fault(
        name="read-only",
        injected="the output folder is on a file system that is read-only",
        promise="exit code 2 and one line before anything is started",
        inject=read_only,
        check=is_refused("Read-only file system"),
    ),
    Fault(
        name="no-permission",
        injected="the output folder is in a folder without write permission",
        promise="exit code 2 and one line before anything is started",
        inject=no_permission,
        check=is_refused("Permission denied"),
    ),
    Fault(
        name="name-too-long",
        injected="the name of the output folder is longer than file systems take",
        promise="exit code 2 and one line before anything is started",
        inject=long_name,
        check=is_refused("File name too long"),
        seeded=True,
    ),
    Fault(
        name="folder-exists",
        injected="a second run into the folder of a first",
        promise="exit code 2 and one line; the first bag is untouched",
        inject=existing,
        check=is_refused("exists"),
    ),
    Fault(
        name="no-temporary-folder",
        injected="no folder for temporary files can be written",
        promise="the run works, or ends with exit code 2 and one line",
        inject=no_temporary_folder,
        check=lambda trial, ended: refused(ended) if ended.code else is_whole("run/bag", trial, ended),
    ),
    Fault(
        name="bag-deleted",
        injected="the folder of the bag is deleted at a random moment",
        promise="exit code 1 within 20 ms of simulated time, and it is said",
        inject=partial(under_way, delete_bag),
        check=says_deleted,
        seeded=True,
    ),
    Fault(
        name="output-deleted",
        injected="the whole output folder is deleted at a random moment",
        promise="exit code 1 within 20 ms of simulated time, no traceback",
        inject=partial(under_way, delete_all),
        check=says_deleted,
        seeded=True,
    ),
    Fault(
        name="bag-moved",
        injected="the folder of the bag is moved at a random moment",
        promise="exit code 0; the bag is completed where it is then, nothing is lost",
        inject=lambda trial: under_way(move_bag, trial, *_SHORT),
        check=partial(is_whole, "moved"),
        seeded=True,
    ),
    Fault(
        name="output-moved",
        injected="the whole output folder is moved at a random moment",
        promise="exit code 0; the bag is completed where it is then, nothing is lost",
        inject=lambda trial: under_way(move_all, trial, *_SHORT),
        check=partial(is_whole, "moved/bag"),
        seeded=True,
    ),
    Fault(
        name="stalls",
        injected="the disk takes nothing for 3 s at a random moment of a run in lock step",
        promise="exit code 0; the run waits, nothing is lost",
        inject=partial(stall, _SHORT),
        check=partial(is_whole, "disk/run/bag"),
        seeded=True,
    ),
    Fault(
        name="stalls-in-real-time",
        injected="the disk takes nothing for 3 s at a random moment of a run in real time",
        promise="exit code 0; nothing is lost",
        inject=partial(stall, ("--real-time", "--duration", "8")),
        check=partial(is_whole, "disk/run/bag"),
        seeded=True,
    ),
)
