"""How fast a recorded run can be played into a fresh recorder, with every message the same byte for byte.

``python -m benchmarks.playback [RUN]`` plays a run of yours; without one a whole handover is recorded first.
"""

import re
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.results import Result, Table, publish, row
from sms_handover.bag.info import read_info
from sms_handover.bag.time_order import messages_by_time
from sms_handover.launcher.domain import reserved_domain
from sms_handover.launcher.run_folder import bag_of
from sms_handover.units import ns_to_seconds

RATES = (1.0, 5.0, 100.0)
_COMMAND = (sys.executable, "-m", "sms_handover.cli.main")
_ROUND_UP = 4  # [byte] to a multiple of which the wire fills up a message with zeros
_SENT = re.compile(r"(\d+) messages sent in ([\d.]+) s")
_LATE = re.compile(r"none later than (\d+) ms|up to ([\d.]+) s late")
_NOT_PLAYED = re.compile(r"^not played: ([^:]+):", re.MULTILINE)


def contents(bag: Path) -> dict[str, list[bytes]]:
    """Return the bytes of the messages of a bag by topic, filled up as the wire does."""
    found: dict[str, list[bytes]] = {}
    for message in messages_by_time(bag):
        found.setdefault(message.topic, []).append(message.data + b"\0" * (-len(message.data) % _ROUND_UP))
    return found


def played(run: Path, folder: Path, rate: float, domain: int) -> str:
    """Play a run into a recorder that writes to ``folder``; return what the player said of it."""
    in_domain = ("--domain-id", str(domain))
    with subprocess.Popen(
        [*_COMMAND, "bag", "record", "--all", "-o", str(folder), *in_domain],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as recorder:
        player = [*_COMMAND, "bag", "play", str(run), "--rate", str(rate), "--wait", "60", *in_domain]
        done = subprocess.run(player, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)
        recorder.send_signal(signal.SIGINT)
    if done.returncode not in (0, 3) or recorder.returncode:  # 3: types that are not installed
        raise RuntimeError(f"playing ended with {done.returncode}, recording with {recorder.returncode}")
    return done.stdout + done.stderr


def measured(run: Path, rate: float, domain: int) -> tuple[str, ...]:
    """Return the row of one rate."""
    original = contents(bag_of(run))
    duration_s = ns_to_seconds(read_info(bag_of(run)).duration_ns)
    with TemporaryDirectory() as name:
        told = played(run, Path(name) / "again", rate, domain)
        again = contents(Path(name) / "again")
    sent, took = _SENT.findall(told)[0]
    late_ms, late_s = _LATE.findall(told)[0]
    topics = original.keys() - set(_NOT_PLAYED.findall(told))
    same = sum(original[topic] == again.get(topic) for topic in topics)
    return row(
        f"{rate:g}",
        duration_s / float(took),
        f"{float(late_ms or 0) + 1000 * float(late_s or 0):.0f}",
        sent,
        str(sum(len(again.get(topic, ())) for topic in topics)),
        f"{same} of {len(topics)}",
    )


def main() -> None:
    """Measure and publish."""
    with TemporaryDirectory() as name, reserved_domain(None) as domain:
        run = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(name) / "run"
        if len(sys.argv) == 1:
            subprocess.run([*_COMMAND, "run", "-o", str(run)], check=True, capture_output=True)
        rows = [measured(run, rate, domain) for rate in RATES]
    heading = ("rate", "achieved", "latest message [ms late]", "sent", "recorded", "topics byte for byte")
    publish(
        Result(
            name="playback",
            question="How fast can a recorded run be played into a recorder without a loss?",
            notes=[
                "Two processes over DDS, player and recorder. A rate of 100 asks for more than there is. "
                "Topics of types that are not installed are left out.",
            ],
            tables=[Table(heading, rows)],
        )
    )


if __name__ == "__main__":
    main()
