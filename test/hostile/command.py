"""The command of the hostile attempts: so many seeds, and what must not have happened."""

import argparse
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

from .attempt import CODES, drawn, fault_of

_AT_ONCE = 2


def tried(seed: int) -> str:
    """Try one seed; return what went wrong, '' if nothing did."""
    with TemporaryDirectory() as name:
        attempt = drawn(seed, Path(name))
        fault = fault_of(attempt, Path(name))
    return f"seed {seed}: {attempt}\n  {fault}" if fault else ""


def main(args: Sequence[str] | None = None) -> int:
    """Try the seeds; return 0 if nothing was found."""
    parser = argparse.ArgumentParser(
        prog="python test/hostile",
        description="Run every command with bad inputs, in bad environments, with closed or full streams: it "
        f"has to end with one of {', '.join(map(str, CODES))} and must not print a traceback.",
        epilog="exit codes: 0 nothing was found; 1 something was",
    )
    parser.add_argument("--count", type=int, default=500, help="attempts (default: 500)")
    parser.add_argument("--seed", type=int, default=0, help="the first seed (default: 0)")
    options = parser.parse_args(args)
    found = 0
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        for fault in filter(None, pool.map(tried, range(options.seed, options.seed + options.count))):
            found += 1
            print(fault, flush=True)
    print(f"{options.count} attempts, {found} found")
    return 1 if found else 0
