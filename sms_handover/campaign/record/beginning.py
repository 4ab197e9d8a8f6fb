"""Beginning of a campaign folder: the frozen files before there is a manifest, which makes it one."""

from pathlib import Path

from sms_handover.campaign.cases.retained import TRAJECTORIES
from sms_handover.campaign.definition.frozen import Frozen
from sms_handover.campaign.record.durable_file import unfinished_name, write_durably
from sms_handover.campaign.record.journal import JOURNAL
from sms_handover.campaign.record.manifest import MANIFEST


def write_frozen(path: Path, frozen: Frozen) -> None:
    """Write the files of a frozen campaign durably; raises SmsHandoverError where they cannot be."""
    write_durably(_files(path, frozen))


def is_beginning(path: Path, frozen: Frozen, *, of_merge: bool = False) -> bool:
    """Whether a folder has nothing but what is left of a run that was ended before it wrote the manifest.

    Of a merge there may be rows and trajectories.
    """
    files = _files(path, frozen)
    folders = {file.parent for file in files} - {path}
    passing = {unfinished_name(file) for file in (*files, path / JOURNAL, path / MANIFEST)}

    def is_own(file: Path) -> bool:
        if file in folders:
            return file.is_dir() and all(map(is_own, file.iterdir()))
        if file in files:
            return file.is_file() and file.read_bytes() == files[file]
        if file == path / JOURNAL:
            return of_merge or file.stat().st_size == 0
        return file in passing or (of_merge and file == path / TRAJECTORIES)

    return path.is_dir() and all(map(is_own, path.iterdir()))


def _files(path: Path, frozen: Frozen) -> dict[Path, bytes]:
    """Return the content of the files of a frozen campaign below a folder."""
    return {path / name: text.encode() for name, text in frozen.files.items()}
