"""Fuzzes one target in this process for so long, within bounds on time and memory of every input."""

import resource
import signal
import tempfile
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from pathlib import Path
from time import monotonic
from types import FrameType

from hypothesis import HealthCheck, Phase, given, seed, settings

from sms_handover.errors import SmsHandoverError

from .mutations import mutated
from .targets import Target

LONGEST_S = 10.0  # [s] of processor time for one input; the slowest good one takes a twentieth
MOST_MEMORY = 2**31  # [byte] of address space beyond what the process has at the start
_ROUND = 50  # inputs between two looks at the clock


class TooSlow(Exception):
    """An input took longer than allowed."""


@dataclass
class Tally:
    """What came of the inputs: how many, refused by an error of ours, and those that broke the reader.

    ``broken`` has the place of each failure with the smallest input that leads to it, as hex.
    """

    inputs: int = 0
    refused: int = 0
    slowest_s: float = 0.0  # of wall time
    seconds: float = 0.0
    memory_mb: float = 0.0
    broken: dict[str, str] = field(default_factory=dict)

    def as_json(self) -> dict[str, object]:
        """Return it as plain data."""
        return asdict(self)


@contextmanager
def bounded(longest_s: float = LONGEST_S) -> Iterator[None]:
    """Raise TooSlow in what takes longer of processor time."""
    before = signal.signal(signal.SIGVTALRM, _too_slow)
    signal.setitimer(signal.ITIMER_VIRTUAL, longest_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def limit_memory() -> None:
    """Let this process have only so much more memory than it has now."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    most = pages * resource.getpagesize() + MOST_MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def fuzz(target: Target, seconds: float, start_seed: int, current: Path) -> Tally:
    """Fuzz a target; ``current`` always holds the input at work, for when the process dies of it."""
    tally = Tally()
    begin = monotonic()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)

        def attempt(data: bytes) -> None:
            current.write_bytes(data)
            tally.inputs += 1
            since = monotonic()
            try:
                with bounded():
                    target.run(data, place)
            except SmsHandoverError:
                tally.refused += 1
            except Exception as error:
                _keep(tally, error, data)
            tally.slowest_s = max(tally.slowest_s, monotonic() - since)

        round_seed = start_seed
        while monotonic() - begin < seconds:
            _round(target, attempt, round_seed)
            round_seed += 1
    tally.seconds = monotonic() - begin
    tally.memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return tally


def _round(target: Target, attempt: Callable[[bytes], None], round_seed: int) -> None:
    """Try some inputs that one seed leads to."""
    strategy = mutated(target.corpus)
    options = settings(
        max_examples=_ROUND,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    seed(round_seed)(options(given(strategy)(attempt)))()


def _keep(tally: Tally, error: Exception, data: bytes) -> None:
    """Keep the smallest input that leads to an error at a place."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if "sms_handover" in frame.filename] or frames
    where = (
        f"{type(error).__name__} at {Path(ours[-1].filename).name}:{ours[-1].lineno}: {str(error)[:100]!r}"
    )
    if where not in tally.broken or len(data) < len(tally.broken[where]) // 2:
        tally.broken[where] = data.hex()


def digest(data: bytes) -> str:
    """Return a short name for an input."""
    return sha256(data).hexdigest()[:12]


def _too_slow(number: int, frame: FrameType | None) -> None:
    raise TooSlow(f"an input took more than {LONGEST_S:g} s of processor time")
