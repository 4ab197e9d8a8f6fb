"""Campaign folder: the frozen campaign, its manifest, its journal, and what is kept of cases.

Nothing in it is ever unpickled.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path

from sms_handover.campaign.cases.case_process import Done
from sms_handover.campaign.cases.case_row import Task
from sms_handover.campaign.cases.retained import TRAJECTORIES, file_of
from sms_handover.campaign.definition.campaign_file import Campaign
from sms_handover.campaign.definition.fields import EXTENDABLE, MOST_CASES
from sms_handover.campaign.definition.frozen import Frozen, read_frozen
from sms_handover.campaign.record.beginning import is_beginning, write_frozen
from sms_handover.campaign.record.durable_file import make_folder, unwritable, write_durably
from sms_handover.campaign.record.journal import JOURNAL, Entry, JournalFaults, JournalWriter, entries_of
from sms_handover.campaign.record.manifest import (
    MANIFEST,
    Manifest,
    Shard,
    all_sessions,
    read_manifest,
    session,
    write_manifest,
)
from sms_handover.campaign.sampling.samples import Samples
from sms_handover.errors import ConfigurationError

_TOGETHER = 100  # [-] rows of a merge that wait for the disk together


class CampaignFolder:
    """A campaign folder to read from."""

    def __init__(self, path: Path) -> None:
        """Open a folder; raises ConfigurationError if it holds no campaign, or one that was changed."""
        self.path = path
        self.manifest = read_manifest(path)
        self.frozen: Frozen = read_frozen(path)
        if self.frozen.digest != self.manifest.digest:
            raise ConfigurationError(
                f"{path}: the frozen campaign was changed since it began; its rows are of another one"
            )

    @cached_property
    def campaign(self) -> Campaign:
        """The campaign with as many cases as were asked for at last; raises ConfigurationError."""
        campaign, cases = self.frozen.campaign(), self.manifest.cases
        is_extendable = campaign.sampler.kind in EXTENDABLE
        if is_extendable == (cases is None):
            own = "null: it has its own number"
            allowed = f"a whole number from 1 to {MOST_CASES}" if is_extendable else own
            raise ConfigurationError(
                f"{self.path / MANIFEST}: cases is {'null' if cases is None else cases}, of sampler "
                f"{campaign.sampler.kind} must be {allowed}"
            )
        return replace(campaign, cases=cases) if is_extendable else campaign

    @property
    def cases(self) -> int:
        """The number of cases of the whole campaign."""
        return Samples(self.campaign).count

    def runs(self, stopped_at: int = 0) -> int:
        """Return the number of runs of this part of the campaign, up to the case where it stopped early."""
        shard = self.manifest.shard
        return len(range(shard.number - 1, stopped_at or self.cases, shard.of)) * self.campaign.runs_per_case

    def entries(self, faults: JournalFaults | None = None) -> Iterator[Entry]:
        """Yield what the journal has, each run once.

        Raises ConfigurationError on two rows that differ, and on one that is not of this campaign or part.
        """
        seen, collected = dict[Task, str](), JournalFaults() if faults is None else faults
        for entry in entries_of(self.path / JOURNAL, self.manifest.digest, collected):
            task, digest = entry.row.task, entry.row.digest
            if not self._has(task):
                shard = self.manifest.shard
                raise ConfigurationError(
                    f"{self.path / JOURNAL} has a row of {task}, which is not of this campaign, shard {shard}"
                )
            if task not in seen:
                seen[task] = digest
                yield entry
            elif seen[task] != digest:
                raise ConfigurationError(f"{self.path}: two rows of {task} differ")

    def _has(self, task: Task) -> bool:
        """Return whether a run is of this part of the campaign, or will be once there are more cases."""
        campaign = self.campaign
        is_known = task.scenario in campaign.scenarios and task.law in campaign.laws
        return is_known and task.case >= 0 and self.manifest.shard.has(task.case)


class OpenCampaign(CampaignFolder):
    """A campaign folder that is written to, by nobody else; use it as a context manager."""

    def __init__(self, path: Path, journal: JournalWriter, faults: Sequence[str] = ()) -> None:
        """Take a folder whose journal is locked, and what is to be told of it besides that it was mended."""
        super().__init__(path)
        self._journal = journal
        self.faults = (*faults, *journal.faults.mended_in_words(journal.path))

    def __enter__(self) -> "OpenCampaign":
        return self

    def __exit__(self, *error: object) -> None:
        self._journal.close()

    def add(self, *done: Done) -> None:
        """Keep finished cases; when this returns, they are on disk. Raises SmsHandoverError if it is full."""
        _add(self.path, self._journal, done)


def open_campaign(path: Path, frozen: Frozen, cases: int | None, shard: Shard) -> OpenCampaign:
    """Return the folder of a campaign, made if it is not there, to go on with.

    Raises ConfigurationError if it holds another campaign, or another part of it, or anything else, or while
    another run writes to it; SmsHandoverError where it cannot be written.
    """
    _require_same(path, frozen, shard)  # before anything in it is touched
    with _locked(path, frozen) as journal:
        _require_same(path, frozen, shard)  # another run may have begun it meanwhile
        if (path / MANIFEST).exists():
            manifest = read_manifest(path)
        else:
            write_frozen(path, frozen)
            manifest = Manifest(frozen.digest, frozen.campaign(cases).name, cases, shard)
        if cases is not None and cases > (manifest.cases or 0):
            manifest = replace(manifest, cases=cases)
        write_manifest(path, manifest.with_session(session()))
        return OpenCampaign(path, journal)


def merge(path: Path, parts: Sequence[Path]) -> OpenCampaign:
    """Return a new folder with the rows of the parts of one campaign, in the order of cases.

    It is no campaign folder until all rows are in it; one that was ended before goes on. Raises
    ConfigurationError if the parts are not of the same campaign, or if rows of one run differ.
    """
    folders = [CampaignFolder(part) for part in parts]
    first = folders[0]
    for folder in folders[1:]:
        if folder.manifest.digest != first.manifest.digest:
            raise ConfigurationError(f"{folder.path} and {first.path} hold different campaigns")
    if path.exists() and not is_beginning(path, first.frozen, of_merge=True):
        raise ConfigurationError(f"{path} exists: merge into a new folder")
    entries, told = dict[Task, Entry](), list[str]()
    for folder in folders:
        faults = JournalFaults()
        for entry in folder.entries(faults):
            known = entries.setdefault(entry.row.task, entry)
            if known.row.digest != entry.row.digest:
                raise ConfigurationError(f"{folder.path}: {entry.row.task} has another row than elsewhere")
        told.extend(faults.in_words(folder.path / JOURNAL))
    cases = max((folder.manifest.cases or 0 for folder in folders), default=0) or None
    with _locked(path, first.frozen) as journal:
        write_frozen(path, first.frozen)
        before = entries_of(journal.path, first.frozen.digest, JournalFaults())  # of a merge that was ended
        for entry in before:
            if entry != entries.pop(entry.row.task, None):
                raise ConfigurationError(f"{path} holds rows of other parts: merge into a new folder")
        tasks = sorted(entries)
        for begin in range(0, len(tasks), _TOGETHER):
            chunk = tasks[begin : begin + _TOGETHER]
            _add(path, journal, [Done(*entries[task], _trajectory(folders, task)) for task in chunk])
        sessions = (*all_sessions([folder.manifest for folder in folders]), session())
        name = first.frozen.campaign(cases).name
        write_manifest(path, Manifest(first.manifest.digest, name, cases, Shard(), sessions))
        return OpenCampaign(path, journal, told)


@contextmanager
def _locked(path: Path, frozen: Frozen) -> Iterator[JournalWriter]:
    """Yield the journal of a folder, made if it is not there; it stays locked unless an error is raised."""
    try:
        make_folder(path)
    except OSError as error:
        raise unwritable(path, error) from error
    journal = JournalWriter(path / JOURNAL, frozen.digest)
    try:
        yield journal
    except BaseException:
        journal.close()
        raise


def _add(path: Path, journal: JournalWriter, done: Sequence[Done]) -> None:
    """Keep finished cases durably, what is retained of them before the rows that say it is there."""
    kept = {file_of(path, TRAJECTORIES, one.row.task): one.trajectory for one in done if one.trajectory}
    write_durably(kept)
    journal.add(*(Entry(one.row, one.beside) for one in done))


def _trajectory(folders: Sequence[CampaignFolder], task: Task) -> bytes:
    """Return the trajectory that one of some folders has of a case, b'' if none has one."""
    files = (file_of(folder.path, TRAJECTORIES, task) for folder in folders)
    return next((file.read_bytes() for file in files if file.exists()), b"")


def _require_same(path: Path, frozen: Frozen, shard: Shard) -> None:
    """Raise ConfigurationError unless a folder is a part of a campaign, or becomes one."""
    if not (path / MANIFEST).exists():
        if path.exists() and not is_beginning(path, frozen):
            raise ConfigurationError(f"{path} holds something else than a campaign: choose another folder")
        return
    there = CampaignFolder(path)
    if there.manifest.digest != frozen.digest:
        changed = ", ".join(sorted(_changed(there.frozen, frozen)))
        raise ConfigurationError(
            f"{path} holds another campaign, which differs in {changed}: choose another folder"
        )
    if there.manifest.shard != shard:
        raise ConfigurationError(f"{path} holds shard {there.manifest.shard}: choose another folder")


def _changed(there: Frozen, given: Frozen) -> set[str]:
    """Return the names of the files in which two frozen campaigns differ."""
    names = there.files.keys() | given.files.keys()
    return {name for name in names if there.files.get(name) != given.files.get(name)}


def tasks_of(campaign: Campaign, cases: range, shard: Shard) -> Iterator[Task]:
    """Yield all runs of some cases of a part of a campaign."""
    for case in cases:
        if shard.has(case):
            for scenario in campaign.scenarios:
                yield from (Task(case, scenario, law) for law in campaign.laws)
