"""``sms-handover report --figures`` as a user meets it: files, notes, help and wrong input."""

import subprocess
import sys
from pathlib import Path

import pytest

from sms_handover.analysis.figure_catalogue import FIGURES
from sms_handover.cli.main import main

from .bag_messages import made_up_run, write_run

ROOT = Path(__file__).resolve().parent.parent.parent


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """Two bags without a robot description, as other tools may have cut them."""
    folder = tmp_path_factory.mktemp("runs")
    return str(write_run(folder / "nmpc", made_up_run())), str(
        write_run(folder / "mine", made_up_run(seed=1))
    )


def test_the_files_are_named_as_they_are_written(
    bags: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "a" / "b"
    arguments = [
        "report",
        *bags,
        "--figures",
        str(out),
        "--format",
        "svg,png",
        "--only",
        "torque",
        "--dpi",
        "50",
    ]
    assert main([*arguments, "--only", "momentum"]) == 0
    expected = [f"{name}.{suffix}" for name in _TORQUE_AND_MOMENTUM for suffix in ("svg", "png")]
    printed, notes = capsys.readouterr()
    assert printed.splitlines() == [str(out / name) for name in expected]
    assert sorted(path.name for path in out.iterdir()) == sorted(expected)
    assert set(notes.splitlines()) <= _PROGRESS
    assert not Path("report").exists()
    assert main(arguments) == 0, "figures are drawn again over those that are there"


_PROGRESS = {"reading nmpc  1 of 2", "reading mine  2 of 2", "reading nmpc  1 of 1", "drawing"}
_TORQUE_AND_MOMENTUM = ("torque_arm_a", "torque_arm_b", "momentum")


def test_help_lists_every_figure(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["report", "--help"])
    printed = capsys.readouterr().out
    assert all(f"  {kind.name} " in printed and kind.text in printed for kind in FIGURES)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--only", "torq"], "unknown figure 'torq' (did you mean 'torque'?): known are 'tool_error', "),
        (["--format", "png,jpeg"], "unknown figure format 'jpeg'"),
        (["--format", ""], "unknown figure format ''"),
        (["--dpi", "10"], "--dpi is 10 dots per inch, must be 50 to 1200"),
    ],
)
def test_wrong_input_ends_in_one_line_before_anything_is_read(
    options: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", str(tmp_path / "nowhere"), "--figures", str(tmp_path / "out"), *options]) == 2
    errors = capsys.readouterr().err
    assert message in errors and len(errors.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_options_of_figures_need_a_folder_for_them(
    bags: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", *bags, "-o", str(tmp_path / "page"), "--only", "torque"]) == 2
    assert "give --figures with them" in capsys.readouterr().err
    assert not (tmp_path / "page").exists()


def test_page_and_figures_are_written_together(bags: tuple[str, str], tmp_path: Path) -> None:
    words = ["report", *bags, "-o", str(tmp_path / "page.html"), "--figures", str(tmp_path / "out")]
    assert main([*words, "--only", "momentum", "--format", "svg"]) == 0
    assert (tmp_path / "page.html").is_file()
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["momentum.svg"]


def test_an_output_that_is_a_file_is_told(
    bags: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out").write_text("")
    assert main(["report", bags[0], "--figures", str(tmp_path / "out"), "--only", "momentum"]) == 2
    assert "out cannot be made: File exists" in capsys.readouterr().err


def test_a_bag_that_does_not_describe_the_robot_has_no_snapshots(
    bags: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", *bags, "--figures", str(tmp_path), "--only", "snapshots"]) == 2
    notes = [line for line in capsys.readouterr().err.splitlines() if line not in _PROGRESS]
    assert notes == [
        "no snapshots of nmpc: its bag carries no robot description",
        "no snapshots of mine: its bag carries no robot description",
        "sms-handover report: error: there is nothing to draw of snapshots in these runs",
    ]


@pytest.mark.parametrize(("option", "code"), [("--help", 0), ("--only=momentum", 1)])
def test_without_matplotlib_there_is_help_and_one_line_of_error(
    bags: tuple[str, str], tmp_path: Path, option: str, code: int
) -> None:
    script = (
        "import sys\nsys.modules['matplotlib'] = None\n"
        "from sms_handover.cli.main import main\nsys.exit(main(sys.argv[1:]))"
    )
    words = [sys.executable, "-c", script, "report", bags[0], "--figures", str(tmp_path / "out"), option]
    ended = subprocess.run(words, capture_output=True, text=True, check=False, cwd=ROOT)
    assert ended.returncode == code
    expected = "sms-handover report: error: figures need matplotlib, which is not installed: "
    told = [line for line in ended.stderr.splitlines() if line not in _PROGRESS]
    assert told == ([f"{expected}pip install 'sms_handover[analysis]'"] if code else [])
    assert not (tmp_path / "out").exists()
