"""Scenario file: one run as what differs from another, by ``extends``."""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from pathlib import Path

from sms_handover.configuration.conditions_content import read_conditions_content, with_histories
from sms_handover.configuration.merge import merged, standing_in
from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.parameters import ParameterValues
from sms_handover.configuration.robot_content import read_robot_content, with_arm_descriptions
from sms_handover.configuration.sections import Section
from sms_handover.configuration.values import CONDITIONS, DEPUTY, MODEL, ROBOT, ROLES, SCHEDULE, TRUTH
from sms_handover.configuration.yaml_reader import Mapping, load_mapping, read_file
from sms_handover.errors import ConfigurationError, UnknownNameError
from sms_handover.graph.topics import CONTROLLER, LOOP_NODES

COMMON = "common"  # section of what every node shares
EXTENDS, DESCRIPTION, LAW, SEED, SOURCE = "extends", "description", "law", "seed", "source"
_SUFFIX = ".yaml"
_SECTIONS = (COMMON, *LOOP_NODES)
SHORT = {LAW: CONTROLLER, SEED: COMMON, SOURCE: COMMON}  # paths that stand for a parameter of the same name
KEYS = (EXTENDS, DESCRIPTION, ROBOT, SCHEDULE, DEPUTY, CONDITIONS, *SHORT, *ROLES, *_SECTIONS)


@dataclass(frozen=True, eq=False)
class ScenarioFile:
    """What a scenario file says, with all that it extends.

    ``robot``, ``schedule`` and ``conditions`` are complete; ``truth`` and ``model`` have changes of robot and
    deputy for the plant alone, or for every other node. ``parameters`` are by section and name.
    ``schedule_text`` is that of a file of which nothing was changed, else empty.
    """

    name: str
    description: str
    robot: Mapping
    schedule: Mapping
    schedule_text: str
    conditions: Mapping
    truth: Mapping
    model: Mapping
    parameters: dict[str, ParameterValues]

    def of_role(self, role: str) -> Mapping:
        """Return the changes for the plant (``truth``), or for every other node (``model``)."""
        return self.truth if role == TRUTH else self.model


def scenario_names() -> tuple[str, ...]:
    """Return the names of the shipped scenarios."""
    return tuple(sorted(path.stem for path in config_file("scenarios").glob(f"*{_SUFFIX}")))


def load_scenario_file(source: str) -> ScenarioFile:
    """Return the scenario of a name, or in a file.

    Raises UnknownNameError if there is neither, and ConfigurationError with file and line of what is wrong.
    """
    return _load(source, Path(), f"scenario {source!r}", ())


def _load(source: str, folder: Path, where: str, extended_by: Sequence[Path]) -> ScenarioFile:
    """Return a scenario that is named in a file of ``folder``."""
    path = _path(source, folder, where)
    if path in extended_by:
        chain = " extends ".join(one.stem for one in (*extended_by, path))
        raise ConfigurationError(f"{where}: scenarios extend each other: {chain}")
    root = Section.read(path)
    root.only((), KEYS)
    base = None
    if EXTENDS in root:
        base = _load(root.text(EXTENDS), path.parent, root.where(EXTENDS), (*extended_by, path))
    description = root.text(DESCRIPTION) if DESCRIPTION in root else ""
    robot = _document(root, ROBOT, base.robot if base else None, read_robot_content, path)
    if robot is None:
        robot = read_robot_content(config_file("robot.yaml"))
    text = base.schedule_text if base else ""
    if SCHEDULE in root:
        named = root.value(SCHEDULE)
        text = read_file(path.parent / named) if isinstance(named, str) else ""
    schedule = _document(root, SCHEDULE, base.schedule if base else None, _read_schedule, path)
    if schedule is None:
        raise root.error(f"{SCHEDULE} is missing: give a file, or extend a scenario that has one")
    if DEPUTY in root:
        schedule, text = merged(schedule, _only(root, DEPUTY), path), ""
    conditions = _document(root, CONDITIONS, base.conditions if base else None, read_conditions_content, path)
    return ScenarioFile(
        path.stem,
        description,
        robot,
        schedule,
        text,
        Mapping() if conditions is None else conditions,
        _changes(root, TRUTH, base.truth if base else None, path),
        _changes(root, MODEL, base.model if base else None, path),
        _parameters(root, base),
    )


def _path(source: str, folder: Path, where: str) -> Path:
    """Return the file of a shipped scenario, or of one given by its path; raises UnknownNameError."""
    if source in scenario_names():
        return config_file(f"scenarios/{source}{_SUFFIX}")
    path = folder / source
    if path.is_file():
        return path.resolve()
    if path.suffix == _SUFFIX:
        raise ConfigurationError(f"{where}: there is no file {path}")
    raise UnknownNameError("scenario", source, scenario_names(), where)


def _document(
    root: Section, key: str, base: Mapping | None, read: Callable[[Path], Mapping], path: Path
) -> Mapping | None:
    """Return one of the documents: that of a file, that extended with changes, or one written out in full."""
    if key not in root:
        return base
    value = root.value(key)
    if isinstance(value, str):
        with root.located(key):
            return read(path.parent / value)
    content = _only(root, key)[key]
    if EXTENDS in content:
        base = read(path.parent / root.section(key).text(EXTENDS))
        content = copy(content)
        del content[EXTENDS]
    if key == ROBOT:
        content = with_arm_descriptions(content, path.parent)
    elif key == CONDITIONS:
        content = with_histories(content, path.parent)
    own: Mapping = standing_in(content, path)
    return own if base is None else merged(base, own, path)


def _read_schedule(path: Path) -> Mapping:
    return load_mapping(read_file(path), path)


def _only(root: Section, key: str) -> Mapping:
    """Return a mapping with one key of the file, whose value is a mapping."""
    root.section(key)  # rejects anything else
    own = Mapping()
    own[key] = root.value(key)
    return own


def _changes(root: Section, role: str, base: Mapping | None, path: Path) -> Mapping:
    """Return what holds for one role alone, robot and deputy, on top of what was extended."""
    changes = Mapping() if base is None else base
    if role not in root:
        return changes
    root.section(role).only((), (ROBOT, DEPUTY))
    own: Mapping = root.value(role)
    for key in own:
        root.section(role).section(key)
        if key == ROBOT:
            own = copy(own)
            own[key] = with_arm_descriptions(own[key], path.parent)
    result = copy(changes)
    for key, value in own.items():
        old = changes.get(key)
        result[key] = merged(old, value, path, complete=False) if old else standing_in(value, path)
    return result


def _parameters(root: Section, base: ScenarioFile | None) -> dict[str, ParameterValues]:
    """Return the parameters by section, on top of those that were extended."""
    found = {}
    for name in _SECTIONS:
        values = ParameterValues()
        sources = [(root.section(name), tuple(root.section(name).keys))] if name in root else []
        sources += [(root, (key,)) for key, section in SHORT.items() if section == name and key in root]
        if base:
            values.update(base.parameters[name])
            values.places.update(base.parameters[name].places)
        for section, keys in sources:
            values.update((key, section.value(key)) for key in keys)
            values.places.update((key, section.where(key)) for key in keys)
        found[name] = values
    return found
