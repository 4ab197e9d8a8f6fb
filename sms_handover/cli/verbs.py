"""The verbs of the command line: what each does, and which replaces a name of the first edition."""

from argparse import REMAINDER, SUPPRESS, ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from sms_handover import __version__
from sms_handover.cli import bag, campaign
from sms_handover.errors import ConfigurationError, UnknownNameError

PROGRAM = "sms-handover"
BAG, CAMPAIGN = "bag", "campaign"  # verbs that have verbs of their own

GROUPS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "choose": {
            "list": "list what has a name: scenarios, control laws, metrics, paths of values",
            "show": "print a scenario in full, to copy from, or the parameters of a law",
            "check": "check whether a scenario can be run, and where each phase ends",
        },
        "run": {
            "run": "run the handover as a graph of ROS 2 nodes and record it",
            "simulate": "run it in one process, without ROS",
            CAMPAIGN: "run it many times with drawn values, under one law or several",
        },
        "look at runs": {
            "compare": "print recorded runs side by side, with the paper's claims",
            "report": "write an HTML page about recorded runs, or the paper's figures for print",
            "view": "show recorded runs, or a running graph, in 3D in a browser",
        },
        "trust runs": {
            "verify": "compute a recorded run again and compare bit by bit",
            BAG: "inspect, check, recover, export, play or record a bag",
        },
    }
)
FAMILIES: Mapping[str, tuple[str, Mapping[str, str]]] = MappingProxyType(
    {BAG: (bag.DESCRIPTION, bag.COMMANDS), CAMPAIGN: (campaign.DESCRIPTION, campaign.COMMANDS)}
)
VERBS: Mapping[str, str] = {verb: text for group in GROUPS.values() for verb, text in group.items()}

_DESCRIPTION = "A free-floating spacecraft with two arms hands a CubeSat from one arm to the other."
_RESERVED = {
    "plan": "find schedules with it",
}


@dataclass(frozen=True)
class Call:
    """A verb, such as ``bag info``, and its arguments; ``notice`` is what to tell about the name typed."""

    verb: str
    arguments: tuple[str, ...]
    notice: str = ""

    @property
    def module(self) -> str:
        """Return the name of the module of the verb."""
        return f"sms_handover.cli.{self.verb.replace(' ', '.')}"


def call_of(arguments: Sequence[str] | None) -> Call:
    """Return the verb that a command line names; of argparse are help, version and a missing verb.

    Raises UnknownNameError for an unknown one, ConfigurationError for one that is yet to come.
    """
    parser = _parser(PROGRAM, _DESCRIPTION, GROUPS)
    parser.add_argument("--version", action="version", version=f"{PROGRAM} {__version__}")
    given = parser.parse_args(arguments)
    if given.verb not in OLD_NAMES:
        return _call(given.verb, given.arguments)
    now, rest = OLD_NAMES[given.verb](given.arguments)
    verb, *options = now.split()
    notice = f"'{given.verb}' is now '{now}'; the old name works until the next release"
    return replace(_call(verb, [*options, *rest]), notice=notice)


def _call(verb: str, words: Sequence[str]) -> Call:
    """Return the call of a verb by its name of today."""
    if verb in _RESERVED:
        raise ConfigurationError(f"'{verb}' is not there yet: a later release will {_RESERVED[verb]}")
    if verb not in VERBS:
        raise UnknownNameError("command", verb, VERBS)
    if verb not in FAMILIES:
        return Call(verb, tuple(words))
    description, commands = FAMILIES[verb]
    inner = _parser(f"{PROGRAM} {verb}", description, {"commands": commands}).parse_args(words)
    if inner.verb not in commands:
        raise UnknownNameError(f"{verb} command", inner.verb, commands)
    return Call(f"{verb} {inner.verb}", tuple(inner.arguments))


def _parser(program: str, description: str, groups: Mapping[str, Mapping[str, str]]) -> ArgumentParser:
    """Return a parser that takes a verb and leaves the rest to it; its help lists the verbs."""
    width = max(len(verb) for group in groups.values() for verb in group)
    listed = [
        "\n".join([f"{title}:", *(f"  {verb:<{width}}  {text}" for verb, text in group.items())])
        for title, group in groups.items()
    ]
    parser = ArgumentParser(
        prog=program,
        usage=f"{program} [-h] COMMAND ...",
        description=description,
        epilog="\n\n".join([*listed, f"See '{program} COMMAND --help'."]),
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("verb", metavar="COMMAND", help=SUPPRESS)
    parser.add_argument("arguments", nargs=REMAINDER, metavar="...", help=SUPPRESS)
    return parser


def _play(arguments: Sequence[str]) -> tuple[str, list[str]]:
    """Return what ``play`` is now: two verbs."""
    rest = [argument for argument in arguments if argument != "--closed-loop"]
    return "verify --with plant" if len(rest) < len(arguments) else f"{BAG} play", rest


def _figures(arguments: Sequence[str]) -> tuple[str, list[str]]:
    """Return what ``figures`` is now: ``--output`` is that of the page, so the folder has another option."""
    parser = ArgumentParser(prog=f"{PROGRAM} figures", add_help=False)
    parser.add_argument("-o", "--output", default="figures")
    known, rest = parser.parse_known_args(arguments)
    return "report --figures", [known.output, *rest]


OLD_NAMES: Mapping[str, Callable[[Sequence[str]], tuple[str, Sequence[str]]]] = MappingProxyType(
    {
        "reproduce": lambda arguments: ("verify", arguments),
        "play": _play,
        "record": lambda arguments: (f"{BAG} record", arguments),
        "figures": _figures,
    }
)
