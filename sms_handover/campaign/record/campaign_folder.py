"""Campaign folder: the frozen campaign, its manifest, its journal, and what is kept of cases.

Nothing in it is ever unpickled.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path

from sms_handover.campaign.cases.case_process import Done
from sms_handover.campaign.cases.case_row import Task
from sms_handover.campaign.cases.retained import TRAJECTORIES, file_of
from sms_handover.campaign.definition.campaign_file import Campaign
from sms_handover.campaign.definition.frozen import Frozen, read_frozen
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
from sms_handover.errors import ConfigurationError, SmsHandoverError


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
        """The campaign with as many cases as were asked for at last."""
        return self.frozen.campaign(self.manifest.cases)

    @property
    def cases(self) -> int:
        """The number of cases of the whole campaign."""
        return Samples(self.campaign).count

    def runs(self, stopped_at: int = 0) -> int:
        """Return the number of runs of this part of the campaign, up to the case where it stopped early."""
        shard = self.manifest.shard
        return len(range(shard.number - 1, stopped_at or self.cases, shard.of)) * self.campaign.runs_per_case

    def entries(self, faults: JournalFaults | None = None) -> Iterator[Entry]:
        """Yield what the journal has, each run once; raises ConfigurationError on two rows that differ."""
        seen: dict[Task, str] = {}
        for entry in entries_of(self.path / JOURNAL, JournalFaults() if faults is None else faults):
            task, digest = entry.row.task, entry.row.digest
            if task not in seen:
                seen[task] = digest
                yield entry
            elif seen[task] != digest:
                raise ConfigurationError(f"{self.path}: two rows of {task} differ")


class OpenCampaign(CampaignFolder):
    """A campaign folder that is written to, by nobody else; use it as a context manager."""

    def __init__(self, path: Path) -> None:
        """Lock the journal and mend it; raises ConfigurationError while another run writes to it."""
        super().__init__(path)
        self._journal = JournalWriter(path / JOURNAL)
        self.faults = self._journal.faults.in_words(self._journal.path)
        write_manifest(path, self.manifest.with_session(session()))
        self.manifest = read_manifest(path)

    def __enter__(self) -> "OpenCampaign":
        return self

    def __exit__(self, *error: object) -> None:
        self._journal.close()

    def add(self, *done: Done) -> None:
        """Keep finished cases; when this returns, they are on disk. Raises SmsHandoverError if it is full."""
        for one in done:
            if one.trajectory:
                self._keep(file_of(self.path, TRAJECTORIES, one.row.task), one.trajectory)
        self._journal.add(*(Entry(one.row, one.beside) for one in done))

    @staticmethod
    def _keep(path: Path, data: bytes) -> None:
        """Write retained data before the row that says it is there."""
        try:
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(data)
        except OSError as error:
            raise SmsHandoverError(
                f"{path} cannot be written: {error.strerror}; make room, then the same command goes on"
            ) from error


def open_campaign(path: Path, frozen: Frozen, cases: int | None, shard: Shard) -> OpenCampaign:
    """Return the folder of a campaign, made if it is not there, to go on with.

    Raises ConfigurationError if it holds another campaign, or another part of it, or anything else.
    """
    if not (path / MANIFEST).exists():
        if path.exists() and any(path.iterdir()):
            raise ConfigurationError(f"{path} holds something else than a campaign: choose another folder")
        path.mkdir(parents=True, exist_ok=True)
        name = frozen.unpacked(path, cases).name
        write_manifest(path, Manifest(frozen.digest, name, cases, shard))
        return OpenCampaign(path)
    there = CampaignFolder(path)
    if there.manifest.digest != frozen.digest:
        changed = ", ".join(sorted(_changed(there.frozen, frozen)))
        raise ConfigurationError(
            f"{path} holds another campaign, which differs in {changed}: choose another folder"
        )
    if there.manifest.shard != shard:
        raise ConfigurationError(f"{path} holds shard {there.manifest.shard}: choose another folder")
    if cases is not None and cases > (there.manifest.cases or 0):
        write_manifest(path, replace(there.manifest, cases=cases))
    return OpenCampaign(path)


def merge(path: Path, parts: Sequence[Path]) -> OpenCampaign:
    """Return a new folder with the rows of the parts of one campaign, in the order of cases.

    Raises ConfigurationError if they are not of the same campaign, or if rows of one run differ.
    """
    folders = [CampaignFolder(part) for part in parts]
    first = folders[0]
    for folder in folders[1:]:
        if folder.manifest.digest != first.manifest.digest:
            raise ConfigurationError(f"{folder.path} and {first.path} hold different campaigns")
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise ConfigurationError(f"{path} exists: merge into a new folder")
    entries: dict[Task, Entry] = {}
    for folder in folders:
        for entry in folder.entries():
            known = entries.setdefault(entry.row.task, entry)
            if known.row.digest != entry.row.digest:
                raise ConfigurationError(f"{folder.path}: {entry.row.task} has another row than elsewhere")
    cases = max((folder.manifest.cases or 0 for folder in folders), default=0) or None
    path.mkdir(parents=True, exist_ok=True)
    name = first.frozen.unpacked(path, cases).name
    sessions = all_sessions([folder.manifest for folder in folders])
    write_manifest(path, Manifest(first.manifest.digest, name, cases, Shard(), sessions))
    merged = OpenCampaign(path)
    for task in sorted(entries):
        kept = [file_of(folder.path, TRAJECTORIES, task) for folder in folders]
        data = next((file.read_bytes() for file in kept if file.exists()), b"")
        merged.add(Done(*entries[task], data))
    return merged


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
