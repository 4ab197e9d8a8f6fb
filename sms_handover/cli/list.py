"""``sms-handover list``: what there is by name, each with one line."""

import json
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from sms_handover.analysis.definitions import DEFINITIONS
from sms_handover.analysis.records import UNITS
from sms_handover.cli.columns import columns
from sms_handover.cli.verbs import PROGRAM
from sms_handover.configuration.conditions_content import condition_names, read_conditions_content
from sms_handover.configuration.documents import Replacements, documents_of
from sms_handover.configuration.scenario_file import COMMON, DESCRIPTION, load_scenario_file, scenario_names
from sms_handover.configuration.value_paths import parameter_paths, value_paths
from sms_handover.configuration.values import CONDITIONS, MODEL, ROBOT, SCHEDULE
from sms_handover.control.registry import law_named, law_names, package_of
from sms_handover.errors import ConfigurationError
from sms_handover.graph.topics import LOOP_NODES
from sms_handover.simulation.scenario import load_scenario

Row = dict[str, object]


class Kind(NamedTuple):
    """One kind of things, the columns of their table, and how they are found.

    The rows may be those of a scenario, by default the one that ``run`` takes.
    """

    text: str
    head: Sequence[str]
    rows: Callable[[str], list[Row]]
    of_scenario: bool = False


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.description = "Print the names that other commands take, with a line on each."
    parser.epilog = f"'{PROGRAM} show NAME' prints a scenario in full, or the parameters of a law."
    kinds = "; ".join(f"{name}: {kind.text}" for name, kind in KINDS.items())
    parser.add_argument(
        "kind",
        nargs="?",
        choices=tuple(KINDS),
        metavar="KIND",
        help=f"{kinds} (default: {' and '.join(_DEFAULT)})",
    )
    parser.add_argument(
        "scenario", nargs="?", metavar="SCENARIO", help="whose paths, a name or a file (default: that of run)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    chosen = (options.kind,) if options.kind else _DEFAULT
    if options.scenario and not KINDS[options.kind].of_scenario:
        raise ConfigurationError(f"{options.kind} are not those of a scenario: give none")
    found = {name: KINDS[name].rows(options.scenario or "") for name in chosen}
    if options.json:
        print(json.dumps(found[options.kind] if options.kind else found, indent=2))
        return 0
    print("\n\n".join(_table(KINDS[name].head, rows) for name, rows in found.items()))
    if not options.kind:
        others = [f"'{PROGRAM} list {name}'" for name in KINDS if name not in found]
        print(f"\nThere are also {' and '.join(others)}.")
    return 0


def _table(head: Sequence[str], rows: Sequence[Row]) -> str:
    """Return things as text."""
    return columns([head, *([_text(row[column]) for column in head] for row in rows)])


def _text(value: object) -> str:
    """Return a cell; what is not given is empty."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return str([*value] if isinstance(value, tuple) else value)


def _scenarios(_: str) -> list[Row]:
    names = scenario_names()
    return [{"scenario": name, "description": load_scenario_file(name).description} for name in names]


def _conditions(_: str) -> list[Row]:
    return [
        {"conditions": name, "description": read_conditions_content(Path(name)).get(DESCRIPTION, "")}
        for name in condition_names()
    ]


def _laws(_: str) -> list[Row]:
    return [_law(name) for name in law_names()]


def _law(name: str) -> Row:
    """Return a law of this or another package; of one that cannot be loaded why it cannot."""
    try:
        law = law_named(name)
    except ConfigurationError as error:
        return {"law": name, "package": package_of(name), "needs": "", "description": f"unusable: {error}"}
    needs = ", ".join(sorted(need.value for need in law.needs))
    return {"law": name, "package": package_of(name), "needs": needs, "description": law.description}


def _metrics(_: str) -> list[Row]:
    return [{"metric": name, "unit": unit, "definition": DEFINITIONS[name]} for name, unit in UNITS.items()]


def _paths(scenario: str) -> list[Row]:
    """Return every value of robot, deputy, schedule, conditions and parameters, as a scenario has it."""
    parameters = load_scenario(scenario).parameters
    documents = documents_of(load_scenario_file(parameters.common.scenario), Replacements(), MODEL)
    contents = {
        ROBOT: documents.robot,
        SCHEDULE: documents.schedule,
        CONDITIONS: documents.conditions,
    }
    found = [path for document, content in contents.items() for path in value_paths(document, content)]
    for node in (COMMON, *LOOP_NODES):
        group = getattr(parameters, node)
        found += parameter_paths(node, type(group), asdict(group))
    return [asdict(path) for path in found]


KINDS: Mapping[str, Kind] = MappingProxyType(
    {
        "scenarios": Kind("what can be run", ("scenario", "description"), _scenarios),
        "conditions": Kind("what is not ideal about a run", ("conditions", "description"), _conditions),
        "laws": Kind("control laws and what they need", ("law", "package", "needs", "description"), _laws),
        "metrics": Kind("figures of 'compare --csv'", ("metric", "unit", "definition"), _metrics),
        "paths": Kind(
            "what '-p PATH:=VALUE' and scenario files can set",
            ("path", "value", "unit", "allowed", "description"),
            _paths,
            of_scenario=True,
        ),
    }
)
_DEFAULT = ("scenarios", "laws")
