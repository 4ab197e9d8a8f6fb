"""``sms-handover bag``: look into recordings, check them, recover them, take tables out of them."""

from argparse import ArgumentParser, Namespace
from importlib import import_module

_COMMANDS = {
    "info": "what a bag holds: topics, times, controller, versions, loss ledger",
    "check": "whether a bag is complete, and what is missing",
    "recover": "make a whole bag of a truncated or damaged one",
    "export": "tables as CSV or Parquet",
}


def add_parser(parser: ArgumentParser) -> None:
    """Describe the commands."""
    parser.description = (
        "Look into recordings. Every command takes the output folder of a run, the folder of a bag, or one "
        ".mcap file, of sms-handover or of any other ROS 2 recorder that writes MCAP. See docs/bags.md."
    )
    commands = parser.add_subparsers(dest="bag_command", metavar="COMMAND", required=True)
    for name, text in _COMMANDS.items():
        import_module(f"{__name__}.{name}").add_parser(commands.add_parser(name, help=text))


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    return int(import_module(f"{__name__}.{options.bag_command}").command(options))
