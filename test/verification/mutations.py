"""Break the package on purpose, one law at a time, and see which test notices first.

Run as a script (``python test/verification/mutations.py``) from the root of the checkout: as a module
it would be looked for in Python's own package ``test``. Works in copies; the checkout stays as it is.
"""

import json
import os
import shutil
import subprocess
import sys
from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Queue
from tempfile import TemporaryDirectory
from time import monotonic
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from test.verification.mutations_list import BREAKS, Break
else:
    from mutations_list import BREAKS, Break

ROOT = Path(__file__).resolve().parents[2]
COPIED = (
    *("sms_handover", "benchmarks", "config", "docs", "examples", "launch", "test"),
    *("pyproject.toml", "package.xml", "setup.py", "README.md", "CONTRIBUTING.md"),
)
# The fast tests, in the order in which they are asked when the likely one has not noticed.
FAST = (
    "test/core",
    "test/verification/test_claims_gen3.py",
    "test/verification/test_lagrangian.py",
    "test/verification/test_conservation.py",
)
SLOW = "handover"  # what needs whole handovers is left out in the verification folder
TIMEOUT_S = 900.0  # all fast tests take a few minutes; a break may make a loop endless, which is noticed too

SURVIVED = ""


@dataclass(frozen=True)
class Result:
    """What came of one break: the test that failed first, or '' if none did."""

    name: str
    file: str
    old: str
    new: str
    test: str
    seconds: float

    @property
    def survived(self) -> bool:
        """Whether no test noticed."""
        return self.test == SURVIVED


def misplaced(breaks: Sequence[Break], root: Path) -> list[str]:
    """Return a line for every break whose old text does not occur exactly once."""
    lines = []
    for item in breaks:
        count = (root / item.file).read_text(encoding="utf-8").count(item.old)
        if count != 1:
            lines.append(f"{item.name}: {item.old!r} occurs {count} times in {item.file}, expected is once")
        if not (root / item.likely).is_file():
            lines.append(f"{item.name}: {item.likely} does not exist")
    return lines


def first_failure(folder: Path, *tests: str, workers: int = 0) -> str:
    """Return the first test that fails in a copy, '' if none does; ``workers`` is of pytest-xdist."""
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    environment["OPENBLAS_NUM_THREADS"] = "1"
    options = ["-q", "--tb=no", "-rfE", "-p", "no:cacheprovider", "-k", f"not {SLOW} or core"]
    options += ["--numprocesses", str(workers), "--dist", "loadfile"] if workers else ["-x"]
    command = [sys.executable, "-m", "pytest", *options, *tests]
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            env=environment,
            capture_output=True,
            check=False,
            text=True,
            timeout=TIMEOUT_S,
        )
    except subprocess.TimeoutExpired:
        return f"no end after {TIMEOUT_S:g} s"
    if done.returncode == 0:
        return SURVIVED
    failures = [line for line in done.stdout.splitlines() if line.startswith(("FAILED ", "ERROR "))]
    if done.returncode != 1 or not failures:  # a copy that cannot even be imported shows nothing about tests
        raise RuntimeError(
            f"pytest ended with {done.returncode}: {(done.stderr or done.stdout).strip()[-500:]}"
        )
    return failures[0].partition(" ")[2].split(" - ")[0]


@contextmanager
def broken(folder: Path, item: Break) -> Iterator[None]:
    """Break one law in a copy for the time of the block."""
    path = folder / item.file
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace(item.old, item.new), encoding="utf-8")
    try:
        yield
    finally:
        path.write_text(text, encoding="utf-8")


def copy_of(root: Path, folder: Path) -> Path:
    """Copy what the tests need."""
    folder.mkdir()
    for name in COPIED:
        source, target = root / name, folder / name
        if source.is_dir():
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, target)
    return folder


def run(breaks: Sequence[Break], root: Path, workers: int, unbroken: Sequence[str]) -> Iterator[Result]:
    """Yield the result of every break, as they come; first see that ``unbroken`` tests pass."""
    with TemporaryDirectory() as scratch:
        copies: Queue[Path] = Queue()
        for number in range(workers):
            copies.put(copy_of(root, Path(scratch) / f"copy_{number}"))
        failing = first_failure(Path(scratch) / "copy_0", *unbroken, workers=workers)
        if failing:
            raise SystemExit(f"the tests fail without any break: {failing}")
        print(f"without a break every test passes; now {len(breaks)} breaks", flush=True)

        def attempt(item: Break) -> Result:
            folder, begin = copies.get(), monotonic()
            try:
                with broken(folder, item):
                    test = first_failure(folder, item.likely) or first_failure(folder, *FAST)
            finally:
                copies.put(folder)
            return Result(item.name, item.file, item.old, item.new, test, round(monotonic() - begin, 1))

        with ThreadPoolExecutor(workers) as pool:
            for future in as_completed(pool.submit(attempt, item) for item in breaks):
                yield future.result()


def results_in(file: Path) -> list[Result]:
    """Return what a file of results holds, nothing if there is none."""
    return [Result(**item) for item in json.loads(file.read_text(encoding="utf-8"))] if file.exists() else []


def _key(item: "Break | Result") -> tuple[str, ...]:
    return item.name, item.file, item.old, item.new


def main() -> int:
    """Run all breaks, or those whose name holds a text; the exit code is 1 if one survives."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, help="write the results to this JSON file, each as it comes")
    parser.add_argument("--resume", action="store_true", help="try only breaks that the output does not hold")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="breaks tried at a time")
    parser.add_argument("--only", default="", metavar="TEXT", help="only breaks whose name holds this text")
    parser.add_argument("--dry-run", action="store_true", help="only look whether every break has its place")
    options = parser.parse_args()
    if options.resume and not options.output:
        parser.error("--resume needs --output, the file with the results so far")
    wrong = misplaced(BREAKS, ROOT)
    if wrong:
        raise SystemExit("\n".join(wrong))
    if options.dry_run:
        return 0
    begin = monotonic()
    known = {_key(item): item for item in BREAKS}
    held = results_in(options.output) if options.resume else []
    done = {_key(result): result for result in held if _key(result) in known}
    wanted = [item for key, item in known.items() if key not in done and options.only in item.name]
    unbroken = FAST if len(wanted) == len(BREAKS) else sorted({item.likely for item in wanted})
    for result in run(wanted, ROOT, options.workers, unbroken) if wanted else ():
        done[_key(result)] = result
        print(f"{result.seconds:6.1f} s  {result.name}: {result.test or 'SURVIVED'}", flush=True)
        if options.output:
            results = [asdict(done[key]) for key in known if key in done]
            options.output.write_text(json.dumps(results, indent=2) + "\n", encoding="utf-8")
    survivors = [result.name for result in done.values() if result.survived]
    print(
        f"{len(wanted)} breaks in {monotonic() - begin:.0f} s, {len(survivors)} of {len(done)} survived",
        *survivors,
        sep="\n  ",
    )
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
