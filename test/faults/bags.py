"""Bags that were damaged after they had been recorded, and what every command says to them."""

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

from sms_handover.bag.files import read_messages
from sms_handover.bag.repair.check import check
from sms_handover.bag.repair.findings import Severity

from ..ros.short_handover import short_handover
from ..system.runs import Ended
from .fault import Fault
from .outcome import Kept, Loss, require
from .promises import exit_code
from .trial import Trial

TITLE = "Damaged bags"

_STRETCH = 2.0  # [-] of the short handover: 0.7 s of simulated time
_PAGE = 4096  # [byte] that a system writes at once
_READERS = (  # commands that need a whole bag: they read it, or refuse in one line
    ("bag", "info", "run"),
    ("bag", "export", "run", "-o", "tables"),
    ("compare", "run"),
    ("verify", "run"),
    ("report", "run", "-o", "report"),
    ("bag", "play", "run", "--rate", "100", "--disable-keyboard-controls"),
)

Damage = Callable[[Trial, Path], None]
Messages = dict[tuple[str, int, int], bytes]


def damaged(damage: Damage, trial: Trial) -> Messages:
    """Record a short run, and damage its bag; return the messages that were in it."""
    schedule = trial.folder / "schedule.yaml"
    schedule.write_text(short_handover(stretch=_STRETCH), encoding="utf-8")
    exit_code(trial.sms_handover("run", "--schedule", schedule, "-o", "run"), 0)
    bag = trial.folder / "run" / "bag"
    before = _messages(bag)
    damage(trial, bag / "bag_0.mcap")
    return before


def told_and_recovered(trial: Trial, before: Messages) -> Kept:
    """Require that it is noticed, that no reader trips over it, and that a recovery invents nothing."""
    checked = trial.sms_handover("bag", "check", "run")
    exit_code(checked, 1, 3)
    _in_words("bag check", checked)
    _readers_speak_in_words(trial)
    recovered = trial.sms_handover("bag", "recover", "run", "-o", "new")
    _in_words("bag recover", recovered)
    exit_code(recovered, 0, 1, 3)
    if recovered.code == 1:
        require(not (trial.folder / "new").exists(), "a recovery that failed has left something")
        return Kept(checked.code, Loss(len(before)), note="nothing could be recovered, and that is said")
    after = _messages(trial.folder / "new")
    invented = [key for key, data in after.items() if before.get(key) != data]
    require(not invented, f"{len(invented)} messages were never recorded: {invented[:3]}")
    left = [f.text for f in check(trial.folder / "new").findings if f.severity is Severity.DAMAGED]
    require(not left, f"the recovered bag is damaged: {left[:1]}")
    lost = len(before) - len(after)
    require(recovered.code == 3 or lost == 0, f"{lost} messages are lost, but the exit code is 0")
    return Kept(checked.code, Loss(messages=lost))


def _readers_speak_in_words(trial: Trial) -> None:
    """Require of every command an orderly end: its work done, or one line."""
    for words in _READERS:
        ended = trial.sms_handover(*words)
        name = " ".join(words[:2] if words[0] == "bag" else words[:1])
        _in_words(name, ended)
        require(ended.code in (0, 1, 2, 3), f"{name} ended with {ended.code}: {ended.err[-200:]}")
        if ended.code in (1, 2):
            require(len(ended.errors) == 1, f"{name} says {len(ended.errors)} errors: {ended.err[-300:]}")


def _in_words(name: str, ended: Ended) -> None:
    """Require that a command has not tripped."""
    require("Traceback" not in ended.err, f"{name} ends in a traceback: {ended.err[-300:]}")


def _messages(bag: Path) -> Messages:
    """Return the messages of a bag by topic, publish time and how often both were there before."""
    found: Messages = {}
    for message in read_messages(bag):
        number = 0
        while (message.topic, message.publish_time_ns, number) in found:
            number += 1
        found[message.topic, message.publish_time_ns, number] = message.data
    return found


def cut(trial: Trial, file: Path) -> None:
    """Cut the file off at a random place."""
    os.truncate(file, trial.random.randrange(1, file.stat().st_size))


