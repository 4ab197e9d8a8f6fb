"""``sms-handover bag``: inspect, check, recover and export recordings, and the robot of a run."""

from argparse import ArgumentParser, Namespace
from importlib import import_module

_COMMANDS = {
    "info": "show the contents of a bag: topics, times, controller, versions, loss ledger",
    "check": "check whether a bag is complete, and what is missing",
    "recover": "recover a truncated or damaged bag",
    "export": "export tables as CSV, Parquet or MATLAB files",
    "robot": "write the robot of a run as URDF, SRDF (MoveIt) and MJCF (MuJoCo)",
}


def add_parser(parser: ArgumentParser) -> None:
    """Add the subcommands."""
    parser.description = (
        "Inspect recordings. Every command takes a run folder, a bag folder or an .mcap file, of any "
        "ROS 2 recorder that writes MCAP. See docs/bags.md."
    )
    commands = parser.add_subparsers(dest="bag_command", metavar="COMMAND", required=True)
    for name, text in _COMMANDS.items():
        import_module(f"{__name__}.{name}").add_parser(commands.add_parser(name, help=text))


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    return int(import_module(f"{__name__}.{options.bag_command}").command(options))
