"""Recorded runs that a command is given."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from sms_handover.campaign.record.campaign_folder import CampaignFolder
from sms_handover.campaign.record.manifest import MANIFEST
from sms_handover.errors import ConfigurationError
from sms_handover.launcher.run_folder import BAG, bags_of, is_bag_of_run
from sms_handover.report.recorded_run import RecordedRun, read_recorded
from sms_handover.terminal.progress import Progress


def read_all(paths: Sequence[Path], progress: Progress | None = None) -> tuple[RecordedRun, ...]:
    """Return the runs in output folders or bags, each under the name of its folder; show the progress.

    An output folder with several runs gives them all. Raises ConfigurationError if two runs have the same
    name, or if one cannot be read or is not ours.
    """
    names = named(bag for path in paths for bag in bags_of(path))
    runs: list[RecordedRun] = []
    for name, path in names.items():
        if progress:
            progress.show(f"reading {name}", f"{len(runs) + 1} of {len(names)}", len(runs) / len(names))
        runs.append(read_recorded(name, path))
    return tuple(runs)


def campaign_among(paths: Sequence[Path]) -> CampaignFolder | None:
    """Return the campaign that a command is given in place of runs, None if these are runs.

    Raises ConfigurationError if there is anything beside it.
    """
    campaigns = [path for path in paths if (path / MANIFEST).is_file()]
    if campaigns and len(paths) > 1:
        raise ConfigurationError(
            f"{campaigns[0]} is a campaign: give it alone, its laws are what is compared"
        )
    return CampaignFolder(campaigns[0]) if campaigns else None


def named(bags: Iterable[Path]) -> dict[str, Path]:
    """Return bags by the names of their runs; raises ConfigurationError if two have the same."""
    names: dict[str, Path] = {}
    for bag in bags:
        if (name := _name(bag)) in names:
            raise ConfigurationError(f"two runs are named {name!r}; rename one folder")
        names[name] = bag
    return names


def _name(path: Path) -> str:
    """Return the name of the output folder of a run, also if a bag in it is given, with the run's number."""
    full = path.resolve()
    if full.is_dir() and is_bag_of_run(full.name):
        return full.parent.name + full.name.removeprefix(BAG)
    return full.stem if full.is_file() else full.name
