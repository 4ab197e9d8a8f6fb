"""Node options: command line options that become parameters of a node in this process."""

import os
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterable, Mapping, Sequence

from sms_handover.errors import ConfigurationError
from sms_handover.launcher.domain import LAST_DOMAIN
from sms_handover.ros.parameters import as_arguments


def add_topic_options(parser: ArgumentParser, verb: str) -> None:
    """Add the options that choose topics."""
    group = parser.add_argument_group("topics")
    group.add_argument("--topics", nargs="+", default=[], metavar="TOPIC", help=f"topics to {verb}")
    group.add_argument("-e", "--regex", metavar="REGEX", help=f"{verb} the topics that match, too")
    group.add_argument(
        "--exclude-topics", nargs="+", default=[], metavar="TOPIC", help=f"topics not to {verb}"
    )
    group.add_argument("-x", "--exclude-regex", metavar="REGEX", help=f"do not {verb} the topics that match")


def add_storage_option(parser: ArgumentParser) -> None:
    """Add the storage format, which a command line of ``ros2 bag`` may name: there is one."""
    parser.add_argument("-s", "--storage", choices=("mcap",), default="mcap", help="storage format")


def add_graph_options(parser: ArgumentParser) -> None:
    """Add the option that chooses the graph."""
    parser.add_argument(
        "--domain-id",
        type=int,
        metavar="N",
        help="ROS domain (default: ROS_DOMAIN_ID, as for other ROS tools)",
    )


def given(options: Namespace, names: Iterable[str]) -> dict[str, object]:
    """Return the parameters among ``names`` that the options set."""
    values = {name: getattr(options, name) for name in names}
    return {name: value for name, value in values.items() if value is not None and value != []}


def run_in_process(
    main: Callable[[Sequence[str]], int],
    options: Namespace,
    parameters: Mapping[str, object],
    remap: Sequence[str] = (),
) -> int:
    """Run a node in this process; raises ConfigurationError on a domain that does not exist."""
    if options.domain_id is not None:
        if not 0 <= options.domain_id <= LAST_DOMAIN:
            raise ConfigurationError(f"domain id is {options.domain_id}, must be 0 to {LAST_DOMAIN}")
        os.environ["ROS_DOMAIN_ID"] = str(options.domain_id)
    rules = [part for rule in remap for part in ("--remap", rule)]
    return main(["sms-handover", "--ros-args", *rules, *as_arguments(parameters)])
