"""One hostile attempt: a command with an input, an environment, streams and a folder that a seed draws.

Whatever they are, the command ends with one of its exit codes, and prints no traceback.
"""

import os
import shlex
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from random import Random
from shutil import copytree

from sms_handover.launcher.domain import reserved_domain

from ..fuzz.mutations import mutated_by
from ..fuzz.targets import TARGETS
from ..ros.short_handover import short_handover

CODES = (0, 1, 2, 3, 4, 130)  # that the commands promise
LONGEST_S = 180.0  # [s] of wall time after which a command hangs

_DATA = Path(__file__).resolve().parents[1] / "data"
_CASES = sorted(path for path in (_DATA / "cases").iterdir() if path.is_dir() or path.suffix == ".mcap")
_RUN = _DATA / "first_edition" / "nmpc"
_ODD_NAMES = (
    *(b"bag", b"l\xe4tin.mcap", "\u00e9t\u00e9 \U0001f916".encode(), b"new\nline", b"-o", b"a:=b"),
    b"%s{x}'\"$",
)
_STREAMS = {  # how a shell opens each of them; left alone it shows what is printed
    "stdin": ("", "<&-", "</dev/null", "</dev/zero"),
    "stdout": ("", "", ">&-", ">/dev/full"),
    "stderr": ("", "", "", "2>&-", "2>/dev/full"),
}
_ENVIRONMENT: Mapping[str, tuple[str | None, ...]] = {  # None: not set
    "HOME": (None, "", "/proc/none"),
    "ROS_LOG_DIR": ("/proc/none", ""),
    "ROS_HOME": ("/proc/none",),
    "RMW_IMPLEMENTATION": ("rmw_cyclonedds_cpp", "rmw_connextdds", ""),
    "ROS_DISCOVERY_SERVER": ("127.0.0.1:11811", "nonsense", ""),
    "PYTHONPATH": (":", "shadow:", "foreign", "/proc/none"),
    "PYTHONIOENCODING": ("ascii", "latin-1", "utf-16"),
    "LC_ALL": ("C", "de_DE.UTF-8", "nonsense", "POSIX"),
    "MPLBACKEND": ("module://matplotlib_inline.backend_inline", "TkAgg", "nonsense"),
    "TERM": ("dumb", "", "nonsense"),
    "COLUMNS": ("1", "-3", "nonsense"),
    "NO_COLOR": ("1",),
    "TMPDIR": ("/proc/none",),
    "XDG_CACHE_HOME": ("/proc/none",),
    "FASTDDS_BUILTIN_TRANSPORTS": ("UDPv4", "nonsense"),
    "ROS_LOCALHOST_ONLY": ("1", "nonsense"),
    "ROS_AUTOMATIC_DISCOVERY_RANGE": ("OFF", "nonsense"),
    "AMENT_PREFIX_PATH": ("/proc/none", ""),
    "TZ": ("nonsense",),
}
_FILES = ("schedule", "robot", "parameters")  # that a user writes
_SHADOWS = ("yaml", "numpy", "rclpy", "mcap", "sms_handover_interfaces")  # modules of a stranger


@dataclass(frozen=True)
class Attempt:
    """What one seed has drawn; ``streams`` are redirections of a shell."""

    words: tuple[str, ...]
    streams: str
    environment: Mapping[str, str | None]
    shadows: tuple[str, ...]

    def __str__(self) -> str:
        """Return it in a line that says how to try it again by hand."""
        changed = " ".join(f"{name}={value}" for name, value in self.environment.items())
        return ascii(f"{changed} sms-handover {shlex.join(self.words)} {self.streams}; beside {self.shadows}")


def drawn(seed: int, folder: Path) -> Attempt:
    """Return the attempt of a seed, with its inputs written into a folder."""
    random = Random(seed)
    verbs = list(_VERBS)
    words = _VERBS[verbs[seed % len(verbs)]](random, folder)  # every verb has its turn
    streams = " ".join(random.choice(ways) for ways in _STREAMS.values())
    names = random.sample(list(_ENVIRONMENT), random.randrange(5))
    environment = {name: random.choice(_ENVIRONMENT[name]) for name in names}
    shadows = tuple(random.sample(_SHADOWS, random.randrange(len(_SHADOWS))))
    return Attempt(tuple(words), streams, environment, shadows)


