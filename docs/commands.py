"""The page of all commands, from their parsers.

The output of argparse differs between versions of Python and with the width of the terminal, so the page is
made from the parsers themselves.
"""

from argparse import (
    ONE_OR_MORE,
    OPTIONAL,
    ZERO_OR_MORE,
    Action,
    ArgumentParser,
    RawDescriptionHelpFormatter,
    _HelpAction,
)
from collections.abc import Iterable, Iterator
from importlib import import_module

from docs.tables import WRITTEN_BY, plain, table
from sms_handover.cli.verbs import FAMILIES, GROUPS, OLD_NAMES, PROGRAM

_EXIT_CODES = [
    ("0", "success"),
    ("1", "failed, or a check failed: runs differ, a bag is damaged, a node died"),
    ("2", "wrong input; nothing was started or written"),
    ("3", "done, but messages of the recording are missing"),
    ("4", "done, but a grasp missed"),
    ("130", "interrupted"),
]


def commands_page() -> str:
    """Return the page."""
    parts = [
        "# Commands",
        WRITTEN_BY,
        """\
After `make handover` the command is `.venv/bin/sms-handover`; in a ROS workspace it is on the path. `--help`
of any command prints the text of this page. An error is one line on standard error with the value, its unit
and what is allowed.""",
        table(("Exit code", "Meaning"), _EXIT_CODES),
        table(("Command", "Does"), _listed()),
        f"""\
Names of the first edition work for one more release and say what replaces them: {_replaced()}.""",
    ]
    for verbs in GROUPS.values():
        for verb in verbs:
            parts += _family(verb) if verb in FAMILIES else _command(verb, "##")
    return "\n\n".join(parts) + "\n"


def parser_of(verb: str) -> ArgumentParser:
    """Return the parser of a verb such as ``compare`` or ``bag info``."""
    parser = ArgumentParser(prog=f"{PROGRAM} {verb}")
    import_module(f"sms_handover.cli.{verb.replace(' ', '.')}").add_parser(parser)
    return parser


def _listed() -> Iterator[tuple[str, str]]:
    """Yield a row per verb, those that a verb has of its own below it."""
    for verbs in GROUPS.values():
        for verb, text in verbs.items():
            yield _link(verb), text
            _, commands = FAMILIES.get(verb, ("", {}))
            yield from ((_link(f"{verb} {name}"), text) for name, text in commands.items())


def _link(verb: str) -> str:
    """Return a link to the section of a verb."""
    return f"[`{verb}`](#{PROGRAM}-{verb.replace(' ', '-')})"


def _replaced() -> str:
    """Return every old name with what it is now."""
    old = [line.split() for line in (*OLD_NAMES, "play --closed-loop")]
    return ", ".join(f"`{' '.join(words)}` is `{OLD_NAMES[words[0]](words[1:])[0]}`" for words in old)


def _family(verb: str) -> Iterator[str]:
    """Yield the section of a verb that has verbs of its own, and theirs."""
    description, commands = FAMILIES[verb]
    yield f"## {PROGRAM} {verb}"
    yield " ".join(description.split())
    for name in commands:
        yield from _command(f"{verb} {name}", "###")


def _command(verb: str, level: str) -> Iterator[str]:
    """Yield the section of a verb."""
    parser = parser_of(verb)
    yield f"{level} {parser.prog}"
    yield from _text(parser.description or "", parser)
    taken = [action for action in parser._actions if not isinstance(action, _HelpAction)]
    words = [parser.prog, *(_positional(a) for a in taken if not a.option_strings)]
    yield f"```text\n{' '.join(words)} [options]\n```"
    yield table(("Argument", "Meaning"), _rows(taken))
    yield from _text(parser.epilog or "", parser)


def _text(text: str, parser: ArgumentParser) -> Iterator[str]:
    """Yield the paragraphs of a text; one that is laid out in lines keeps them."""
    for paragraph in text.split("\n\n"):
        laid_out = parser.formatter_class is RawDescriptionHelpFormatter and "\n  " in paragraph
        if laid_out:
            yield f"```text\n{paragraph.strip()}\n```"
        elif paragraph.strip():
            words = " ".join(paragraph.split())
            yield plain(words[:1].upper() + words[1:])


def _rows(actions: Iterable[Action]) -> Iterator[tuple[str, str]]:
    """Yield what a command takes and what it means."""
    for action in actions:
        forms = [f"`{form}{_value(action)}`" for form in action.option_strings]
        meaning = (action.help or "") % {**vars(action), "prog": ""}
        yield ", ".join(forms) or f"`{_positional(action)}`", plain(meaning)


def _positional(action: Action) -> str:
    """Return an argument without a name as a usage line has it."""
    return _times(str(action.metavar or action.dest.upper()), action)


def _value(action: Action) -> str:
    """Return what follows an option, with a space before it; '' for a flag."""
    if action.nargs == 0:
        return ""
    choices = "|".join(map(str, action.choices or []))
    return " " + _times(str(action.metavar or choices or action.dest.upper()), action)


def _times(name: str, action: Action) -> str:
    """Return a name as often as it may be given."""
    forms = {ONE_OR_MORE: f"{name} [{name} ...]", ZERO_OR_MORE: f"[{name} ...]", OPTIONAL: f"[{name}]"}
    return forms.get(str(action.nargs), name)
