"""``sms-handover play``: publish the messages of a bag again."""

from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path

from sms_handover.cli.node_options import add_graph_options, add_topic_options, given, run_in_process
from sms_handover.errors import ConfigurationError
from sms_handover.launcher.closed_loop import closed_loop
from sms_handover.launcher.run_folder import bag_of
from sms_handover.nodes.player import KEYS
from sms_handover.nodes.player import main as run_player

_PARAMETERS = {
    "bag": "bag",
    "rate": "rate",
    "start_offset": "start_offset",
    "playback_duration": "duration",
    "loop": "loop",
    "start_paused": "start_paused",
    "topics": "topics",
    "regex": "regex",
    "exclude_topics": "exclude_topics",
    "exclude_regex": "exclude_regex",
    "clock": "clock",
    "qos_profile_overrides_path": "qos_overrides",
    "wait": "wait",
    "ack_timeout": "ack_timeout",
    "read_ahead_queue_size": "read_ahead",
}
_OF_CLOSED_LOOP = {"bag", "closed_loop", "domain_id"}
_CLOCK_HZ = 40.0  # [Hz] of a generated /clock if no rate is given, as with ros2 bag play
_WAIT_S = 60.0  # [s] of wall time to wait for subscribers if no time is given


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Publish the messages of an MCAP bag, of a run of ours or of any other ROS 2 graph: the same bytes,\n"
        "each when its time comes, with the quality of service that was recorded. No message is left out to\n"
        "keep the rate: if subscribers or this machine are too slow, playback is late, and says so.\n\n"
        f"keys, if standard input is a terminal:\n  {KEYS}"
    )
    parser.epilog = (
        "services of the node /player: pause resume toggle_paused play_next stop set_rate seek\n"
        "exit codes: 0 played to the end, everything confirmed; 1 the bag is damaged, or nobody subscribed\n"
        "in time; 2 wrong input, nothing was played; 3 a subscriber has not confirmed everything;\n"
        "130 interrupted. With --closed-loop: 0 every bit is the same; 1 the states differ, or the plant died"
    )
    parser.add_argument("bag", type=Path, metavar="BAG", help="bag folder or file, or output folder of a run")
    group = parser.add_argument_group("time")
    group.add_argument("-r", "--rate", type=float, metavar="R", help="bag time per wall time (default: 1)")
    group.add_argument("--start-offset", type=float, metavar="S", help="leave out so many s at the start")
    group.add_argument(
        "--playback-duration", "--duration", type=float, metavar="S", help="play so many s of the bag"
    )
    group.add_argument("-l", "--loop", action="store_true", help="begin again at the end")
    group.add_argument("-p", "--start-paused", action="store_true", help="begin paused")
    group.add_argument(
        "--clock",
        type=float,
        nargs="?",
        const=_CLOCK_HZ,
        metavar="HZ",
        help=f"publish a generated /clock ({_CLOCK_HZ:g} Hz if no rate is given) instead of the recorded one",
    )
    add_topic_options(parser, "play")
    parser.add_argument(
        "-m", "--remap", nargs="+", default=[], metavar="OLD:=NEW", help="publish topics under other names"
    )
    parser.add_argument(
        "--qos-profile-overrides-path",
        type=Path,
        metavar="FILE",
        help="YAML file: topic -> policies (reliability, durability, depth ...) instead of the recorded ones",
    )
    parser.add_argument(
        "--wait",
        type=float,
        nargs="?",
        const=_WAIT_S,
        metavar="S",
        help=f"begin when every topic has a subscriber, fail after S s ({_WAIT_S:g} if not given)",
    )
    parser.add_argument(
        "--ack-timeout",
        type=float,
        metavar="S",
        help="wait so long for confirmation at the end (default: 30)",
    )
    parser.add_argument(
        "--read-ahead-queue-size", type=int, metavar="N", help="messages held in memory (default: 1000)"
    )
    parser.add_argument(
        "--closed-loop",
        action="store_true",
        help="of a run of ours: give the recorded commands and phases, and only them, to a live plant in "
        "lock step, and tell how far its states are from the recorded ones; exit code 0 if not by a bit",
    )
    parser.add_argument("--disable-keyboard-controls", action="store_true", help="take no keys")
    add_graph_options(parser)


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    options.bag = bag_of(options.bag)
    if options.closed_loop:
        of_player = given(options, {name: name for name in vars(options)}).keys() - _OF_CLOSED_LOOP
        if of_player:
            raise ConfigurationError(f"--closed-loop takes no other option, given is {min(of_player)}")
        return closed_loop(options.bag, options.domain_id)
    for rule in options.remap:
        if rule.count(":=") != 1 or not all(rule.split(":=")):
            raise ConfigurationError(f"remapping {rule!r} is not of the form OLD:=NEW")
    values = given(options, _PARAMETERS)
    if options.disable_keyboard_controls:
        values["keyboard"] = False
    return run_in_process(run_player, options, values, options.remap)
