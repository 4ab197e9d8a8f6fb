"""``sms-handover bag play``: publish the messages of a bag, with the options of ``ros2 bag play``."""

import re
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from dataclasses import fields
from pathlib import Path

from sms_handover.cli.node_options import (
    add_graph_options,
    add_storage_option,
    add_topic_options,
    given,
    run_in_process,
)
from sms_handover.errors import ConfigurationError
from sms_handover.launcher.run_folder import bag_of
from sms_handover.nodes.player import KEYS
from sms_handover.nodes.player import main as run_player
from sms_handover.playback.parameters import PlayerParameters

_CLOCK_HZ = 40.0  # [Hz] default of --clock, as of ros2 bag play
_WAIT_S = 60.0  # [s] of wall time, default of --wait


def add_parser(parser: ArgumentParser) -> None:
    """Add the options."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Publish the messages of any ROS 2 MCAP bag: the same bytes, each when its time comes, with the\n"
        "recorded QoS. No message is dropped to keep the rate: if subscribers or this machine are too slow,\n"
        "the playback is late and reports it.\n\n"
        f"keys, if standard input is a terminal:\n  {KEYS}"
    )
    parser.epilog = (
        "services of the node /player: pause resume toggle_paused play_next stop set_rate seek\n"
        "exit codes: 0 complete; 1 damaged bag, or no subscriber in time; 2 wrong input, nothing played;\n"
        "3 messages were not acknowledged or not played; 130 interrupted"
    )
    parser.set_defaults(loop=None, start_paused=None, keyboard=None)  # not given: as the parameter files say
    parser.add_argument("bag", type=Path, metavar="BAG", help="bag folder, .mcap file or run folder")
    add_storage_option(parser)
    group = parser.add_argument_group("time")
    group.add_argument("-r", "--rate", type=float, metavar="R", help="bag time per wall time (default: 1)")
    group.add_argument("--start-offset", type=float, metavar="S", help="skip S s at the start")
    group.add_argument(
        "--playback-duration", "--duration", type=float, dest="duration", metavar="S", help="play S s"
    )
    group.add_argument("-l", "--loop", action="store_true", help="start over at the end")
    group.add_argument("-p", "--start-paused", action="store_true", help="start paused")
    group.add_argument(
        "--clock",
        type=float,
        nargs="?",
        const=_CLOCK_HZ,
        metavar="HZ",
        help=f"publish a generated /clock (default rate: {_CLOCK_HZ:g} Hz) instead of the recorded one",
    )
    add_topic_options(parser, "play")
    parser.add_argument(
        "-m", "--remap", nargs="+", default=[], metavar="OLD:=NEW", help="publish topics under other names"
    )
    parser.add_argument(
        "--qos-profile-overrides-path",
        type=Path,
        dest="qos_overrides",
        metavar="FILE",
        help="YAML file of QoS policies by topic (reliability, depth ...) that override the recorded ones",
    )
    parser.add_argument(
        "--wait",
        type=float,
        nargs="?",
        const=_WAIT_S,
        metavar="S",
        help=f"start when every topic has a subscriber, fail after S s (default: {_WAIT_S:g})",
    )
    parser.add_argument(
        "--ack-timeout",
        type=float,
        metavar="S",
        help="wait S s for acknowledgements at the end (default: 30)",
    )
    parser.add_argument(
        "--read-ahead-queue-size",
        type=int,
        dest="read_ahead",
        metavar="N",
        help="messages held in memory (default: 1000)",
    )
    parser.add_argument(
        "--disable-keyboard-controls", action="store_false", dest="keyboard", help="read no keys"
    )
    add_graph_options(parser)


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    options.bag = bag_of(options.bag)
    for rule in options.remap:
        if rule.count(":=") != 1 or not all(rule.split(":=")):
            raise ConfigurationError(f"remapping {rule!r} is not of the form OLD:=NEW")
    options.rename = [rule for rule in options.remap if not _ros_permits(rule.split(":=")[0])]
    values = given(options, [field.name for field in fields(PlayerParameters)])
    rules = [rule for rule in options.remap if rule not in options.rename]
    return run_in_process(run_player, options, values, rules)


def _ros_permits(name: str) -> bool:
    """Whether ROS takes a name in a remapping rule."""
    return re.fullmatch(r"(\w+:)?[~/]?\w+(/\w+)*", name, re.ASCII) is not None
