"""Every command and every Python block in the documents is right: programs, options, names, syntax."""

import ast
import re
import subprocess
from argparse import ArgumentParser
from collections.abc import Iterable
from dataclasses import fields
from importlib import import_module
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import pytest
from my_controller.task_space_pd import TaskSpaceGains

from sms_handover.cli.verbs import FAMILIES, VERBS, call_of
from sms_handover.configuration.scenario_file import COMMON, SHORT
from sms_handover.configuration.values import DOCUMENTS as DOCUMENTS_WITH_VALUES
from sms_handover.configuration.values import ROLES
from sms_handover.control.parameters import parameters_with
from sms_handover.control.registry import law_named
from sms_handover.errors import ConfigurationError
from sms_handover.graph.services import SERVICES
from sms_handover.graph.topics import CONTROLLER, SENSOR_TYPES, graph_topics
from sms_handover.ros.launching.launch_arguments import ARGUMENTS
from sms_handover.ros.reference.interfaces import COMMON_GROUP, OWN_GROUPS, groups_of
from sms_handover.simulation.parameters import CommonParameters
from sms_handover.simulation.scenario import load_scenario

from .core.laws import offer
from .documents import DOCUMENTS, SHELL, Block, anchors, blocks, commands, inline_code, links
from .workspace import PACKAGE, ROOT, executables

ELSEWHERE = {
    "apt",
    "cd",
    "colcon",
    "export",
    "git",
    "head",
    "mkdir",
    "pip",
    "pre-commit",
    "rosdep",
    "ruff",
    "source",
}
BLOCKS = [block for path in DOCUMENTS for block in blocks(path)]
OF_SHELL = [block for block in BLOCKS if block.language in SHELL]
OF_PYTHON = [block for block in BLOCKS if block.language == "python"]
ARMS = ("arm_a", "arm_b")


class Refused(Exception):
    """A command in a document is wrong."""


class StrictParser(ArgumentParser):
    """A parser that raises instead of ending the process."""

    def error(self, message: str) -> None:  # type: ignore[override]
        raise Refused(message)

    def exit(self, status: int = 0, message: str | None = None) -> None:  # type: ignore[override]
        """Let ``--help`` be."""


def called(words: list[str]) -> tuple[StrictParser, tuple[str, ...]]:
    """Return the parser of the verb that a command line names, and what it has to parse."""
    try:
        call = call_of(words)
    except ConfigurationError as error:
        raise Refused(str(error)) from error
    parser = StrictParser(prog=call.verb)
    import_module(call.module).add_parser(parser)
    return parser, call.arguments


def check(words: list[str]) -> None:
    """Raise Refused if a command names something that does not exist."""
    program, rest = Path(words[0]).name, words[1:]
    if program == "sms-handover":
        check_ours(rest)
    elif program == "make":
        targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
        require([word for word in rest if "=" not in word], targets, "target of make")
    elif program.startswith("python"):
        check_python(rest)
    elif program == "ros2":
        check_ros2(rest)
    elif program not in ELSEWHERE:
        raise Refused(f"{program!r} is no command of ours, nor one of ELSEWHERE in this file")


def check_ours(words: list[str]) -> None:
    """Check a call of ``sms-handover``."""
    if not words or words[0] in ("--help", "--version"):
        return
    parser, arguments = called(words)
    options = parser.parse_args(arguments)
    for text in getattr(options, "param", []):
        path = text.partition(":=")[0]
        node, _, name = (SHORT[path], "", path) if path in SHORT else path.partition(".")
        if node in (*DOCUMENTS_WITH_VALUES, *ROLES):
            load_scenario(values={COMMON: {"values": [text]}})
            continue
        groups = {"common": COMMON_GROUP, **OWN_GROUPS}
        require([node], groups, "node")
        cls = groups[node].cls
        if node == CONTROLLER and getattr(options, "own_controller", None):
            cls = TaskSpaceGains  # the pages start our example
        elif node == CONTROLLER and options.controller:
            cls = parameters_with(law_named(options.controller), CommonParameters)
        require([name], [item.name for item in fields(cls)], f"parameter of {node}")


