"""The rest of a run as a digest of everything observed; run as a program it restores snapshots afresh."""

import hashlib
import json
import sys
from pathlib import Path

from sms_handover.simulation.loop import Loop, Observation
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.snapshot import load_snapshot, plain


def bytes_of(tick: Observation) -> bytes:
    """Return all that a tick shows, to the last bit."""
    arrays = (tick.q, tick.v, tick.joint_effort, tick.effort)
    period = json.dumps(plain((tick.guidance, tick.period))) if tick.period else ""
    return b"".join([str(tick.stamp_ns).encode(), *(array.tobytes() for array in arrays), period.encode()])


def digest_of_rest(loop: Loop) -> str:
    """Advance a loop to its end and return the digest of what it showed."""
    digest = hashlib.sha256()
    while not loop.finished:
        digest.update(bytes_of(loop.advance()))
    return digest.hexdigest()


def main(overrides: str, files: list[str]) -> None:
    """Print the digest of the rest from each snapshot, all in one loop."""
    loop = Loop(load_scenario(values=json.loads(overrides)))
    for file in files:
        loop.restore(load_snapshot(Path(file)))
        print(digest_of_rest(loop))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
