"""Frozen campaign: its file with every file that it names, which nothing outside changes."""

import hashlib
import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sms_handover.campaign.definition.campaign_file import Campaign, read_campaign
from sms_handover.campaign.definition.distributions import Choice, Value
from sms_handover.campaign.definition.fields import EXTENDABLE, LIST
from sms_handover.campaign.definition.named_files import (
    is_file_path,
    keep_cell,
    kept,
    kept_draw,
    kept_name,
    mesh_digests,
)
from sms_handover.campaign.definition.sampler import csv_file_of
from sms_handover.configuration.documents import as_yaml
from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.scenario_file import scenario_names
from sms_handover.configuration.sections import Section
from sms_handover.configuration.yaml_reader import read_yaml
from sms_handover.errors import ConfigurationError, UnknownNameError
from sms_handover.simulation.scenario_yaml import scenario_yaml

CAMPAIGN_FILE = "campaign.yaml"
_TABLE, _SCENARIOS, _MESHES = "cases.csv", "scenarios", "meshes.yaml"
_SUFFIX = ".yaml"


@dataclass(frozen=True)
class Frozen:
    """The texts of a campaign by the names of their files, without a number of cases that may grow."""

    files: Mapping[str, str]

    @property
    def text(self) -> str:
        """All of it as JSON, the same for the same campaign."""
        return json.dumps(self.files, sort_keys=True, ensure_ascii=True)

    @property
    def digest(self) -> str:
        """SHA-256 of all that its rows depend on, as hexadecimal digits."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def campaign(self, cases: int | None = None) -> Campaign:
        """Return the campaign with so many cases."""
        with tempfile.TemporaryDirectory(prefix="sms_handover_campaign_") as folder:
            return self.unpacked(Path(folder), cases)

    def unpacked(self, folder: Path, cases: int | None = None) -> Campaign:
        """Write the files below a folder; return the campaign, whose scenarios have their paths there."""
        for name, text in self.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        return read_campaign(folder / CAMPAIGN_FILE, cases)


def campaign_names() -> tuple[str, ...]:
    """Return the names of the shipped campaigns."""
    return tuple(sorted(path.stem for path in config_file("campaigns").glob(f"*{_SUFFIX}")))


def campaign_path(source: str) -> Path:
    """Return the file of a shipped campaign, or of one given by its path; raises UnknownNameError."""
    if source in campaign_names():
        return config_file(f"campaigns/{source}{_SUFFIX}")
    path = Path(source)
    if path.is_file():
        return path
    if path.suffix == _SUFFIX:
        raise ConfigurationError(f"there is no campaign file {path}")
    raise UnknownNameError("campaign", source, campaign_names())


def freeze(path: Path) -> tuple[Frozen, int | None]:
    """Return a campaign file as it is now, and the number of cases that it gives.

    Raises ConfigurationError with file and line of what is wrong.
    """
    campaign = read_campaign(path)
    content = read_yaml(path)
    extendable = campaign.sampler.kind in EXTENDABLE
    if extendable:  # more cases are not another campaign
        content.pop("cases", None)
    files: dict[str, str] = {}
    scenarios: dict[str, object] = {}
    root = Section.read(path)
    _keep_draws(root, path.parent, campaign, content, files)
    if campaign.values:
        content["values"] = _kept_values(root, campaign.values, path.parent, files)
    for name, chosen in campaign.scenarios.items():
        source = chosen.source
        if source not in scenario_names():
            source = str((path.parent / source).resolve())
        file = f"{_SCENARIOS}/{name}{_SUFFIX}"
        try:
            files[file] = scenario_yaml(source)
        except ConfigurationError as error:
            raise ConfigurationError(f"{path}: scenario {name!r}: {error}") from error
        scenarios[name] = file
        if chosen.values:
            values = _kept_values(root.section("scenarios").section(name), chosen.values, path.parent, files)
            scenarios[name] = {"scenario": file, "values": values}
    content["scenarios"] = scenarios
    table = csv_file_of(path)
    if table is not None:
        files[_TABLE] = table.read_text(encoding="utf-8")
        content["sampler"] = {LIST: {"file": _TABLE}}
    with root.located():
        digests = mesh_digests(files)
    if digests:
        files[_MESHES] = as_yaml(digests)
    files[CAMPAIGN_FILE] = as_yaml(content)
    return Frozen(files), campaign.cases if extendable else None


def _keep_draws(
    root: Section, folder: Path, campaign: Campaign, content: dict[str, Any], files: dict[str, str]
) -> None:
    """Keep the files that drawn values and cells of a table name; put their new names into the content."""
    for path, one in campaign.draws.items():
        if is_file_path(path) and isinstance(one, Choice):
            with root.section("draws").located(path):
                names = [kept_draw(path, value, folder, files) for value in one.values]
            content["draws"][path]["choice"]["values"] = names
    with root.located("sampler"):
        for path, value in _file_cells(campaign):
            keep_cell(path, value, files)


def _file_cells(campaign: Campaign) -> set[tuple[str, Value]]:
    """Return path and value of the cells of a table that name files, each once."""
    return {(path, row[path]) for row in campaign.sampler.rows for path in row if is_file_path(path)}


def _kept_values(
    section: Section, values: Mapping[str, object], folder: Path, files: dict[str, str]
) -> dict[str, object]:
    """Return the values of a section with the new names of the files that they name, which are kept."""
    found, inner = {}, section.section("values")
    for path, value in values.items():
        with inner.located(path if path in inner else path.partition(".")[0]):
            found[path] = kept(path, value, folder, files)
    return found


def read_frozen(folder: Path) -> Frozen:
    """Return the campaign that was frozen below a folder, beside anything; raises ConfigurationError."""
    if not (folder / CAMPAIGN_FILE).is_file():
        raise ConfigurationError(f"{folder} is no campaign folder: it has no {CAMPAIGN_FILE}")
    campaign = read_campaign(folder / CAMPAIGN_FILE)
    names = [CAMPAIGN_FILE, *(one.source for one in campaign.scenarios.values())]
    for name in names:
        if not (folder / name).is_file():
            raise ConfigurationError(f"{folder}: its {CAMPAIGN_FILE} names {name}, which is not there")
    names += [name for name in (_TABLE, _MESHES, *_named(campaign)) if (folder / name).is_file()]
    try:
        return Frozen({name: (folder / name).read_text(encoding="utf-8") for name in names})
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"{folder} cannot be read as a campaign: {error}") from error


def _named(campaign: Campaign) -> set[str]:
    """Return the names of the files that a frozen campaign has for its values, drawn ones and cells."""
    values = [campaign.values, *(one.values for one in campaign.scenarios.values())]
    given = [
        *(item for each in values for item in each.items()),
        *((p, value) for p, one in campaign.draws.items() if isinstance(one, Choice) for value in one.values),
        *_file_cells(campaign),
    ]
    return {kept_name(path, value) for path, value in given if is_file_path(path) and isinstance(value, str)}