def check_python(words: list[str]) -> None:
    """Check a call of Python: a module, or a script."""
    if words[0] == "-m" and words[1] not in ("venv", "pip"):
        if find_spec(words[1]) is None:
            raise Refused(f"there is no module {words[1]!r}")
        if words[1].startswith(f"{PACKAGE}.nodes."):
            check_parameters(words[1].rpartition(".")[2], words)
    elif words[0].endswith(".py") and not (ROOT / words[0]).is_file():
        raise Refused(f"there is no script {words[0]!r}")


def check_ros2(words: list[str]) -> None:
    """Check a call of ``ros2``: executables, launch files, launch arguments, topics and services of ours."""
    if words[:2] == ["run", PACKAGE]:
        require(words[2:3], executables(), "executable")
        if words[2] in OWN_GROUPS:
            check_parameters(words[2], words)
    elif words[:2] == ["launch", PACKAGE]:
        require(words[2:3], [path.name for path in (ROOT / "launch").iterdir()], "launch file")
        source = (ROOT / "launch" / words[2]).read_text(encoding="utf-8")
        known = [*ARGUMENTS, *re.findall(r'DeclareLaunchArgument\(\s*"(\w+)"', source)]
        require([word.partition(":=")[0] for word in words[3:] if ":=" in word], known, "launch argument")
    elif words[0] == "topic":
        known = [
            "/" + topic.name.lstrip("/") for topic in graph_topics(ARMS, clearance=True, sensors=SENSOR_TYPES)
        ]
        require([word for word in words[2:] if word.startswith("/")], known, "topic")
    elif words[:2] == ["service", "call"]:
        require(
            words[2:4], [n for s in SERVICES for n in (f"/{s.relative_name}", s.type)], "service or its type"
        )
    else:
        require(words[:1], ["interface", "node", "param", "pkg", "service"], "command of ros2")


def check_parameters(node: str, words: list[str]) -> None:
    """Check the names behind ``-p`` of a node."""
    known = [item.name for group in groups_of(node) for item in fields(group.cls)]
    given = [word.partition(":=")[0] for flag, word in pairwise(words) if flag == "-p"]
    require(given, known, f"parameter of {node}")


def require(names: Iterable[str], known: Iterable[str], what: str) -> None:
    """Raise Refused at the first name that is not known."""
    for name in names:
        if name not in list(known):
            raise Refused(f"{name!r} is no {what}")


