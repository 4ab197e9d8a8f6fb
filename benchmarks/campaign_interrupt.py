"""Interrupt of a campaign: how long ``campaign run`` takes from Ctrl-C, in the middle of long cases."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from sms_handover.campaign.record.journal import JOURNAL

_LOOK_S = 0.02  # [s] between two looks at a journal
_INTERRUPTED = """\
name: interrupted
seed: 1
cases: 100
scenarios:
  first: {scenario: smooth, values: {common.duration: 0.04}}
  long: smooth
laws: [nmpc]
"""


def leaving(jobs: int) -> float:
    """Return the wall time in s from Ctrl-C, as of a terminal, to the end of a driver with long cases."""
    with tempfile.TemporaryDirectory() as scratch:
        file, out = Path(scratch) / "interrupted.yaml", Path(scratch) / "out"
        file.write_text(_INTERRUPTED, encoding="utf-8")
        words = [sys.executable, "-m", "sms_handover.cli.main", "campaign", "run", str(file)]
        with subprocess.Popen(
            [*words, "-o", str(out), "-j", str(jobs)], stderr=subprocess.DEVNULL, start_new_session=True
        ) as child:
            while not ((out / JOURNAL).exists() and (out / JOURNAL).read_bytes()):
                if child.poll() is not None:
                    raise SystemExit(f"a campaign to interrupt ended with {child.returncode}")
                time.sleep(_LOOK_S)
            os.killpg(child.pid, signal.SIGINT)
            begin = time.perf_counter()
            child.wait()
            return time.perf_counter() - begin
