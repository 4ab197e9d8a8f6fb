"""What is left of a recording whose recorder was killed, or whose disk was full."""

import subprocess
import sys
from pathlib import Path

import pytest

from sms_handover.bag.run.reader import read_run
from sms_handover.errors import BagError

from .conftest import Command
from .runs import DEADLINE_S, command_of

pytestmark = [pytest.mark.system, pytest.mark.slow]

ROOT = Path(__file__).resolve().parents[2]
DISK_BLOCKS = 1000  # of 512 or 1024 byte each, as the shell counts them: full within the first seconds


def test_a_killed_recorder_loses_50_ms_at_most(tmp_path: Path) -> None:
    """Against a witness that hears what the plant publishes; the benchmark's own bound decides."""
    command = ["-m", "benchmarks.recorder_kill", "--kills", "1", "--seed", "7", "--output", str(tmp_path)]
    done = subprocess.run(
        [sys.executable, *command], cwd=ROOT, capture_output=True, text=True, timeout=DEADLINE_S, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(" ms lost at ") == 1


def test_a_full_disk_ends_the_run_in_one_line_and_what_is_there_is_recovered(
    tmp_path: Path, called: Command
) -> None:
    """By a limit on the size of files, which the system reports as a full disk is reported."""
    limited = ["sh", "-c", f'ulimit -f {DISK_BLOCKS}; exec "$0" "$@"', *command_of(["run", "-o", "run"])]
    done = subprocess.run(
        limited, cwd=tmp_path, capture_output=True, text=True, timeout=DEADLINE_S, check=False
    )
    assert done.returncode == 1, done
    assert "cannot write the recording" in done.stderr and "File too large" in done.stderr
    assert "Traceback" not in done.stderr
    with pytest.raises(BagError, match="sms-handover bag recover"):
        read_run(tmp_path / "run" / "bag")
    recovered = called("bag", "recover", "run", "-o", "new", cwd=tmp_path)
    assert recovered.code in (0, 3), recovered  # 3: the disk was full in the middle of a chunk
    ticks = read_run(tmp_path / "new").tick_ns
    assert ticks.tolist() == [k * 1_000_000 for k in range(len(ticks))]
    assert len(ticks) > 100
    checked = called("bag", "check", "new", cwd=tmp_path)
    assert checked.code == 3
    assert "the run was not finished when the recording ended" in checked.out


def test_compare_and_verify_name_the_way_out_of_a_damaged_bag(
    recorded: dict[str, tuple[Path, object]], tmp_path: Path, called: Command
) -> None:
    content = (recorded["nmpc"][0] / "bag" / "bag_0.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) // 2])
    for command, code in (("compare", 2), ("verify", 2), ("bag info", 1), ("bag export -o out", 1)):
        done = called(*command.split(), "cut.mcap", cwd=tmp_path)
        assert done.code == code, done
        assert done.err.count("\n") == 1
        assert "'sms-handover bag recover cut.mcap'" in done.err
    recovered = called("bag", "recover", "cut.mcap", cwd=tmp_path)
    assert recovered.code == 3
    again = called("compare", "cut_recovered", cwd=tmp_path)
    assert again.code == 0, again
