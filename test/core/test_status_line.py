import pytest

from sms_handover.terminal.status_line import StatusLine


@pytest.fixture(params=[True, False])
def line(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> StatusLine:
    monkeypatch.setattr("sys.stderr.isatty", lambda: request.param)
    monkeypatch.setattr("sms_handover.terminal.status_line.monotonic", lambda: time[0])
    time[0] = 100.0
    return StatusLine()


time = [100.0]


def shown(line: StatusLine, capsys: pytest.CaptureFixture[str]) -> str:
    line.show("a long line")
    line.show("short")
    line.stay()
    line.show("next")
    line.stay()
    line.stay()
    return capsys.readouterr().err


@pytest.mark.parametrize("line", [True], indirect=True)
def test_on_a_terminal_the_line_is_written_over(line: StatusLine, capsys: pytest.CaptureFixture[str]) -> None:
    assert shown(line, capsys) == "\ra long line\rshort      \n\rnext\n"


@pytest.mark.parametrize("line", [False], indirect=True)
def test_elsewhere_every_line_stays(line: StatusLine, capsys: pytest.CaptureFixture[str]) -> None:
    assert shown(line, capsys) == "a long line\nshort\nnext\n"


def test_it_is_due_at_first_and_after_a_while(line: StatusLine) -> None:
    assert line.due
    line.show("x")
    assert not line.due
    time[0] += 60.0
    assert line.due
