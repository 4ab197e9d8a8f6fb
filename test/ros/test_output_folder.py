"""What an earlier run has left is deleted when the new run has come to its bag, and not before."""

from pathlib import Path

import pytest

from sms_handover.cli.run import _earlier_run_aside
from sms_handover.errors import ConfigurationError, GraphError
from sms_handover.launcher.run_folder import BAG, LOGS, locked_logs


@pytest.fixture
def earlier(tmp_path: Path) -> Path:
    """The folder of an earlier run."""
    for part in (LOGS, BAG):
        (tmp_path / "run" / part).mkdir(parents=True)
    (tmp_path / "run" / BAG / "old.mcap").touch()
    return tmp_path / "run"


@pytest.mark.parametrize("reached", ["nothing", "logs", "bag", "end"])
def test_nothing_is_deleted_before_ros_has_started(earlier: Path, reached: str) -> None:
    try:
        with _earlier_run_aside(earlier):
            assert not earlier.exists()
            if reached != "nothing":
                (earlier / LOGS).mkdir(parents=True)
            if reached in ("bag", "end"):
                (earlier / BAG).mkdir()
            if reached != "end":
                raise GraphError("ROS cannot be started")
    except GraphError:
        assert reached != "end"
    assert (earlier / BAG / "old.mcap").exists() == (reached in ("nothing", "logs"))
    assert [path.name for path in earlier.parent.iterdir()] == ["run"]


def test_a_run_that_goes_on_is_not_replaced(earlier: Path) -> None:
    with (
        locked_logs(earlier),
        pytest.raises(ConfigurationError, match="still writes"),
        _earlier_run_aside(earlier),
    ):
        pass
    assert (earlier / BAG / "old.mcap").exists()
