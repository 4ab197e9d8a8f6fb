"""The verbs of ``sms-handover``: which there are, how slips and old names are answered, where output goes."""

import json
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from sms_handover.analysis.latex import escaped, latex_table
from sms_handover.analysis.layout import Row, Section
from sms_handover.cli.main import main
from sms_handover.cli.verbs import FAMILIES, OLD_NAMES, VERBS, call_of
from sms_handover.errors import ConfigurationError, NoPlanError
from sms_handover.simulation.loop import Loop

from .bag_messages import made_up_run, write_run

OLD = {  # a command line of the first edition, and that of today
    "reproduce runs/nmpc": "verify runs/nmpc",
    "play BAG -r 5 --topics /a /b": "bag play BAG -r 5 --topics /a /b",
    "play --closed-loop BAG --domain-id 3": "verify --with plant BAG --domain-id 3",
    "play BAG --closed-loop": "verify --with plant BAG",
    "record --all -o mine": "bag record --all -o mine",
    "figures a b": "report --figures figures a b",
    "figures a b --output=there --only base": "report --figures there a b --only base",
    "figures a -othere --format svg b": "report --figures there a --format svg b",
}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A bag of a made-up run, under a name that LaTeX has to have escaped."""
    return str(write_run(tmp_path_factory.mktemp("runs") / "my_run", made_up_run()))


def words_of(line: str) -> tuple[str, tuple[str, ...], str]:
    """Return verb, arguments and notice of a command line."""
    call = call_of(line.split())
    return call.verb, call.arguments, call.notice


@pytest.mark.parametrize("old", OLD)
def test_an_old_name_works_and_says_what_replaces_it(old: str) -> None:
    verb, arguments, notice = words_of(old)
    assert (verb, arguments, "") == words_of(OLD[old])
    name, now = old.split(maxsplit=1)[0], " ".join(verb.split() if verb != "verify" else OLD[old].split()[:1])
    assert notice.startswith(f"'{name}' is now '{now}")
    assert notice.endswith("the old name works until the next release")


def test_every_old_name_is_tried_and_none_is_a_verb() -> None:
    assert {line.split()[0] for line in OLD} == set(OLD_NAMES)
    assert not set(OLD_NAMES) & set(VERBS)


def test_the_notice_is_one_line_on_standard_error(run: str, capsys: pytest.CaptureFixture[str]) -> None:
    codes = [main([verb, run]) for verb in ("reproduce", "verify")]
    assert codes[0] == codes[1]
    told = capsys.readouterr().err.splitlines()
    assert told[0] == "sms-handover: 'reproduce' is now 'verify'; the old name works until the next release"
    assert told[1] == told[2]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ["simulte"],
            "sms-handover: error: unknown command 'simulte' (did you mean 'simulate'?): known are ",
        ),
        (["bag", "chek"], "sms-handover: error: unknown bag command 'chek' (did you mean 'check'?): known"),
        (["campaign", "rum"], "sms-handover: error: unknown campaign command 'rum' (did you mean 'run'?)"),
        (["plan"], "sms-handover: error: 'plan' is not there yet: "),
        (
            ["verify", "x", "--domain-id", "3"],
            "sms-handover verify: error: --domain-id is for ",
        ),
        (["compare", "x", "--csv", "-", "--latex", "-"], "--csv and --latex cannot both be standard output"),
    ],
)
def test_a_slip_is_one_line(words: Sequence[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert told in err and err.count("\n") == 1 and out == ""


@pytest.mark.parametrize("words", [["--help"], ["bag", "--help"], ["campaign", "--help"]])
def test_help_lists_every_verb_within_a_terminal(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 0
    lines = capsys.readouterr().out.splitlines()
    listed = [found[1] for line in lines if (found := re.match(r"  (\w+) +\S", line))]
    assert listed == list(FAMILIES[words[0]][1] if words[0] in FAMILIES else VERBS)
    assert all(len(line) <= 100 for line in lines) and len(lines) <= 40


def test_what_follows_a_verb_is_left_to_it() -> None:
    assert call_of(["run", "--help", "-p", "a.b:=1"]).arguments == ("--help", "-p", "a.b:=1")
    assert call_of(["bag", "info", "--json", "x"]).arguments == ("--json", "x")
    with pytest.raises(ConfigurationError, match="known are 'info'"):
        call_of(["bag", "run"])


def test_a_dash_is_standard_output_instead_of_the_table(
    run: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["compare", run, "--json", "-", "--csv", str(tmp_path / "a.csv")]) == 0
    assert list(json.loads(capsys.readouterr().out)["runs"]) == ["my_run"]
    assert main(["compare", run, "--csv", "-"]) == 0
    assert capsys.readouterr().out == (tmp_path / "a.csv").read_text(encoding="utf-8")


def test_the_table_for_latex_is_whole(run: str, capsys: pytest.CaptureFixture[str]) -> None:
    """What LaTeX would stop at: an odd number of cells, a brace or an environment left open, a bare sign."""
    assert main(["compare", run, "--latex", "-"]) == 0
    text = capsys.readouterr().out
    assert "{booktabs, longtable}" in text.splitlines()[0]
    assert text.count("\\begin{longtable}{lr}") == text.count("\\end{longtable}") == 1
    assert " & my\\_run \\\\" in text
    rules = [line for line in text.splitlines() if re.fullmatch(r"\\\w+", line)]
    assert rules[:5] == ["\\toprule", "\\midrule", "\\endhead", "\\bottomrule", "\\endfoot"]
    rows = [line for line in text.splitlines() if line.endswith(" \\\\")]
    assert len(rows) > 50
    for row in rows:
        bare = re.sub(r"\\[&%$#_{}]", "", row.removesuffix("\\\\"))
        assert bare.count("{") == bare.count("}") and bare.count("$") % 2 == 0
        assert bare.count("&") == (0 if bare.startswith("\\multicolumn{2}") else 1)
        outside = re.sub(r"\$[^$]*\$", "", bare)
        assert not re.search(r"[_^%#~|<>]", outside), row
        assert not row.startswith(("[", "*")), row


def test_a_cell_of_the_table_for_latex_is_the_number() -> None:
    rows = (Row("[a] b_c", ("1.2e-05", "-3"), frozenset({0})), Row("  x^2 [%]", ("never", "-")), Row("head"))
    lines = latex_table(["a&b", "c"], [Section("T|t", rows)]).splitlines()
    assert lines[-5:] == [
        "\\multicolumn{3}{l}{\\emph{T\\textbar{}t}} \\\\",
        "{}[a] b\\_c & $\\mathbf{1.2 \\times 10^{-5}}$ & $-3$ \\\\",
        "\\quad x\\textsuperscript{2} [\\%] & never & - \\\\",
        "head &  &  \\\\",
        "\\end{longtable}",
    ]
    assert escaped("\\a\n{}~") == "\\textbackslash{}a \\{\\}\\textasciitilde{}"


WITHOUT_ROS = """
import sys
sys.modules["rclpy"] = None
from sms_handover.cli.main import main
for line in sys.stdin.read().splitlines():
    try:
        code = main(line.split())
    except SystemExit as ended:
        code = ended.code
    print("code of", line, "is", code)
