"""Progress on terminals of any width, and where there is none; nobody has to watch it."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from .terminal import Terminal

BAG = Path(__file__).parent.parent / "data" / "first_edition" / "nmpc"
COLUMNS = [40, 80, 200]
COLOUR = re.compile(r"\x1b\[[0-9;]*[39][0-9][0-9;]*m")

EAGER = """
from sms_handover.terminal import progress
progress._TERMINAL_PERIOD_S = progress._SHORT_S = 0.0
"""
# The display of a run, as the launcher uses it.
RUN = (
    EAGER
    + """
from sms_handover.launcher.display import Display
errors = {"arm_a": 0.32938, "arm_b": 0.00012}
with Display(60_000_000_000) as display:
    display.print("before")
    for second in range(61):
        display.show_run(second * 1_000_000_000, "withdraw", errors)
        if second == 20:
            display.print("grasp by arm_a")
    display.finish(30.0)
    display.show_run(60_000_000_000, "withdraw", errors, last=True)
print("over")
"""
)
PLAIN = [
    "before",
    "  0.00 of 60 s  withdraw  0.00 x real time  arm_a 329.38 mm  arm_b 0.12 mm",
    "grasp by arm_a",
    " 60.00 of 60 s  withdraw  2.00 x real time  arm_a 329.38 mm  arm_b 0.12 mm",
]
COMMAND = (
    EAGER
    + """
import sys
import sms_handover.cli.report
from sms_handover.cli.main import main
sms_handover.cli.report.report_page = lambda runs: "page"
sys.exit(main({arguments}))
"""
)


def lines_of(terminal: Terminal) -> list[str]:
    """Return what stands on the screen when a program has ended well."""
    assert terminal.end() == 0, terminal.text
    assert "\x1b[?25l" not in terminal.text  # the cursor would stay hidden if the program were killed
    lines = terminal.screen
    assert lines.pop() == ""
    return lines


@pytest.mark.parametrize("columns", COLUMNS)
def test_a_run_takes_one_line_of_any_terminal(columns: int) -> None:
    with Terminal(RUN, columns, TERM="xterm") as terminal:
        *above, line, after = lines_of(terminal)
    assert (above, after) == (["before", "grasp by arm_a"], "over")
    assert line.startswith(" 60.00 of 60 s  withdraw  ") and len(line) <= columns
    whole = line.endswith("  2.00 x real time  arm_a 329.38 mm  arm_b 0.12 mm")
    assert (whole, "━━━" in line, "…" in line) == (columns > 40, columns == 200, columns == 40)
    assert COLOUR.search(terminal.text) or columns < 200


@pytest.mark.parametrize("columns", COLUMNS)
def test_a_check_and_a_report_take_one_line_of_any_terminal(columns: int, tmp_path: Path) -> None:
    with Terminal(COMMAND.format(arguments=["bag", "check", str(BAG)]), columns, TERM="xterm") as terminal:
        shown = lines_of(terminal)
    (line,) = [line for line in shown if line.startswith("checking  ")]
    assert ", 100 %" in line and len(line) <= columns
    assert "iscomplete:" in "".join(shown).replace(" ", "")  # wrapped where the path of the bag is long
    arguments = ["report", str(BAG), "-o", "p.html"]
    program = f"import os\nos.chdir({str(tmp_path)!r})\n" + COMMAND.format(arguments=arguments)
    with Terminal(program, columns, TERM="xterm") as terminal:
        shown = lines_of(terminal)
    assert shown == ["drawing", "p.html: 0.0 MB; open it in a browser"]
    assert re.search("reading nmpc  .*1 of 1", terminal.text)


def test_without_colour_there_is_none_and_a_dumb_terminal_gets_plain_lines() -> None:
    with Terminal(RUN, 200, TERM="xterm", NO_COLOR="1") as terminal:
        assert lines_of(terminal)[2].startswith(" 60.00 of 60 s") and not COLOUR.search(terminal.text)
    with Terminal(RUN, 200, TERM="dumb") as terminal:
        assert terminal.end() == 0
    assert terminal.text.split("\r\n") == [*PLAIN, "over", ""]


def test_without_a_terminal_a_plain_line_is_printed_now_and_then() -> None:
    program = RUN + "\nimport sys\nassert not any(name.startswith('rich') for name in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stderr.splitlines() == PLAIN


def test_an_interrupt_leaves_the_terminal_as_it_was() -> None:
    forever = (
        "\nimport time\nwith progress.Progress() as line:\n    line.show('going on')\n    time.sleep(600)"
    )
    with Terminal(EAGER + forever, TERM="xterm") as terminal:
        terminal.until_text("going on")
        terminal.press(b"\x03")
        assert terminal.end() != 0
        assert terminal.screen[0].startswith("going on") and terminal.screen[1].startswith("Traceback")
        assert terminal.settings == terminal.found


@pytest.mark.parametrize("kind", ["terminal", "pipe"])
def test_work_goes_on_when_nobody_watches_any_more(kind: str, tmp_path: Path) -> None:
    closed, over = tmp_path / "closed", tmp_path / "over"
    wait = f"display.show_run(0)\n    while not Path({str(closed)!r}).exists(): pass"
    program = (
        "import signal\nfrom pathlib import Path\nsignal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
        + RUN.replace('display.print("before")', wait).replace(
            'print("over")', f"Path({str(over)!r}).touch()"
        )
    )
    if kind == "terminal":
        with Terminal(program, TERM="xterm") as terminal:
            terminal.until_text("of 60 s")
            terminal.hang_up()
            closed.touch()
            terminal.process.wait()
    else:
        with subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.PIPE) as process:
            assert process.stderr is not None and process.stderr.readline()
            process.stderr.close()
            closed.touch()
            process.wait()
    assert over.exists()
