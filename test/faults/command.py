"""The command line of the fault campaign."""

import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from .attempt import attempt, from_json, to_json, write_outcome
from .discover import chosen, families, sample
from .outcome import Outcome, Status
from .page import page
from .runner import own_mounts, run_all

EXIT_OK, EXIT_BROKEN, EXIT_USAGE, EXIT_INTERRUPTED = 0, 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Try faults; the exit code is 1 if a promise was broken."""
    options = _parser().parse_args(arguments)
    found = families()
    try:
        jobs = chosen(found, options.family, options.only or ([options.attempt] if options.attempt else []))
    except ValueError as error:
        print(f"faults: error: {error}", file=sys.stderr)
        return EXIT_USAGE
    if options.sample:
        jobs = sample(jobs, options.seed)
    if options.attempt:
        ((family, fault),) = jobs
        write_outcome(attempt(fault, family.name, options.seed, options.folder), options.folder)
        return EXIT_OK
    if options.list:
        for family, fault in jobs:
            print(f"{family.name}/{fault.name}: {fault.injected}")
        print(f"{len(jobs)} faults in {len({family.name for family, _ in jobs})} families")
        return EXIT_OK
    if not own_mounts():
        print("no mounts of its own on this machine: some faults cannot be tried", file=sys.stderr)
    done = _done(options.resume, options.seed)
    left = [(family, fault) for family, fault in jobs if f"{family.name}/{fault.name}" not in done]
    progress = _Progress(len(left), options.resume, options.seed)
    try:
        run_all(left, options.seed, options.jobs, options.folder, progress.tell)
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    done.update({outcome.fault: outcome for outcome in progress.outcomes})
    outcomes = [done[f"{family.name}/{fault.name}"] for family, fault in jobs]
    if options.write:
        options.write.write_text(page(found, outcomes, options.seed), encoding="utf-8")
        print(f"wrote {options.write}")
    return _summary(outcomes, options)


class _Progress:
    """A line for every outcome, with how many are done; kept in a file too, if wanted."""

    def __init__(self, total: int, file: Path | None, seed: int) -> None:
        """Begin with none."""
        self._total, self._file, self._seed = total, file, seed
        self.outcomes: list[Outcome] = []
        self._broken = 0

    def tell(self, outcome: Outcome) -> None:
        """Print an outcome."""
        self.outcomes.append(outcome)
        if self._file is not None:
            with self._file.open("a", encoding="utf-8") as stream:
                stream.write(f"{self._seed} {to_json(outcome)}\n")
        self._broken += outcome.status is Status.BROKEN
        width = len(str(self._total))
        broken = f", {self._broken} broken so far" if self._broken else ""
        print(
            f"[{len(self.outcomes):>{width}}/{self._total}{broken}] {outcome.fault}: {outcome.status.value}, "
            f"lost {outcome.lost}, {outcome.wall_s:.1f} s"
            + (f"\n    {outcome.reason}" if outcome.reason else "")
            + (f"\n    {outcome.note}" if outcome.note else ""),
            flush=True,
        )


def _done(file: Path | None, seed: int) -> dict[str, Outcome]:
    """Return the promises kept in an earlier run with this seed, by name; what was broken is tried again."""
    if file is None or not file.is_file():
        return {}
    lines = [line.partition(" ") for line in file.read_text(encoding="utf-8").splitlines()]
    outcomes = [from_json(text) for number, _, text in lines if number == str(seed)]
    return {outcome.fault: outcome for outcome in outcomes if outcome.status is Status.KEPT}


def _summary(outcomes: Sequence[Outcome], options: Namespace) -> int:
    """Print the totals; return the exit code."""
    count = Counter(outcome.status for outcome in outcomes)
    print(", ".join(f"{count[status]} {status.value}" for status in Status), f"(seed {options.seed})")
    for outcome in outcomes:
        if outcome.status is Status.BROKEN:
            again = f"python test/faults --only {outcome.fault} --seed {options.seed}"
            print(f"BROKEN {outcome.fault}: {outcome.reason}\n    again: {again}", file=sys.stderr)
    return EXIT_BROKEN if count[Status.BROKEN] else EXIT_OK


def _parser() -> ArgumentParser:
    """Return the parser."""
    parser = ArgumentParser(
        prog="python test/faults",
        description="Inject faults into the running system and check the promise made for each of them.",
        epilog="exit codes: 0 every promise was kept (or could not be tried here), 1 one was broken, 2 wrong "
        "options, 130 interrupted.\n\nexamples:\n  python test/faults --list\n"
        "  python test/faults --family disk --seed 7\n"
        "  python test/faults --sample --seed 7\n"
        "  python test/faults --only 'processes/*killed*' --jobs 2",
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--family", action="append", default=[], metavar="NAME", help="only this family; may be given again"
    )
    parser.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="PATTERN",
        help="only these, e.g. 'disk/*full*'",
    )
    parser.add_argument(
        "--sample", action="store_true", help="only one of each family, which the seed decides"
    )
    parser.add_argument("--seed", type=int, default=0, help="of what is random in the faults (default: 0)")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="faults at a time (default: 1)")
    parser.add_argument("--list", action="store_true", help="show the faults, try none")
    parser.add_argument("--write", type=Path, metavar="FILE", help="write the page, docs/reliability.md")
    parser.add_argument(
        "--resume",
        type=Path,
        metavar="FILE",
        help="keep outcomes there, and go on after those that were kept",
    )
    parser.add_argument(
        "--folder", type=Path, metavar="FOLDER", help="keep the files of every attempt there (a new folder)"
    )
    parser.add_argument("--attempt", metavar="FAMILY/NAME", help="try one in this process, to debug it")
    return parser
