"""``sms-handover show``: one thing in full, to copy from."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from pathlib import Path

from sms_handover.cli.columns import columns
from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.parameters import defaults_of, read_parameter_files
from sms_handover.configuration.scenario_file import scenario_names
from sms_handover.configuration.value_paths import parameter_paths
from sms_handover.control.registry import SHIPPED, law_named, law_names, package_of
from sms_handover.errors import UnknownNameError
from sms_handover.graph.topics import CONTROLLER
from sms_handover.simulation.scenario_yaml import scenario_yaml

_HEAD = ("parameter", "unit", "default", "allowed", "meaning")


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.description = (
        "Print a scenario as YAML with every value, to copy from: it extends nothing, names no other file, "
        "and makes the same run, bit for bit. Or print the parameters of a control law, with unit, default "
        "and range."
    )
    parser.epilog = "example: sms-handover show paper > mine.yaml; sms-handover simulate mine.yaml"
    parser.add_argument(
        "name", metavar="NAME", help="name of a scenario or law, see 'sms-handover list', or a scenario file"
    )


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    if options.name in law_names():
        print("\n".join(_law(options.name)))
        return 0
    if options.name not in scenario_names() and not Path(options.name).exists():
        raise UnknownNameError("scenario or law", options.name, (*scenario_names(), *law_names()))
    print(scenario_yaml(options.name), end="")
    return 0


def _law(name: str) -> Iterator[str]:
    """Yield the lines on a law."""
    law = law_named(name)
    needs = ", ".join(sorted(need.value for need in law.needs)) or "states, phases and joint references"
    yield from (f"{name}: {law.description}", f"package: {package_of(name)}", f"needs: {needs}", "")
    shipped = read_parameter_files([config_file("controller.yaml")], CONTROLLER) if name in SHIPPED else {}
    found = parameter_paths(CONTROLLER, law.parameters, {**defaults_of(law.parameters), **shipped})
    yield columns([_HEAD, *((p.path, p.unit, str(p.value), p.allowed, p.description) for p in found)])
    yield f"\nTo set one: -p {found[0].path}:={found[0].value}" if found else ""
