"""A process that answers tasks as that of cases does, without a simulation.

Case 1 hangs, 2 dies, 3 eats memory, when the campaign's name is ``bad``; every other case is done at once.
"""

import json
import os
import signal
import sys
import time

HANGS, DIES, EATS = 1, 2, 3
MOST = 40  # of 10 MB, should nobody stop it


def main() -> None:
    first = json.loads(sys.stdin.readline())
    bad = "name: bad" in first["files"]["campaign.yaml"]
    answer({"ready": os.getpid()})
    for line in sys.stdin:
        case, scenario, law = json.loads(line)
        if bad and case == HANGS:
            time.sleep(60.0)
        if bad and case == DIES:
            print("warning\ncase 2 dies", file=sys.stderr, flush=True)
            os.kill(os.getpid(), signal.SIGKILL)
        eaten: list[bytes] = []
        while bad and case == EATS and len(eaten) < MOST:
            eaten.append(b"x" * 10_000_000)
            time.sleep(0.001)
        if bad and case == EATS:
            time.sleep(10.0)
        row = {
            "task": [case, scenario, law],
            "seed": case,
            "inputs": {"x": float(case)},
            "status": "succeeded" if case % 4 else "mission failed",
            "cause": "" if case % 4 else f"missed by {case} mm",
            "metrics": {"grasp_error": 1e-3 * (case % 7)},
            "run_digest": "00",
        }
        answer({"row": json.dumps(row), "beside": {"cpu": 0.0, "wall": 0.001, "host": "stub"}})


def answer(value: object) -> None:
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
