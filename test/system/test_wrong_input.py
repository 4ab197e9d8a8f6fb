"""Wrong input ends in one line and exit code 2 before any node is started."""

from pathlib import Path

import pytest

from sms_handover.cli.folders import LOGS
from sms_handover.share import config_file

from .commands import sms_handover

pytestmark = pytest.mark.system

SHIPPED = config_file("handover.yaml")

WRONG = {
    "controller": (["--controller", "pdi"], "invalid choice: 'pdi'"),
    "missing schedule": (["--schedule", "nowhere.yaml"], "cannot read the schedule"),
    "unknown grasp frame": (["--schedule", "frame.yaml"], "did you mean 'end_b'?"),
    "target out of reach": (["--schedule", "reach.yaml"], "is out of reach"),
    "robot": (["--robot", "reach.yaml"], "unknown key 'initial'"),
    "parameter name": (["-p", "plant.integrater:=rk4"], "did you mean 'integrator'?"),
    "parameter value": (["-p", "controller.rolling_period:=-1.0"], "allowed is at least 0.001"),
    "parameter form": (["-p", "tick=1"], "NODE.NAME:=VALUE"),
    "node": (["-p", "plnt.integrator:=rk4"], "did you mean 'plant'?"),
    "unstable loop": (["-p", "common.tick:=0.002", "--controller", "pid"], "joint_7"),
    "duration": (["--duration", "-3"], "allowed is at least 0.0"),
    "domain": (["--domain-id", "400"], "allowed is 0 to 101"),
    "output that cannot be": (["-o", "/proc/nothing/here"], "cannot be made"),
    "output that exists": (["-o", "taken"], "exists"),
}


@pytest.mark.parametrize("case", WRONG)
def test_nothing_is_started(case: str, tmp_path: Path) -> None:
    """One line names the value and what is allowed; no folder appears and no node."""
    text = SHIPPED.read_text(encoding="utf-8")
    (tmp_path / "frame.yaml").write_text(text.replace("{grasp_frame: end_a}", "{grasp_frame: end_x}"))
    assert "[1.18, 0.12, 0.4]" in text
    (tmp_path / "reach.yaml").write_text(text.replace("[1.18, 0.12, 0.4]", "[2.18, 0.12, 0.4]"))
    (tmp_path / "taken").mkdir()
    before = sorted(path.name for path in tmp_path.iterdir())
    arguments, told = WRONG[case]
    done = sms_handover(tmp_path, "run", *arguments)
    assert done.returncode == 2, done.stdout + done.stderr
    errors = [line for line in done.stderr.splitlines() if "error:" in line]
    assert len(errors) == 1 and told in errors[0], done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == before
    assert not (tmp_path / "taken" / LOGS).exists()


@pytest.mark.parametrize("command", [[], ["run"], ["simulate"], ["compare"], ["reproduce"]])
def test_help_teaches(command: list[str], tmp_path: Path) -> None:
    """Every command tells what it does and exits with 0."""
    done = sms_handover(tmp_path, *command, "--help")
    assert done.returncode == 0
    assert "usage: sms-handover" in done.stdout