def fault_of(attempt: Attempt, folder: Path) -> str:
    """Carry out an attempt in a folder; return what it did that it must not, '' if nothing."""
    for name in attempt.shadows:
        (folder / f"{name}.py").write_text("raise RuntimeError('Traceback')\n", encoding="ascii")
    (folder / "foreign" / "rclpy").mkdir(parents=True)
    (folder / "shadow").mkdir()
    program = shlex.join([str(Path(sys.executable).with_name("sms-handover")), *attempt.words])
    with reserved_domain(None) as domain:
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), **attempt.environment}
        given = {name: value for name, value in environment.items() if value is not None}
        try:
            done = subprocess.run(
                ["sh", "-c", f"exec {program} {attempt.streams}"],
                cwd=folder,
                env=given,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=LONGEST_S,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return f"it has not ended after {LONGEST_S:g} s"
    said = (done.stdout + done.stderr).decode(errors="replace")
    if done.returncode not in CODES:
        return f"it ended with {done.returncode}: {said[-500:]}"
    return f"it printed {said[-1500:]}" if "Traceback" in said else ""


def _bag(random: Random, folder: Path) -> str:
    """Put a bag, or what is none, into a folder, mostly under an odd name; return its path."""
    place = folder / os.fsdecode(random.choice(_ODD_NAMES))
    kind = random.randrange(6)
    if kind < 2:
        source = random.choice((_RUN, *_CASES))
        if source.is_dir():
            copytree(source, place)
        else:
            place.write_bytes(source.read_bytes())
    elif kind == 2:
        place.write_bytes(mutated_by(random, [path.read_bytes() for path in _CASES if path.is_file()]))
    elif kind == 3:
        place.write_bytes(mutated_by(random, TARGETS["bag"].corpus))
    elif kind == 4:
        place.mkdir()
    return str(place if random.random() < 0.5 else place.relative_to(folder))


def _text(random: Random, folder: Path, target: str) -> str:
    """Put a file that is nearly right into a folder; return its path."""
    place = folder / os.fsdecode(random.choice(_ODD_NAMES[1:3]))
    place.write_bytes(mutated_by(random, TARGETS[target].corpus))
    return str(place)


def _scenario(random: Random, folder: Path) -> list[str]:
    """Return options of a short run, now and then with a file that is nearly right."""
    schedule = folder / "schedule.yaml"
    schedule.write_text(short_handover(), encoding="utf-8")
    options = ["--schedule", str(schedule)]
    for name, target in (("--schedule", "schedule"), ("--robot", "robot"), ("--params-file", "parameters")):
        if random.random() < 0.15:
            options += [name, _text(random, folder, target)]
    return [*options, *random.choice(([], ["--controller", "pid"], ["--duration", "0.1"], ["-p", "x"]))]


def _output(random: Random) -> str:
    return os.fsdecode(random.choice((b"out", b"l\xe4tin_out", b"new/out", b"/proc/none", b".", b"")))


def _bag_verb(*words: str, output: bool = False) -> Callable[[Random, Path], list[str]]:
    """Return what draws a command that reads a bag, and maybe writes something."""

    def draw(random: Random, folder: Path) -> list[str]:
        return [*words, _bag(random, folder), *(("-o", _output(random)) if output else ())]

    return draw


_VERBS: Mapping[str, Callable[[Random, Path], list[str]]] = {
    "info": _bag_verb("bag", "info"),
    "info as JSON": _bag_verb("bag", "info", "--json"),
    "check": _bag_verb("bag", "check"),
    "recover": _bag_verb("bag", "recover", output=True),
    "csv": _bag_verb("bag", "export", output=True),
    "parquet": _bag_verb("bag", "export", "--format", "parquet", output=True),
    "compare": _bag_verb("compare"),
    "figures": _bag_verb("report", "--figures", "out", "--format", "png"),
    "report": _bag_verb("report", output=True),
    "view": _bag_verb("view", "--no-browser", output=True),
    "list": lambda random, folder: ["list", *random.choice(([], ["metrics"], ["laws", "--json"], ["law"]))],
    "show": lambda random, folder: ["show", random.choice(("paper", "pid", "", _bag(random, folder)))],
    "check a file": lambda random, folder: ["check", _text(random, folder, random.choice(_FILES))],
    "old name": _bag_verb("reproduce"),
    "verify": _bag_verb("verify"),
    "play": _bag_verb("bag", "play", "--rate", "100", "--duration", "0.2", "--ack-timeout", "0.2"),
    "verify with plant": _bag_verb("verify", "--with", "plant"),
    "record": lambda random, folder: ["bag", "record", "--all", "--duration", "0.3", "-o", _output(random)],
    "simulate": lambda random, folder: ["simulate", *_scenario(random, folder), "-o", _output(random)],
    "run": lambda random, folder: ["run", *_scenario(random, folder), "-o", _output(random)],
}