@pytest.fixture(autouse=True)
def laws_of_the_examples(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """The pages install them."""
    site = tmp_path_factory.mktemp("site")
    monkeypatch.syspath_prepend(offer(site, "my_law", joint_pd="my_law:LAW"))
    offer(site, "balancer", balancer="balancer.law:LAW")


def place(block: Block) -> str:
    return block.place


@pytest.mark.parametrize("block", OF_SHELL, ids=place)
def test_commands_are_right(block: Block) -> None:
    subprocess.run(["bash", "-n"], input=block.text, text=True, check=True)
    for words in commands(block.text):
        try:
            check(words)
        except Refused as refusal:
            pytest.fail(f"{block.place}: {' '.join(words)}: {refusal}")


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_commands_in_the_text_exist(path: Path) -> None:
    """In a sentence arguments may be left out; command, options and targets must exist."""
    for code in inline_code(path):
        words = code.split()
        if words[:1] == ["make"]:
            check(words)
        elif words[:1] == ["sms-handover"] and len(words) > 1 and words[1].islower():
            if words[1] in FAMILIES and len(words) == 2:
                continue
            parser, arguments = called(words[1:])
            options = [word for word in arguments if word.startswith("--")]
            require(options, parser._option_string_actions, f"option of {words[1]}")


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(path: Path) -> None:
    """On GitHub; `make docs` follows those of the site."""
    for link in links(path):
        name, _, anchor = link.partition("#")
        file = (path.parent / name).resolve() if name else path
        assert file.exists(), f"{path.name} links to {link}, which is not there"
        if anchor and file.suffix == ".md":
            assert anchor in anchors(file), f"{path.name} links to {link}; {file.name} has no such heading"


def test_every_page_is_in_the_navigation() -> None:
    """The list stands at the end of docs/index.md; `make docs` does not know where a new page belongs."""
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    listed = [
        name for toc in re.findall(r"^```\{toctree\}\n(.*?)^```$", index, re.M | re.S) for name in toc.split()
    ]
    pages = {path.stem for pattern in ("*.md", "*.rst") for path in (ROOT / "docs").glob(pattern)} - {"index"}
    assert pages <= set(listed), f"add to docs/index.md: {sorted(pages - set(listed))}"


@pytest.mark.parametrize(
    "verb",
    [
        *(verb for verb in VERBS if verb not in FAMILIES),
        *(f"{verb} {name}" for verb, (_, commands) in FAMILIES.items() for name in commands),
    ],
)
def test_examples_of_the_help_are_right(verb: str) -> None:
    parser, _ = called(verb.split())
    for line in re.findall(r"^  (sms-handover .*)$", parser.epilog or "", re.MULTILINE):
        command = re.split(r"\s{2,}", line)[0]  # what it does stands behind
        check(next(commands(command)))


@pytest.mark.parametrize("block", OF_PYTHON, ids=place)
def test_python_imports_what_exists(block: Block) -> None:
    for node in ast.walk(ast.parse(block.text)):
        if isinstance(node, ast.ImportFrom) and node.module:
            module = import_module(node.module)
            for alias in node.names:
                assert hasattr(module, alias.name) or find_spec(f"{node.module}.{alias.name}"), alias.name
        elif isinstance(node, ast.Import):
            assert all(find_spec(alias.name) for alias in node.names)


@pytest.mark.parametrize("block", [block for block in OF_PYTHON if "runs/" not in block.text], ids=place)
def test_python_that_needs_no_recording_runs(
    block: Block, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What a tutorial prints stands on its page."""
    monkeypatch.chdir(tmp_path)
    exec(compile(block.text, block.place, "exec"), {})
    if block.place.startswith("tutorial"):
        assert capsys.readouterr().out in (ROOT / "docs" / block.place.partition(":")[0]).read_text("utf-8")


def test_there_is_something_to_check() -> None:
    assert len(OF_SHELL) >= 3 and OF_PYTHON
    assert [block.place for block in BLOCKS if not block.language] == []


WRONG = [
    "sms-handover rum",
    "sms-handover run --contoller pid",
    "sms-handover run --controller pdi",
    "sms-handover run -p controler.law:=pid",
    "sms-handover run -p controller.lw:=pid",
    "sms-handover compare",
    "FOO=1 time .venv/bin/sms-handover simulate --nothing > out.txt",
    "make handovr",
    "cd there && python -m sms_handover.nodes.plnt",
    "python -m sms_handover.nodes.plant --ros-args -p law:=pid",
    "python no_such.py",
    "ros2 run sms_handover plnt",
    "ros2 run sms_handover plant --ros-args -p law:=pid",
    "ros2 launch sms_handover handover.launch.xml",
    "ros2 launch sms_handover handover.launch.py controler:=pid",
    "ros2 topic echo /joint_state",
    "ros2 service call /plant/stop std_srvs/srv/Trigger",
    "ros2 bagg",
    "sms_handover run",
]


@pytest.mark.parametrize("script", WRONG)
def test_a_wrong_command_is_noticed(script: str) -> None:
    with pytest.raises(Refused):
        for words in commands(script):
            check(words)


def test_a_script_is_taken_apart() -> None:
    script = "A=1 time make x  # not this\ncd a && b -c 'd # e' | f \\\n  --g > h\n"
    assert list(commands(script)) == [["make", "x"], ["cd", "a"], ["b", "-c", "d # e"], ["f", "--g"]]
