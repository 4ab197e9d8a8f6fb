"""Run of a campaign: what is missing in its folder is handed to workers, and each row is kept as it comes."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain

from sms_handover.campaign.cases.case_process import Done
from sms_handover.campaign.cases.case_row import Row, Task
from sms_handover.campaign.engine.workers import Workers
from sms_handover.campaign.record.campaign_folder import OpenCampaign, tasks_of
from sms_handover.campaign.statistics.proportion import Proportion, proportion
from sms_handover.campaign.statistics.stop_rule import stopped_at
from sms_handover.errors import SmsHandoverError

Group = tuple[str, str]  # scenario and law


@dataclass
class Tally:
    """How far a campaign is: rows and successes by scenario and law, of this session and before."""

    total: int
    groups: tuple[Group, ...]
    before: int = 0
    rows: Counter[Group] = field(default_factory=Counter)
    successes: Counter[Group] = field(default_factory=Counter)
    stopped_at: int = 0  # cases after which it was enough, 0 if it was not

    def add(self, row: Row) -> None:
        """Count a row."""
        group = (row.task.scenario, row.task.law)
        self.rows[group] += 1
        self.successes[group] += row.succeeded

    @property
    def done(self) -> int:
        """The number of rows."""
        return self.rows.total()

    def proportion(self, group: Group) -> Proportion:
        """Return the successes of a scenario under a law."""
        return proportion(self.successes[group], self.rows[group])


class _DoneCases:
    """Which runs have a row: a bit for each, whatever the number of cases."""

    def __init__(self, groups: Iterable[Group], cases: int) -> None:
        self._bits = {group: bytearray(cases // 8 + 1) for group in groups}

    def add(self, task: Task) -> None:
        self._bits[task[1:]][task.case // 8] |= 1 << task.case % 8

    def __contains__(self, task: Task) -> bool:
        return bool(self._bits[task[1:]][task.case // 8] >> task.case % 8 & 1)


def run_campaign(
    folder: OpenCampaign, make_workers: Callable[[], Workers], show: Callable[[Tally], None]
) -> Tally:
    """Run what is missing in a folder; return how far it is then.

    With a stop rule, nothing beyond the next look is begun before it, so that where it stops depends on no
    order. Workers are made only if there is something to do, and are closed in any case. Raises
    SmsHandoverError where they cannot go on, or give what they were not asked for.
    """
    campaign, cases = folder.campaign, folder.cases
    groups = tuple((scenario, law) for scenario in campaign.scenarios for law in campaign.laws)
    shard = folder.manifest.shard
    tally, done = Tally(folder.runs(), groups), _DoneCases(groups, cases)
    for entry in folder.entries():
        if entry.row.task.case < cases:
            done.add(entry.row.task)
            tally.add(entry.row)
    tally.before = tally.done
    looks = [look for look in campaign.stop.looks if look < cases] if campaign.stop else []

    def missing(begin: int, end: int) -> Iterator[Task]:
        return (task for task in tasks_of(campaign, range(begin, end), shard) if task not in done)

    begin, running = 0, _Running()
    with _Lazy(make_workers) as workers:
        for end in (*looks, cases):
            for done_now in workers.run(running.handing_out(missing(begin, end))):
                running.take_back(one.row.task for one in done_now)
                folder.add(*done_now)
                for one in done_now:
                    tally.add(one.row)
                show(tally)
            begin = end
            if end < cases and stopped_at(campaign, cases, folder.entries()) == end:
                tally.stopped_at = end
                break
    return tally


class _Running:
    """Tasks that are handed out and have not come back; a row of any other is of another campaign."""

    def __init__(self) -> None:
        self._tasks: set[Task] = set()

    def handing_out(self, tasks: Iterable[Task]) -> Iterator[Task]:
        """Yield tasks and keep them in mind."""
        for task in tasks:
            self._tasks.add(task)
            yield task

    def take_back(self, tasks: Iterable[Task]) -> None:
        """Forget tasks; raises SmsHandoverError on one that was not handed out."""
        for task in tasks:
            if task not in self._tasks:
                raise SmsHandoverError(f"workers gave a row of {task}, which they were not asked for")
            self._tasks.discard(task)


class _Lazy:
    """Workers that are made with the first task."""

    def __init__(self, make: Callable[[], Workers]) -> None:
        self._make = make
        self._workers: Workers | None = None

    def __enter__(self) -> "_Lazy":
        return self

    def __exit__(self, *error: object) -> None:
        if self._workers is not None:
            self._workers.close()

    def run(self, tasks: Iterator[Task]) -> Iterator[Sequence[Done]]:
        """Yield finished cases, those together that come together."""
        first = next(tasks, None)
        if first is None:
            return
        self._workers = self._workers or self._make()
        yield from self._workers.run(chain([first], tasks))
