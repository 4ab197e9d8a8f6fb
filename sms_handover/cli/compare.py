"""``sms-handover compare``: recorded runs side by side, with the paper's claims."""

import json
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

from sms_handover.analysis.comparison import compare
from sms_handover.analysis.summary import summary
from sms_handover.analysis.table import render
from sms_handover.bag.info import read_info
from sms_handover.bag.reader import read_run
from sms_handover.cli.folders import bag_of
from sms_handover.errors import ConfigurationError
from sms_handover.parameters import build
from sms_handover.plant.deputy import GraspTolerance
from sms_handover.plant.parameters import PlantParameters
from sms_handover.topics import CONTROLLER, PLANT


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.description = (
        "Read bags and print what happened in each, side by side. With one run under nmpc and one under pid "
        "the paper's claims are judged. docs/metrics.md defines every figure."
    )
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="output folder of a run, or a bag")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to a JSON file too")


def command(options: Namespace) -> int:
    """Carry out the command; return the exit code."""
    runs, laws, tolerances = {}, {}, set()
    for path in options.runs:
        name = path.resolve().name
        if name in runs:
            raise ConfigurationError(f"two runs are named {name!r}; rename one folder")
        runs[name] = read_run(bag_of(path))
        parameters = read_info(bag_of(path)).parameters or {}
        laws[name] = str(parameters.get(CONTROLLER, {}).get("law", "unknown"))
        tolerances.add(_tolerance_in(parameters.get(PLANT, {})))
    comparison = compare(runs, laws)
    print(render(comparison, tolerances.pop() if len(tolerances) == 1 else None))
    if options.json:
        options.json.write_text(json.dumps(summary(comparison), indent=2) + "\n", encoding="utf-8")
    return 0


def _tolerance_in(plant: Mapping[str, object]) -> GraspTolerance | None:
    """Return the grasp tolerance among the recorded parameters of a plant, if it is there."""
    known = {item.name: plant[item.name] for item in fields(PlantParameters) if item.name in plant}
    return build(PlantParameters, known, "recorded plant").grasp_tolerance if known else None
