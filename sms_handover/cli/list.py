"""``sms-handover list``: what there is by name, each with one line."""

import json
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from sms_handover.analysis.definitions import DEFINITIONS
from sms_handover.analysis.records import UNITS
from sms_handover.cli.columns import columns
from sms_handover.cli.verbs import PROGRAM
from sms_handover.configuration.scenario_file import load_scenario_file, scenario_names
from sms_handover.control.registry import law_named, law_names, package_of
from sms_handover.errors import ConfigurationError

Row = dict[str, str]


class Kind(NamedTuple):
    """One kind of things, the columns of their table, and how they are found."""

    text: str
    head: Sequence[str]
    rows: Callable[[], list[Row]]


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
    parser.add_argument("--json", action="store_true", help="print JSON")


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    chosen = (options.kind,) if options.kind else _DEFAULT
    found = {name: KINDS[name].rows() for name in chosen}
    if options.json:
        print(json.dumps(found[options.kind] if options.kind else found, indent=2))
        return 0
    print("\n\n".join(_table(KINDS[name].head, rows) for name, rows in found.items()))
    if not options.kind:
        others = [name for name in KINDS if name not in found]
        print(f"\nThere are also {' and '.join(others)}: '{PROGRAM} list {others[0]}'.")
    return 0


def _table(head: Sequence[str], rows: Sequence[Row]) -> str:
    """Return things as text."""
    return columns([head, *([row[column] for column in head] for row in rows)])


def _scenarios() -> list[Row]:
    return [
        {"scenario": name, "description": load_scenario_file(name).description} for name in scenario_names()
    ]


def _laws() -> list[Row]:
    return [_law(name) for name in law_names()]


def _law(name: str) -> Row:
    """Return a law of this or another package; of one that cannot be loaded why it cannot."""
    try:
        law = law_named(name)
    except ConfigurationError as error:
        return {"law": name, "package": package_of(name), "needs": "", "description": f"unusable: {error}"}
    needs = ", ".join(sorted(need.value for need in law.needs))
    return {"law": name, "package": package_of(name), "needs": needs, "description": law.description}


def _metrics() -> list[Row]:
    return [{"metric": name, "unit": unit, "definition": DEFINITIONS[name]} for name, unit in UNITS.items()]


KINDS: Mapping[str, Kind] = MappingProxyType(
    {
        "scenarios": Kind("what can be run", ("scenario", "description"), _scenarios),
        "laws": Kind("control laws and what they need", ("law", "package", "needs", "description"), _laws),
        "metrics": Kind("figures of 'compare --csv'", ("metric", "unit", "definition"), _metrics),
    }
)
_DEFAULT = ("scenarios", "laws")
