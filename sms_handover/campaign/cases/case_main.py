"""Main program of the process that carries out cases: tasks on standard input, rows on standard output.

Both are JSON, one value a line. The process ends when its standard input does, whatever it is doing: nobody
would take its rows. Where a library keeps Python from seeing that, the guard of its session ends it.
"""

import json
import os
import shutil
import sys
from base64 import b64encode
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import IO, Any

from sms_handover.campaign.cases.case import Cases
from sms_handover.campaign.cases.case_row import Task
from sms_handover.campaign.cases.retained import keeps_trajectory, trajectory
from sms_handover.campaign.definition.frozen import Frozen
from sms_handover.errors import SmsHandoverError

_STANDARD_OUTPUT = 1


def main() -> int:
    """Answer tasks until standard input ends; return the exit code."""
    answers = os.fdopen(os.dup(_STANDARD_OUTPUT), "w", encoding="ascii")
    os.dup2(os.open(os.devnull, os.O_WRONLY), _STANDARD_OUTPUT)  # what a law prints is no row
    first = json.loads(sys.stdin.readline())
    try:
        return _answer_tasks(answers, first)
    except BrokenPipeError:  # the parent ended before there was anybody to see the end of standard input
        shutil.rmtree(first["folder"], ignore_errors=True)
        return 1


def _answer_tasks(answers: IO[str], first: dict[str, Any]) -> int:
    """Answer tasks of the campaign that the first line has; return the exit code."""
    try:
        cases = Cases(Frozen(first["files"]), first["cases"], Path(first["folder"]))
    except SmsHandoverError as error:
        _answer(answers, {"error": str(error)})
        return 2
    _answer(answers, {"ready": os.getpid()})
    for line in _lines(first["folder"]):
        _answer(answers, _done(cases, Task(*json.loads(line))))
    return 0


def _done(cases: Cases, task: Task) -> dict[str, object]:
    """Return what comes of a task."""
    result = cases.run(task)
    answer: dict[str, object] = {"row": result.row.text, "beside": asdict(result.beside)}
    if result.run is not None and keeps_trajectory(cases.campaign.keep, result.row):
        answer["trajectory"] = b64encode(trajectory(result.run)).decode("ascii")
    return answer


def _lines(folder: str) -> Iterator[str]:
    """Yield the lines of standard input; at its end a thread removes a folder and ends the process."""
    queue: SimpleQueue[str] = SimpleQueue()

    def read() -> None:
        for line in sys.stdin:
            queue.put(line)
        shutil.rmtree(folder, ignore_errors=True)
        os._exit(0)  # the parent has ended, or wants no more

    Thread(target=read, name="standard_input", daemon=True).start()
    while True:
        yield queue.get()


def _answer(stream: IO[str], value: object) -> None:
    """Write a value as one line."""
    stream.write(json.dumps(value) + "\n")
    stream.flush()


if __name__ == "__main__":
    raise SystemExit(main())
