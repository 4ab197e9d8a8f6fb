"""Provenance names versions and revision, and never a path of the machine."""

import subprocess
from datetime import datetime, timezone
from pathlib import Path

import pytest

from sms_handover.bag.provenance import package_version, provenance, source_revision


def git(root: Path, *arguments: str) -> None:
    identity = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
    subprocess.run(["git", "-C", str(root), *identity, *arguments], check=True, capture_output=True)


def test_versions_seed_and_start_are_texts() -> None:
    values = provenance(seed=7, start=datetime(2026, 1, 2, 3, 4, 5, 678000, tzinfo=timezone.utc))
    assert values["start"] == "2026-01-02T03:04:05.678+00:00"
    assert values["seed"] == "7"
    assert provenance()["seed"] == "none"
    assert values["version.numpy"][0].isdigit()
    assert all(isinstance(value, str) and value for value in values.values())
    assert not any(value.startswith(("/", "~")) or str(Path.home()) in value for value in values.values())


def test_an_absent_package_is_unknown() -> None:
    assert package_version("a-package-that-does-not-exist") == "unknown"


def test_revision_and_state_of_a_source_tree(tmp_path: Path) -> None:
    assert source_revision(tmp_path) == ("unknown", "unknown")
    git(tmp_path, "init", "-q")
    assert source_revision(tmp_path) == ("unknown", "unknown")  # no commit yet
    (tmp_path / "file").write_text("one")
    git(tmp_path, "add", "file")
    git(tmp_path, "commit", "-q", "-m", "one")
    revision, state = source_revision(tmp_path)
    assert (len(revision), state) == (40, "clean")
    (tmp_path / "file").write_text("two")
    assert source_revision(tmp_path) == (revision, "modified")


def test_without_git_the_revision_is_unknown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    git(tmp_path, "init", "-q")
    monkeypatch.setenv("PATH", "")
    assert source_revision(tmp_path) == ("unknown", "unknown")
