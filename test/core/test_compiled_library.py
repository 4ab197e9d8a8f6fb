"""Compiled library: made once for all robots of a kind, held against Pinocchio, and what can be missing."""

import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sms_handover.compiled import library
from sms_handover.compiled.compiler import library_of
from sms_handover.compiled.dynamics import CompiledComputedTorque, CompiledStepper
from sms_handover.errors import ConfigurationError, MissingDependencyError
from sms_handover.model.description import load_robot
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.integrators import TABLEAUS
from sms_handover.simulation.scenario import load_scenario

from .robots import someone_else

_TICK = 1e-3  # [s]

pytestmark = pytest.mark.usefixtures("kept_libraries")


def test_another_robot_of_a_kind_compiles_nothing(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Its inertial parameters are arguments; at one time only one process compiles."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    code = (
        "import logging; logging.basicConfig()\n"
        "from sms_handover.compiled.library import dynamics_library\n"
        "from sms_handover.simulation.scenario import load_scenario\n"
        "dynamics_library(load_scenario('planar').truth.robot)"
    )
    call = [sys.executable, "-c", code]
    four = [subprocess.Popen(call, stderr=subprocess.PIPE, text=True) for _ in range(4)]
    told = [process.communicate()[1].count("compiling the dynamics") for process in four]
    assert [process.returncode for process in four] == [0] * 4 and sum(told) == 1
    for index in range(10):
        mass = 200.0 + index
        scenario = load_scenario(
            "planar", {"robot.base.mass": mass, "robot.arms.arm_a.gripper.mass": 0.5 + index}
        )
        CompiledStepper(scenario.truth.robot, TABLEAUS["rk4"], _TICK)
    assert not caplog.records


def test_robots_that_differ_in_their_mounts_and_masses_share_a_library(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As cases of a campaign do: each with errors of its model of its own, compiled once."""
    asked = set[bytes]()

    def remember(name: str, identity: bytes, write: Callable[[], str]) -> Path:
        asked.add(identity)
        return Path(name)

    monkeypatch.setattr(library, "library_of", remember)
    for seed in range(3):
        values = {"common.conditions": "nominal", "seed": seed, "truth.robot.base.mass": 240.0 + seed}
        library.dynamics_library(load_scenario("smooth", values).truth.robot)
    assert len(asked) == 1
    library.dynamics_library(load_scenario("smooth").truth.robot)
    assert len(asked) == 2


def test_a_library_is_made_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """That takes long enough to be told. Another run finds it and makes none."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    robot = load_scenario("planar").truth.robot
    CompiledComputedTorque(robot)
    assert [record.message.split(":")[0] for record in caplog.records] == [
        "compiling the dynamics of robots of this kind"
    ]
    (made_library,) = (tmp_path / "sms_handover").iterdir()
    made = made_library.stat()
    assert stat.S_IMODE(made_library.parent.stat().st_mode) == 0o700

    def refuse() -> None:
        raise AssertionError("asked for again")

    monkeypatch.setattr(library, "_writer", refuse)
    CompiledComputedTorque(robot)
    assert len(caplog.records) == 1
    assert (made_library.stat().st_ino, made_library.stat().st_mtime_ns) == (made.st_ino, made.st_mtime_ns)
    with pytest.raises(AssertionError, match="asked for again"):
        CompiledComputedTorque(load_scenario("one_arm").truth.robot)


def test_a_library_of_another_robot_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever lies under a name, what it says is held against Pinocchio before anything moves."""
    wrong = RobotModel(someone_else(load_robot(), seed=6))
    libraries: list[Path] = []
    made = library_of

    def remember(*arguments: Any) -> Path:
        libraries.append(made(*arguments))
        return libraries[0]

    monkeypatch.setattr(library, "library_of", remember)
    CompiledComputedTorque(wrong)
    with pytest.raises(ConfigurationError, match=r"dynamics-\w+\.so differ from Pinocchio by .*: remove"):
        CompiledComputedTorque(RobotModel.load())


def test_a_damaged_library_is_named(
    robot: RobotModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    damaged = tmp_path / "damaged.so"
    damaged.write_bytes(b"none")
    monkeypatch.setattr(library, "library_of", lambda *arguments: damaged)
    with pytest.raises(ConfigurationError, match=r"cannot load .*damaged\.so: .*; remove the file"):
        CompiledComputedTorque(robot)


def test_a_folder_that_cannot_be_written_to(
    robot: RobotModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sms_handover").write_text("a file", encoding="ascii")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(ConfigurationError, match=r"cannot keep compiled dynamics in .*: File exists"):
        CompiledComputedTorque(robot)


def test_without_a_compiler(robot: RobotModel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler -m64")
    with pytest.raises(ConfigurationError, match="'no-such-compiler': install one, set CC to it, or take"):
        CompiledComputedTorque(robot)


def test_a_compiler_that_fails(robot: RobotModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiler = tmp_path / "cc"
    compiler.write_text("#!/bin/sh\necho 'no room left' >&2\nexit 3\n", encoding="ascii")
    compiler.chmod(0o700)
    monkeypatch.setenv("CC", str(compiler))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(ConfigurationError, match=r"cc -O1 .* failed: no room left"):
        CompiledComputedTorque(robot)
    assert [*(tmp_path / "sms_handover").iterdir()] == []


def test_without_casadi(robot: RobotModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for part in ("source", "step", "rigid_bodies"):
        monkeypatch.delitem(sys.modules, f"sms_handover.compiled.{part}", raising=False)
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(
        MissingDependencyError, match=r"compiled dynamics need casadi.*sms_handover\[compiled\]"
    ):
        CompiledComputedTorque(robot)


def test_a_folder_that_others_can_write_to_is_not_used(
    robot: RobotModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A library from there would be the code of whoever put it there."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = tmp_path / "sms_handover"
    folder.mkdir()
    folder.chmod(0o777)
    with pytest.raises(ConfigurationError, match=r"has mode drwxrwxrwx: .* it must be yours"):
        CompiledComputedTorque(robot)