"""
NEED_ROS = ("run", "bag play BAG", "bag record --all", "view --live", "verify --with plant BAG")


def test_ros_is_imported_by_the_verbs_alone_that_need_it(run: str, tmp_path: Path) -> None:
    names = [verb for verb in VERBS if verb not in FAMILIES]
    names += [f"{verb} {name}" for verb, (_, commands) in FAMILIES.items() for name in commands]
    need_none = [f"{name} --help" for name in names if not any(line.startswith(name) for line in NEED_ROS)]
    need_none += ["view --help", "verify --help", "list", "show pid", f"verify {run}", f"bag info {run}"]
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_ROS],
        input="\n".join([*need_none, *NEED_ROS]),
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    codes = dict(re.findall(r"^code of (.*) is (\d+)$", done.stdout, re.MULTILINE))
    assert [line for line in need_none if codes[line] != "0"] == [f"verify {run}"]
    assert done.stderr.count("\n") == len(NEED_ROS) + 1, "one line of each, as of the run that is made up"
    assert done.stderr.count(": error: this needs ROS, which cannot be imported: ") == len(NEED_ROS)
    assert all(codes[line] == "2" for line in NEED_ROS)


@pytest.mark.parametrize(("last_ns", "kept"), [(20_000_000, 20), (0, 0)])
def test_a_run_that_ends_without_a_plan_is_kept_as_far_as_it_came(
    last_ns: int,
    kept: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    advance, out = Loop._advance, tmp_path / "run.npz"

    def gives_up(loop: Loop, most: int) -> object:
        if loop.state.stamp_ns == last_ns:
            raise NoPlanError("no plan, at rest at 0.02 s: rate arm_a_joint_3 is 1e-3 too large")
        return advance(loop, most)

    monkeypatch.setattr(Loop, "_advance", gives_up)
    assert main(["simulate", "smooth", "-p", "common.duration:=0.04", "-o", str(out)]) == 1
    told, errors = capsys.readouterr()
    assert errors.count("no plan, at rest at 0.02 s") == 1 and "Traceback" not in errors
    assert ("control effort" in told) is out.exists() is bool(kept)
    if kept:
        with np.load(out, allow_pickle=False) as arrays:
            assert len(arrays["tick_ns"]) == kept
