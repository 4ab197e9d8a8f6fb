"""Worst cases of a campaign, and its failures by cause."""

import heapq
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from shlex import quote

from sms_handover.campaign.cases.case_metrics import SMALLER_IS_WORSE
from sms_handover.campaign.cases.case_row import Row, Task
from sms_handover.campaign.record.journal import Entry

_NUMBER = re.compile(r"(?<![\w.])(0x[0-9a-f]+|-?\d+(\.\d+)?(e[-+]?\d+)?)")  # not those of names: joint_3
Group = tuple[str, str]  # scenario and law


def worst_of(entries: Iterable[Entry], metric: str, count: int) -> dict[Group, list[Row]]:
    """Return the cases with the worst values of a metric, by scenario and law, the worst first.

    What has no value, as after a numeric failure, is none of them: it is listed with the failures.
    """
    sign = -1.0 if metric in SMALLER_IS_WORSE else 1.0
    found: dict[Group, list[tuple[float, int, Row]]] = {}
    for entry in entries:
        row = entry.row
        value = row.metrics.get(metric)
        if value is None:
            continue
        heap = found.setdefault(row.task[1:], [])
        heapq.heappush(heap, (sign * value, -row.task.case, row))
        if len(heap) > count:
            heapq.heappop(heap)
    return {group: [row for _, _, row in sorted(heap, reverse=True)] for group, heap in found.items()}


def failures_by_cause(entries: Iterable[Entry]) -> Counter[tuple[str, str, str, str]]:
    """Return how often a cause ended a case without success.

    By scenario, law, status, and cause without its numbers.
    """
    return Counter(
        (*entry.row.task[1:], entry.row.status.value, cause_of(entry.row))
        for entry in entries
        if not entry.row.succeeded
    )


def cause_of(row: Row) -> str:
    """Return the cause of a row with numbers left out but in names, so that like cases have like causes."""
    return _NUMBER.sub("#", row.cause)


def rerun_command(folder: str, task: Task, *, one_scenario: bool) -> str:
    """Return the command that runs a case again, for a shell."""
    scenario = "" if one_scenario else f" --scenario {quote(task.scenario)}"
    return f"sms-handover campaign rerun {for_shell(folder)} {task.case} --law {quote(task.law)}{scenario}"


def for_shell(path: str) -> str:
    """Return a path as a word of a command for a shell, never taken for an option."""
    return quote(f"./{path}" if path.startswith("-") else path)


def failed(entries: Iterable[Entry]) -> Iterator[Row]:
    """Yield the rows without success."""
    return (entry.row for entry in entries if not entry.row.succeeded)
