"""The noise of the machine: a process that only wakes at absolute deadlines, as cyclictest does.

Run as a module, it prints how far its periods were off, as JSON: the 99th percentile and the largest, in us.
"""

import json
import sys
from time import monotonic, sleep

from sms_handover.ros.process.realtime import exact_timers

TICK_S = 1e-3  # [s]


def errors(duration_s: float) -> list[float]:
    """Return by how many s each period was off the tick, in rising order."""
    exact_timers()
    found = []
    last = monotonic()
    deadline = last + TICK_S
    for _ in range(round(duration_s / TICK_S)):
        sleep(max(deadline - monotonic(), 0.0))
        now = monotonic()
        found.append(abs(now - last - TICK_S))
        last = now
        deadline += TICK_S
    return sorted(found)


def main() -> None:
    """Sleep for as many s as the first argument says."""
    found = errors(float(sys.argv[1]))
    print(json.dumps({"p99_us": 1e6 * found[round(0.99 * len(found)) - 1], "max_us": 1e6 * found[-1]}))


if __name__ == "__main__":
    main()
