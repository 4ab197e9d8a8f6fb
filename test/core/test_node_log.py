"""What a node printed is read to the end, whatever becomes of its file."""

import shutil
from pathlib import Path

import pytest

from sms_handover.errors import GraphError
from sms_handover.launcher.node_log import NodeLog


@pytest.mark.parametrize("fate", ["stays", "moved", "deleted"])
def test_a_log_is_read_where_its_folder_is_no_more(fate: str, tmp_path: Path) -> None:
    folder = tmp_path / "log"
    folder.mkdir()
    log = NodeLog(folder / "plant.log")
    log.stream.write(b"first\n")
    log.stream.flush()
    if fate == "moved":
        folder.rename(tmp_path / "elsewhere")
    elif fate == "deleted":
        shutil.rmtree(folder)
    log.stream.write(b"last \xff\n")
    log.stream.flush()
    assert log.text == "first\nlast �\n"
    assert log.last_lines.splitlines()[:2] == ["first", "last �"]
    log.close()


def test_only_the_end_is_shown(tmp_path: Path) -> None:
    log = NodeLog(tmp_path / "plant.log")
    log.stream.write(b"".join(b"%d\n" % number for number in range(100)))
    log.stream.flush()
    assert log.last_lines.splitlines()[:12] == [str(number) for number in range(88, 100)]
    log.close()


def test_a_log_that_cannot_be_is_an_error_in_words(tmp_path: Path) -> None:
    with pytest.raises(GraphError, match=r"cannot write the log .*plant\.log: No such file or directory"):
        NodeLog(tmp_path / "nowhere" / "plant.log")
