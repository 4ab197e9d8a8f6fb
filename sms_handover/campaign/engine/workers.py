"""Workers: what carries out the tasks of a campaign and gives back finished cases, in any order."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Protocol

from sms_handover.campaign.cases.case_process import CASE_PROGRAM, CaseProcess, Done
from sms_handover.campaign.cases.case_row import Task
from sms_handover.campaign.definition.frozen import Frozen


class Workers(Protocol):
    """Carries out tasks; takes no more of them than it soon needs."""

    def run(self, tasks: Iterable[Task]) -> Iterator[Sequence[Done]]:
        """Yield finished cases as they come, those together that come together."""

    def close(self) -> None:
        """End every process that was started, within seconds."""


class SerialWorkers:
    """One process that carries out one case after the other; needs no extra."""

    def __init__(self, frozen: Frozen, cases: int | None, program: Sequence[str] = CASE_PROGRAM) -> None:
        """Take the campaign; the process starts with the first task."""
        campaign = frozen.campaign(cases)
        self._process = CaseProcess(frozen, cases, campaign.seed, campaign.limits, program)

    def run(self, tasks: Iterable[Task]) -> Iterator[Sequence[Done]]:
        """Yield finished cases one by one in the order of tasks."""
        for task in tasks:
            yield (self._process.run(task),)

    def close(self) -> None:
        """End the process."""
        self._process.close()
