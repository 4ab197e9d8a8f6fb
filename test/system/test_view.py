"""The command that shows runs, as a user gives it."""

from pathlib import Path

import pytest

from .conftest import LAWS, Command
from .runs import Ended, sms_handover

pytestmark = [pytest.mark.system, pytest.mark.slow]

Recorded = dict[str, tuple[Path, Ended]]


def test_runs_become_one_page(recorded: Recorded, tmp_path: Path) -> None:
    folders = [recorded[law][0] for law in LAWS]
    ended = sms_handover("view", *folders, "-o", "page.html", "--no-browser", cwd=tmp_path)
    assert ended.code == 0, ended
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<title>Handover: nmpc, pid</title>" in page
    assert ended.out.startswith("page.html: ") and ended.out.rstrip().endswith(" MB")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "nothing to show: give the output folder of a run, or --live"),
        (["nowhere"], "there is no bag at nowhere"),
        (["nowhere", "--live"], "give no RUN and no --output with it"),
        (["nowhere", "--port", "8080"], "--port and --domain-id are for a running graph: give --live"),
        (["--live", "--port", "70000"], "'port' is 70000"),
        (["--live", "--domain-id", "500"], "domain id is 500, must be 0 to"),
    ],
)
def test_what_cannot_be_shown_is_named(
    arguments: list[str], message: str, tmp_path: Path, called: Command
) -> None:
    ended = called("view", *arguments, "--no-browser", cwd=tmp_path)
    assert ended.code == 2
    (error,) = ended.errors
    assert message in error


def test_a_rate_of_zero_is_not_taken_for_the_default(
    recorded: Recorded, tmp_path: Path, called: Command
) -> None:
    ended = called("view", recorded[LAWS[0]][0], "--frame-rate", 0, "--no-browser", cwd=tmp_path)
    assert ended.code == 2
    assert "frame rate is 0 1/s, it must be > 0" in ended.err


def test_a_page_that_cannot_be_written_is_named(recorded: Recorded, tmp_path: Path, called: Command) -> None:
    folder = recorded[LAWS[0]][0]
    ended = called("view", folder, "-o", "no/where.html", "--no-browser", cwd=tmp_path)
    assert ended.code == 2
    assert "where.html cannot be written: No such file or directory" in ended.err
