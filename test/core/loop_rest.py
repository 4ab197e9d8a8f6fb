"""The rest of a run as a digest of everything observed; run as a program it restores snapshots afresh."""

import hashlib
import json
import subprocess
import sys
from collections.abc import Collection
from pathlib import Path

from sms_handover.simulation.loop import Loop
from sms_handover.simulation.observed_ticks import Observation
from sms_handover.simulation.scenario import Overrides, load_scenario
from sms_handover.simulation.snapshot import load_snapshot, plain, save_snapshot


def bytes_of(tick: Observation) -> bytes:
    """Return all that a tick shows, to the last bit."""
    arrays = (tick.q, tick.v, tick.joint_effort, tick.effort)
    period = json.dumps(plain((tick.guidance, tick.period))) if tick.period else ""
    told = f"{tick.stamp_ns} {tick.excesses} {period}"
    return b"".join([told.encode(), *(array.tobytes() for array in arrays)])


def digest_of_rest(loop: Loop) -> str:
    """Advance a loop to its end and return the digest of what it showed."""
    digest = hashlib.sha256()
    while not loop.finished:
        digest.update(bytes_of(loop.advance()))
    return digest.hexdigest()


def digests_of_rests(overrides: Overrides, ticks: Collection[int], folder: Path) -> list[tuple[str, str]]:
    """Return the digests of the rest of a run from each of these ticks on: uninterrupted, and restored.

    The snapshots go through files in ``folder`` to one process that does nothing else.
    """
    loop, shown = Loop(load_scenario("colliding", overrides)), list[bytes]()
    files: dict[int, Path] = {}
    while not loop.finished:
        if len(shown) in ticks:
            files[len(shown)] = folder / f"{len(shown)}.json"
            save_snapshot(loop.snapshot(), files[len(shown)])
        shown.append(bytes_of(loop.advance()))
    expected = [hashlib.sha256(b"".join(shown[tick:])).hexdigest() for tick in files]
    command = [sys.executable, __file__, json.dumps(overrides), *map(str, files.values())]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return list(zip(expected, done.stdout.split(), strict=True))


def main(overrides: str, files: list[str]) -> None:
    """Print the digest of the rest from each snapshot, all in one loop."""
    loop = Loop(load_scenario("colliding", json.loads(overrides)))
    for file in files:
        loop.restore(load_snapshot(Path(file)))
        print(digest_of_rest(loop))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
