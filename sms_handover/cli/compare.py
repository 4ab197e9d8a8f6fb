"""``sms-handover compare``: recorded runs side by side, with the paper's claims."""

import json
from argparse import ArgumentParser, Namespace
from pathlib import Path

from sms_handover.analysis.comparison import compare
from sms_handover.analysis.summary import summary
from sms_handover.analysis.table import render
from sms_handover.bag.info import BagInfo, read_info
from sms_handover.bag.reader import read_run
from sms_handover.cli.folders import bag_of
from sms_handover.errors import ConfigurationError
from sms_handover.topics import CONTROLLER


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
    runs, laws = {}, {}
    for path in options.runs:
        name = path.resolve().name
        if name in runs:
            raise ConfigurationError(f"two runs are named {name!r}; rename one folder")
        runs[name] = read_run(bag_of(path))
        laws[name] = law_of(read_info(bag_of(path)))
    comparison = compare(runs, laws)
    print(render(comparison))
    if options.json:
        options.json.write_text(json.dumps(summary(comparison), indent=2) + "\n", encoding="utf-8")
    return 0


def law_of(info: BagInfo) -> str:
    """Return the control law of a recorded run, as its controller was told."""
    return str((info.parameters or {}).get(CONTROLLER, {}).get("law", "unknown"))
