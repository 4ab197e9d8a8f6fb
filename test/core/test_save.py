"""A saved run is read back by NumPy alone, and no file is written over."""

from pathlib import Path

import numpy as np
import pytest

from sms_handover.errors import ConfigurationError
from sms_handover.run_data import RunData
from sms_handover.simulation.save import save_run

from .bag_messages import made_up_run


@pytest.fixture
def run() -> RunData:
    return made_up_run()


def test_every_array_comes_back_bit_for_bit(run: RunData, tmp_path: Path) -> None:
    save_run(run, tmp_path / "run.npz")
    expected = {name: value for name, value in vars(run).items() if isinstance(value, np.ndarray)}
    for arm in run.arms:
        expected[f"target_pose.{arm}"] = run.target_pose[arm]
        expected[f"tool_pose.{arm}"] = run.tool_pose[arm]
    with np.load(tmp_path / "run.npz", allow_pickle=False) as saved:
        assert set(saved) == {*expected, "joint_names"}
        for name, array in expected.items():
            assert (saved[name].dtype, saved[name].shape) == (array.dtype, array.shape)
            assert saved[name].tobytes() == array.tobytes(), name
        assert tuple(saved["joint_names"]) == run.joint_names


def test_a_name_is_taken_as_it_is(run: RunData, tmp_path: Path) -> None:
    """NumPy would put .npz behind it, and another file would be written than the one that was checked."""
    save_run(run, tmp_path / "run.dat")
    assert [path.name for path in tmp_path.iterdir()] == ["run.dat"]


def test_a_file_that_exists_is_kept(run: RunData, tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    path.write_text("mine", encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"run\.npz exists; choose another file"):
        save_run(run, path)
    assert path.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("name", ["nowhere/run.npz", "file/run.npz"])
def test_a_place_that_cannot_be_written_to_is_named(run: RunData, tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"run\.npz cannot be written: "):
        save_run(run, tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
