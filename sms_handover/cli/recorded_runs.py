"""The recorded runs that a command is given."""

from collections.abc import Sequence
from pathlib import Path

from sms_handover.errors import ConfigurationError
from sms_handover.launcher.run_folder import BAG, bags_of, is_bag_of_run
from sms_handover.report.recorded_run import RecordedRun, read_recorded


def read_all(paths: Sequence[Path]) -> tuple[RecordedRun, ...]:
    """Return the runs in output folders or bags, each under the name of its folder.

    An output folder with several runs gives them all.

    Raises ConfigurationError if two have the same name, or if one cannot be read or is not ours.
    """
    names: dict[str, Path] = {}
    for path in [bag for given in paths for bag in bags_of(given)]:
        name = _name(path)
        if name in names:
            raise ConfigurationError(f"two runs are named {name!r}; rename one folder")
        names[name] = path
    return tuple(read_recorded(name, path) for name, path in names.items())


def _name(path: Path) -> str:
    """Return the name of the output folder of a run, also if its bag is given, with the number of the run."""
    full = path.resolve()
    if full.is_dir() and is_bag_of_run(full.name):
        return full.parent.name + full.name.removeprefix(BAG)
    return full.stem if full.is_file() else full.name
