"""A scenario written out as YAML with every value, to copy from."""

from collections.abc import Iterable, Iterator
from dataclasses import asdict, replace
from typing import Any

from sms_handover.configuration.documents import as_yaml
from sms_handover.configuration.parameters import specs_of
from sms_handover.configuration.scenario_file import COMMON, SHORT, load_scenario_file
from sms_handover.configuration.values import roles_of
from sms_handover.graph.topics import CONTROLLER, IK, PLANT, TRAJECTORY
from sms_handover.simulation.scenario import load_scenario, scenario_text

_WRITTEN_OUT = {"scenario", "robot", "schedule", "conditions"}  # parameters whose content stands in the text
_HOW = {  # parameters that say how a run is carried out: they change none of its numbers
    "mode",
    "transport",
    "cpu",
    "priority",
    "lock_memory",
    "autostart",
    "peers",
    "external",
}


def scenario_yaml(name: str) -> str:
    """Return a scenario, shipped or in a file, as one that extends nothing and names no other file.

    It has the robot, the schedule and every parameter, and makes the same run, bit for bit. Of the
    parameters that say how a run is carried out it has those that the scenario sets. Raises
    ConfigurationError where the scenario cannot be loaded.
    """
    parameters = load_scenario(name).parameters
    scenario = load_scenario_file(name)
    text = scenario_text(parameters.common, scenario).rstrip()
    of_roles = tuple(value for value in parameters.common.values if any(roles_of([value])))
    parameters = replace(parameters, common=replace(parameters.common, values=of_roles))
    given = scenario.parameters[COMMON]
    apart = _WRITTEN_OUT | (_HOW - given.keys()) | (set() if of_roles else {"values"})
    short = [
        f"{key}: {_written(getattr(getattr(parameters, section), key))}" for key, section in SHORT.items()
    ]
    parts = [text, "\n".join(short)]
    for section in (COMMON, PLANT, TRAJECTORY, IK, CONTROLLER):
        parts.append("\n".join([f"{section}:", *_lines(getattr(parameters, section), apart | SHORT.keys())]))
    return "\n\n".join(parts) + "\n"


def _lines(parameters: Any, apart: Iterable[str]) -> Iterator[str]:
    """Yield a line for each parameter of a section, with its unit, its range and what it means."""
    values = asdict(parameters)
    for name, spec in specs_of(type(parameters)).items():
        if name not in apart:
            meaning = "; ".join(filter(None, (spec.unit.replace("-", ""), spec.allowed, spec.description)))
            yield f"  {name}: {_written(values[name])}  # {meaning}"


def _written(value: object) -> str:
    """Return the value of a parameter as YAML in one line."""
    items = list(value) if isinstance(value, tuple) else [value]
    text = as_yaml(items).strip()  # a list of scalars
    return text if isinstance(value, tuple) else text.removeprefix("[").removesuffix("]")
