"""``sms-handover bag`` as a user types it: what it prints, and with what code it ends."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from sms_handover.cli.main import main
from sms_handover.graph.topics import LOOP_NODES

from .bag_damage import chunks_of, write_file
from .test_bag_check import write_finished

# three topics each tick, twelve each reference period, and what comes once in a run
ONCE = ("description", "state", "grasp", "transfer", "decision", "another decision", *LOOP_NODES)
MESSAGES = 3 * 201 + 12 * 11 + len(ONCE)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """A finished run."""
    return write_finished(tmp_path / "bag")


@pytest.fixture
def broken(tmp_path: Path) -> Path:
    """A file of another writer with a chunk that is not as it was written."""
    file = tmp_path / "a.mcap"
    content = bytearray(write_file(file))
    content[chunks_of(file)[3].end - 9] ^= 1
    file.write_bytes(content)
    return file


@pytest.fixture
def empty(tmp_path: Path) -> Path:
    """A file of no bytes."""
    (tmp_path / "empty.mcap").touch()
    return tmp_path / "empty.mcap"


def test_info_prints_what_is_there(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bag", "info", str(bag)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert f"Messages:          {MESSAGES}" in lines
    assert any(line.split()[:3] == ["/joint_states", "sensor_msgs/msg/JointState", "201"] for line in lines)
    assert "Loss ledger, complete:" in lines
    assert main(["bag", "info", "--json", str(bag)]) == 0
    values = json.loads(capsys.readouterr().out)
    assert (values["message_count"], values["end_ns"], values["complete"]) == (MESSAGES, 200_000_000, True)
    assert {topic["name"]: topic["received"] for topic in values["ledger"]}["/joint_states"] == 201


def test_times_of_the_wall_clock_keep_every_nanosecond(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "a.mcap"
    write_file(file, count=2, start_ns=1_700_000_001_990_000_001)
    assert main(["bag", "info", str(file)]) == 0
    out = capsys.readouterr().out
    assert "1700000001.990000001 s" in out and "1700000001.990000016 s" in out
    assert "Loss ledger: none" in out


def test_check_tells_by_its_code(
    bag: Path, broken: Path, empty: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bag", "check", str(bag)]) == 0
    assert f"{bag} is complete: {MESSAGES} messages" in capsys.readouterr().out
    assert main(["bag", "check", str(broken)]) == 3
    out = capsys.readouterr().out
    assert "DAMAGED  a.mcap: bytes" in out and "is NOT complete" in out
    assert f"'sms-handover bag recover {broken}' makes a new bag" in out
    assert main(["bag", "check", str(empty)]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    assert main(["bag", "check", "--json", str(broken)]) == 3
    values = json.loads(capsys.readouterr().out)
    assert values["complete"] is False
    assert {finding["severity"] for finding in values["findings"]} == {"damaged", "missing", "note"}


def test_recover_tells_by_its_code(
    bag: Path, broken: Path, empty: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bag", "recover", str(bag)]) == 0
    assert (tmp_path / "bag_recovered" / "metadata.yaml").is_file()
    assert "; 0 of" in capsys.readouterr().out
    assert main(["bag", "recover", str(bag)]) == 1  # the folder is there now
    assert "exists already" in capsys.readouterr().err
    assert main(["bag", "recover", str(broken), "-o", str(tmp_path / "new")]) == 3
    out = capsys.readouterr().out
    assert "lost: a.mcap: bytes" in out and "largest loss: " in out
    assert main(["bag", "recover", str(empty), "-o", str(tmp_path / "none")]) == 1
    assert "nothing can be recovered" in capsys.readouterr().err
    assert main(["bag", "recover", "--json", str(broken), "-o", str(tmp_path / "json")]) == 3
    values = json.loads(capsys.readouterr().out)
    assert values["bytes_lost"] > 0 and values["clean"] is False
    assert sum(values["messages"].values()) + sum(values["messages_lost"].values()) == 120


def test_export_tells_by_its_code(
    bag: Path, broken: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "out")
    assert main(["bag", "export", str(bag), "-o", out]) == 0
    assert "ticks: 201 rows" in capsys.readouterr().out
    assert main(["bag", "export", str(bag), "-o", out]) == 2
    assert main(["bag", "export", str(broken), "-o", str(tmp_path / "b")]) == 1
    assert "sms-handover bag recover" in capsys.readouterr().err
    options = ["--topics", "joint_states", "--end", "0.05", "--format", "parquet"]
    assert main(["bag", "export", str(bag), "-o", str(tmp_path / "c"), *options]) == 0
    assert "joint_states: 51 rows" in capsys.readouterr().out


def test_a_reader_that_has_seen_enough_gets_no_traceback(bag: Path) -> None:
    program = (
        f"import sys; from sms_handover.cli.main import main; sys.exit(main(['bag', 'info', {str(bag)!r}]))"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()
    assert process.stderr.read() == ""
    assert process.wait() == 1