def flip_bits(trial: Trial, file: Path) -> None:
    """Flip some bits anywhere."""
    content = bytearray(file.read_bytes())
    for _ in range(trial.random.randint(1, 8)):
        content[trial.random.randrange(len(content))] ^= 1 << trial.random.randrange(8)
    file.write_bytes(content)


def lose_pages(trial: Trial, file: Path) -> None:
    """Put zeros where some pages were, as after a power loss."""
    content = bytearray(file.read_bytes())
    for _ in range(trial.random.randint(1, 4)):
        begin = trial.random.randrange(max(1, len(content) // _PAGE)) * _PAGE
        end = min(begin + _PAGE, len(content))
        content[begin:end] = bytes(end - begin)
    file.write_bytes(content)


def zero_end(trial: Trial, file: Path) -> None:
    """Put zeros at the end, of the same length, as file systems do that write the size first."""
    content = file.read_bytes()
    begin = trial.random.randrange(len(content) // 4, len(content))
    file.write_bytes(content[:begin] + bytes(len(content) - begin))


def swap_parts(trial: Trial, file: Path) -> None:
    """Swap two parts of the file."""
    content = file.read_bytes()
    a, b, c = sorted(trial.random.sample(range(len(content)), 3))
    file.write_bytes(content[:a] + content[b:c] + content[a:b] + content[c:])


def insert_noise(trial: Trial, file: Path) -> None:
    """Put random bytes somewhere in between."""
    content = file.read_bytes()
    place = trial.random.randrange(len(content))
    file.write_bytes(content[:place] + trial.random.randbytes(1000) + content[place:])


def replace_by_noise(trial: Trial, file: Path) -> None:
    """Put random bytes in the place of all."""
    file.write_bytes(trial.random.randbytes(file.stat().st_size))


def empty(trial: Trial, file: Path) -> None:
    """Empty the file."""
    file.write_bytes(b"")


def remove(trial: Trial, file: Path) -> None:
    """Remove the file; the folder and metadata.yaml stay."""
    file.unlink()


def spoil_metadata(trial: Trial, file: Path) -> None:
    """Put noise, or YAML of another kind, in the place of metadata.yaml."""
    other = [trial.random.randbytes(500), b"- 1\n", b"rosbag2_bagfile_information: {}\n", b"a: [\n", b"\x00"]
    (file.parent / "metadata.yaml").write_bytes(trial.random.choice(other))


def make_pipe(trial: Trial, file: Path) -> None:
    """Put a pipe in the place of the file, from which nobody will ever send anything."""
    file.unlink()
    os.mkfifo(file)


_DAMAGES: tuple[tuple[str, str, Damage, bool], ...] = (
    ("cut", "the file is cut off at a random place", cut, True),
    ("bits-flipped", "1 to 8 random bits are flipped", flip_bits, True),
    ("pages-lost", "1 to 4 pages of 4 KiB read as zeros", lose_pages, True),
    ("end-of-zeros", "from a random place on the file is zeros", zero_end, True),
    ("parts-swapped", "two random parts of the file are swapped", swap_parts, True),
    ("noise-inserted", "1000 random bytes are inserted at a random place", insert_noise, True),
    ("all-noise", "the file is random bytes", replace_by_noise, True),
    ("empty", "the file is empty", empty, False),
    ("file-gone", "the file is gone, the folder is there", remove, False),
    ("metadata-spoiled", "`metadata.yaml` is noise or something else", spoil_metadata, True),
    ("pipe", "the file is a pipe that nobody writes to", make_pipe, False),
)

FAULTS = tuple(
    Fault(
        name=name,
        injected=injected,
        promise="`bag check` notices; info, export, compare, verify, report, play work or refuse in one "
        "line; `bag recover` invents no message and says what is lost",
        inject=partial(damaged, damage),
        check=told_and_recovered,
        seeded=seeded,
        damages_bags=True,
    )
    for name, injected, damage, seeded in _DAMAGES
)
