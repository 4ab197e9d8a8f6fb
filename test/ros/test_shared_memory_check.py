"""Shared memory is left alone where it is full, as writing to it would kill the process."""

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from sms_handover.errors import GraphError
from sms_handover.ros.process.shared_memory_check import avoid_full_shared_memory, require_shared_memory

VARIABLE = "FASTDDS_BUILTIN_TRANSPORTS"


@pytest.fixture(autouse=True)
def no_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Begin without the variable, and take away what the test sets."""
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.delenv(VARIABLE)


def give_room(size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every file system have so many bytes left."""
    monkeypatch.setattr(os, "statvfs", lambda path: SimpleNamespace(f_bavail=size // 4096, f_frsize=4096))


def test_with_room_nothing_is_changed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    give_room(64 * 2**20, monkeypatch)
    assert avoid_full_shared_memory(tmp_path) == ""
    assert VARIABLE not in os.environ


def test_without_room_messages_go_by_udp_and_it_is_said(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    give_room(2**20, monkeypatch)
    assert "1.0 MiB left" in avoid_full_shared_memory(tmp_path)
    assert os.environ[VARIABLE] == "UDPv4"


def test_what_the_user_has_chosen_stays(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    give_room(2**20, monkeypatch)
    monkeypatch.setenv(VARIABLE, "SHM")
    assert avoid_full_shared_memory(tmp_path) == ""
    assert os.environ[VARIABLE] == "SHM"


def test_no_room_at_all_is_an_error_in_words(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    give_room(4096, monkeypatch)
    with pytest.raises(GraphError, match="is full, so ROS cannot be started"):
        require_shared_memory(tmp_path)
    give_room(2**20, monkeypatch)
    require_shared_memory(tmp_path)


def test_no_shared_memory_at_all_is_left_to_fast_dds(tmp_path: Path) -> None:
    require_shared_memory(tmp_path / "nowhere")
    assert avoid_full_shared_memory(tmp_path / "nowhere") == ""
    assert VARIABLE not in os.environ
