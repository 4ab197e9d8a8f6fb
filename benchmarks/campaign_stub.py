"""Stub of the process that carries out cases: answers each task after a given time, without a simulation."""

import json
import sys
import time
from argparse import ArgumentParser


def main() -> None:
    """Answer tasks until standard input ends."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("seconds", type=float, help="[s] that a case takes")
    seconds = parser.parse_args().seconds
    sys.stdin.readline()  # the campaign
    _answer({"ready": 0})
    for line in sys.stdin:
        time.sleep(seconds)
        _answer({"row": row_text(*json.loads(line)), "beside": {"cpu": 0.0, "wall": seconds, "host": "stub"}})


def row_text(case: int, scenario: str, law: str) -> str:
    """Return a row as large as that of a case with five draws."""
    row = {
        "task": [case, scenario, law],
        "seed": 2**52 + case,
        "inputs": {f"truth.robot.base.value_{k}": 240.0 + case / 7.0 + k for k in range(5)},
        "status": "succeeded",
        "cause": "",
        "metrics": {f"metric_number_{k}": 1.0 / (case + k + 3.0) for k in range(18)},
        "run_digest": "0" * 64,
    }
    return json.dumps(row)


def _answer(value: object) -> None:
    print(json.dumps(value), flush=True)


if __name__ == "__main__":
    main()
