"""The command of the fuzzers: each for so long in a process of its own, and a page of what came of it."""

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory

from sms_handover.errors import SmsHandoverError

from .campaign import LONGEST_S, MOST_MEMORY, Tally, digest, fuzz, limit_memory
from .targets import CORPUS, TARGETS

_ROOT = Path(__file__).resolve().parents[2]
_AT_ONCE = 2


def main(args: Sequence[str] | None = None) -> int:
    """Run the fuzzers; return 0 if nothing was found."""
    options = _parser().parse_args(args)
    if options.worker:
        return _work(options.worker, options.seconds, options.seed, options.result)
    names = options.only or list(TARGETS)
    unknown = [name for name in names if name not in TARGETS]
    if unknown:
        print(f"unknown fuzzer {unknown[0]!r}: known are {', '.join(TARGETS)}", file=sys.stderr)
        return 2
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        done = pool.map(lambda name: _in_process(name, options.seconds, options.seed), names)
        tallies = dict(zip(names, done, strict=True))
    if options.write:
        options.write.write_text(page(tallies, options.seconds, options.seed), encoding="utf-8")
    return 1 if any(tally.broken for tally in tallies.values()) else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python test/fuzz",
        description="Feed nearly good inputs to all that reads what others have made: only our errors "
        f"may come out, within {LONGEST_S:g} s of processor time and {MOST_MEMORY // 2**20} MiB per input. "
        "What breaks a reader is written to test/data/corpus, where the ordinary tests replay it.",
        epilog="exit codes: 0 nothing was found; 1 a reader broke; 2 wrong input",
    )
    parser.add_argument("--seconds", type=float, default=600.0, help="for each fuzzer (default: 600)")
    parser.add_argument("--seed", type=int, default=0, help="another seed tries other inputs (default: 0)")
    parser.add_argument("--only", nargs="+", metavar="NAME", help=f"of {', '.join(TARGETS)}")
    parser.add_argument("--write", type=Path, metavar="FILE", help="write the page of the results here")
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    parser.add_argument("--result", type=Path, help=argparse.SUPPRESS)
    return parser


def _work(name: str, seconds: float, seed: int, result: Path) -> int:
    """Fuzz one target in this process and write the tally."""
    with suppress(SmsHandoverError):
        TARGETS[name].run(TARGETS[name].corpus[-1], result.parent)  # what it loads is not counted as memory
    limit_memory()
    tally = fuzz(TARGETS[name], seconds, seed * 1_000_000, result.with_suffix(".input"))
    result.write_text(json.dumps(tally.as_json()), encoding="utf-8")
    return 0


def _in_process(name: str, seconds: float, seed: int) -> Tally:
    """Fuzz one target in a process of its own; one that dies is a find too."""
    with TemporaryDirectory() as folder:
        result = Path(folder) / "result.json"
        command = [sys.executable, str(_ROOT / "test" / "fuzz"), "--worker", name, "--result", str(result)]
        command += ["--seconds", str(seconds), "--seed", str(seed)]
        ended = subprocess.run(command, stderr=subprocess.PIPE, check=False)
        if result.exists():
            tally = Tally(**json.loads(result.read_text(encoding="utf-8")))
        else:
            current = result.with_suffix(".input")
            data = current.read_bytes() if current.exists() else b""
            last = ended.stderr.decode("utf-8", "replace")[-2000:]
            tally = Tally(broken={f"the process ended with {ended.returncode}: {last}": data.hex()})
    for text in tally.broken.values():
        data = bytes.fromhex(text)
        (CORPUS / name / f"found_{digest(data)}").write_bytes(data)
    print(f"{name}: {tally.inputs} inputs in {tally.seconds:.0f} s, {len(tally.broken)} ways to break it")
    for where in tally.broken:
        print(f"  {where}")
    sys.stdout.flush()
    return tally


def page(tallies: dict[str, Tally], seconds: float, seed: int) -> str:
    """Return the page of the results."""
    rows = [
        f"| {name} | {TARGETS[name].reads} | {tally.inputs} | {tally.refused or '-'} | "
        f"{tally.slowest_s:.2f} | {tally.memory_mb:.0f} | {len(tally.broken)} | {len(TARGETS[name].corpus)} |"
        for name, tally in tallies.items()
    ]
    return "\n".join([_HEAD, *rows, "", _tail(seconds, seed)]) + "\n"


def _tail(seconds: float, seed: int) -> str:
    day = datetime.now().astimezone().strftime("%Y-%m-%d")
    return (
        f"Run on {day} with {seconds:g} s for each fuzzer, seed {seed}: `make fuzz FUZZ_SECONDS={seconds:g}`."
    )


_HEAD = f"""\
# Fuzzing

`make fuzz` feeds nearly good inputs to every reader of what others have made: a good input with up to
eight edits (words and numbers that are known to hurt, parts cut, repeated, swapped, taken from another
input), as [Hypothesis](https://hypothesis.readthedocs.io) draws them. Only errors of our own may come
out, within {LONGEST_S:g} s of processor time and {MOST_MEMORY // 2**20} MiB of memory
for each input; a process that dies is a find. What is found is written to `test/data/corpus`, which the
ordinary tests replay, together with a short run of every fuzzer. *Refused* counts the inputs of those that
read with one reader; the last three hand each input to several, of which every one may refuse it.

Hypothesis, not Atheris: it is plain Python for every version and system that we support, it is kept up
week by week, and its runs are ordinary tests. Atheris follows the coverage of Python code, but its wheels
are for some versions of CPython on Linux only, and what matters most here, Pinocchio, PyYAML's scanner
states and the middleware's decoder, is compiled or guided better by good seeds.

| fuzzer | reads | inputs | refused | slowest, s | memory, MB | found | corpus |
|---|---|---|---|---|---|---|---|"""
