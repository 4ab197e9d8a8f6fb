"""The look into a built workspace: whole, it finds nothing; without any one file it names that file."""

from pathlib import Path

import pytest

from .workspace import PACKAGE, executables, expected, missing


@pytest.fixture
def install(tmp_path: Path) -> Path:
    """An install folder with an empty file in every place."""
    for name in expected():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch(mode=0o755)
    return tmp_path


def test_a_whole_workspace_lacks_nothing(install: Path) -> None:
    assert missing(install) == []


@pytest.mark.parametrize("name", list(expected()))
def test_a_missing_file_is_named(install: Path, name: str) -> None:
    (install / name).unlink()
    assert missing(install) == [f"{name} is missing"]


def test_an_executable_must_be_executable(install: Path) -> None:
    name = f"{PACKAGE}/lib/{PACKAGE}/plant"
    (install / name).chmod(0o644)
    assert missing(install) == [f"{name} is not executable"]


def test_the_look_covers_every_node_and_what_nodes_read() -> None:
    assert {"plant", "trajectory", "ik", "controller", "recorder", "handover"} <= set(executables())
    share = f"{PACKAGE}/share/{PACKAGE}"
    assert {f"{share}/config/plant.yaml", f"{share}/launch/handover.launch.py"} <= set(expected())
