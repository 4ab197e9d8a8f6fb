"""Run every benchmark and write docs/performance.md from the results."""

import re
import subprocess
import sys
from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

from benchmarks.machine import load_average, machine
from benchmarks.results import FOLDER, ROOT, Result, bullets, load

SCRIPTS: tuple[str, ...] = (  # in the order of the document
    "engines",
    "compiled_loop",
    "inverse_kinematics",
    "predictive_control",
    "growth",
    "clearance",
    "startup",
    "lockstep",
    "bounds",
    "realtime",
    "recorder",
    "recorder_kill",
    "playback",
    "report",
)
TARGET = ROOT / "docs" / "performance.md"
CONDITIONS = FOLDER / "machine.txt"
_MEASURED_BY = re.compile(r"^`python -m benchmarks\.(\w+)`$", re.MULTILINE)
_TIMEOUT_S = 600.0  # s of wall time for one script

_INTRODUCTION = """\
# Performance

How long things take, beside what others take for the same. This file is written by `make bench` from what
it measures; nothing in it is written by hand. Times within one section come from one run in which the
contestants took turns, so their ratios hold on other machines better than the times do."""


def document(results: Sequence[Result], conditions: Sequence[str], page: str = "") -> str:
    """Return the whole document as Markdown; sections without a result are those of ``page``."""
    sections = sections_of(page) | {result.name: result.markdown() for result in results}
    written = [sections[name] for name in SCRIPTS if name in sections]
    return "\n\n".join([_INTRODUCTION, bullets(conditions), *written]) + "\n"


def sections_of(page: str) -> dict[str, str]:
    """Return the sections of a document by the scripts that have measured them."""
    parts = (f"## {text.rstrip()}" for text in page.split("\n## ")[1:])
    return {found[1]: part for part in parts if (found := _MEASURED_BY.search(part))}


def run(script: str) -> bool:
    """Run one benchmark as its user would; return whether it went well."""
    start = perf_counter()
    try:
        command = [sys.executable, "-m", f"benchmarks.{script}"]
        status = subprocess.run(command, cwd=ROOT, timeout=_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        print(f"{script}: not done after {_TIMEOUT_S:g} s", file=sys.stderr)
        return False
    print(f"== {script}: {perf_counter() - start:.0f} s", flush=True)
    return status.returncode == 0


def measure(scripts: Sequence[str]) -> list[str]:
    """Run benchmarks, note what they ran on, and return those that failed."""
    conditions = [*machine(), f"Load average of the minute before: {load_average():.1f}"]
    FOLDER.mkdir(parents=True, exist_ok=True)
    CONDITIONS.write_text("\n".join(conditions) + "\n", encoding="utf-8")
    return [script for script in scripts if not run(script)]


def main() -> int:
    """Run what is asked for, then render what was measured; return 1 if a script or the page failed.

    What is not measured stays in the page as it was: a script can be run again alone.
    """
    parser = ArgumentParser(description=__doc__)
    parser.add_argument(
        "scripts", nargs="*", metavar="SCRIPT", help=f"of {', '.join(SCRIPTS)} (default: all)"
    )
    parser.add_argument("--render", action="store_true", help="render what is there, measure nothing")
    parser.add_argument("--output", type=Path, default=TARGET)
    options = parser.parse_args()
    unknown = sorted(set(options.scripts) - set(SCRIPTS))
    if unknown:
        parser.error(f"no benchmark {', '.join(unknown)}; there are: {', '.join(SCRIPTS)}")
    chosen = options.scripts or SCRIPTS
    failed = [] if options.render else measure(chosen)
    paths = {script: FOLDER / f"{script}.json" for script in chosen if script not in failed}
    results = [load(path) for path in paths.values() if path.exists()]
    conditions = CONDITIONS.read_text(encoding="utf-8").splitlines() if CONDITIONS.exists() else machine()
    page = TARGET.read_text(encoding="utf-8") if TARGET.exists() else ""
    options.output.write_text(document(results, conditions, page), encoding="utf-8")
    print(f"{options.output}: {len(results)} of {len(SCRIPTS)} sections anew", *failed, sep="\nfailed: ")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
