"""What a user's environment, folder and streams hold is handled, or named in one line with the remedy."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sms_handover.errors import ConfigurationError
from sms_handover.ros.process.environment import drop_current_folder, prepare_environment, require_utf8
from sms_handover.terminal.streams import printable

CASES = Path(__file__).resolve().parents[1] / "data" / "cases"


@pytest.fixture
def home(tmp_path: Path) -> dict[str, str]:
    """An environment with nothing wrong in it."""
    return {"HOME": str(tmp_path)}


def test_nothing_is_changed_where_nothing_is_wrong(home: dict[str, str]) -> None:
    before = dict(home)
    for private in (True, False):
        assert prepare_environment(private=private, environment=home) == []
    assert home == before


def test_another_middleware_is_replaced(home: dict[str, str]) -> None:
    home["RMW_IMPLEMENTATION"] = "rmw_cyclonedds_cpp"
    (told,) = prepare_environment(private=False, environment=home)
    assert told == "RMW_IMPLEMENTATION is rmw_cyclonedds_cpp; rmw_fastrtps_cpp is used instead"
    assert home["RMW_IMPLEMENTATION"] == "rmw_fastrtps_cpp"
    assert prepare_environment(private=False, environment=home) == []


def test_a_discovery_server_is_none_of_a_run_and_told_elsewhere(home: dict[str, str]) -> None:
    home["ROS_DISCOVERY_SERVER"] = "10.0.0.1:11811"
    (told,) = prepare_environment(private=False, environment=home)
    assert "10.0.0.1:11811: only nodes that it knows are found; unset it" in told
    (told,) = prepare_environment(private=True, environment=home)
    assert "is ignored" in told and "ROS_DISCOVERY_SERVER" not in home


@pytest.mark.parametrize("values", [{}, {"HOME": "/proc/none"}, {"ROS_HOME": "/proc/none"}, {"HOME": ""}])
def test_without_a_home_ros_logs_elsewhere(values: dict[str, str], home: dict[str, str]) -> None:
    environment = dict(values)
    (told,) = prepare_environment(private=False, environment=environment)
    folder = Path(environment["ROS_LOG_DIR"])
    assert told.endswith(f"ROS logs to {folder}") and folder.is_dir()
    folder.rmdir()
    assert prepare_environment(private=True, environment=dict(values)) == []  # a run has a folder of its own
    assert prepare_environment(private=False, environment={**values, "ROS_LOG_DIR": home["HOME"]}) == []


def test_a_log_folder_that_cannot_be_written_is_ignored(home: dict[str, str]) -> None:
    home["ROS_LOG_DIR"] = "/proc/none"
    assert prepare_environment(private=True, environment=home) == [
        "ROS_LOG_DIR /proc/none cannot be written and is ignored"
    ]
    assert "ROS_LOG_DIR" not in home


def test_an_rclpy_of_another_python_is_named(home: dict[str, str], tmp_path: Path) -> None:
    rclpy = tmp_path / "site" / "rclpy"
    rclpy.mkdir(parents=True)
    (rclpy / "_rclpy_pybind11.cpython-27-x86_64-linux-gnu.so").touch()
    home["PYTHONPATH"] = f"{tmp_path}:{tmp_path / 'site'}"
    with pytest.raises(ConfigurationError, match=r"was not built for this Python .* unset PYTHONPATH"):
        prepare_environment(private=True, environment=home)
    (rclpy / "_rclpy_pybind11.so").touch()
    assert prepare_environment(private=True, environment=home) == []


def test_empty_entries_of_pythonpath_are_dropped(tmp_path: Path) -> None:
    environment = {"PYTHONPATH": f":{tmp_path}:"}
    path = ["/bin", "", str(tmp_path), os.getcwd(), "/lib"]
    drop_current_folder(path, environment)
    assert environment["PYTHONPATH"] == str(tmp_path) and path == ["/bin", str(tmp_path), "/lib"]
    drop_current_folder(path := ["/bin", os.getcwd()], {"PYTHONPATH": "/x"})
    assert path == ["/bin", os.getcwd()]


def test_what_is_not_utf8_is_named() -> None:
    require_utf8(["caf\u00e9", "run"])
    with pytest.raises(ConfigurationError, match=r"^'caf\\udce9' is not UTF-8.*symbolic link"):
        require_utf8([os.fsdecode(b"caf\xe9")])
    assert printable("/a b") == "/a b" and printable("a\nb\udce9") == r"'a\nb\udce9'"


BAG = CASES / "nan_in_arrays.mcap"


@pytest.mark.parametrize(("redirect", "code"), [(">&- 2>&- <&-", 0), (">/dev/full", 1), ("2>/dev/full", 0)])
def test_streams_that_take_nothing(tmp_path: Path, redirect: str, code: int) -> None:
    """In a folder with a name that is not UTF-8, with a yaml.py, ASCII output and a notebook's MPLBACKEND."""
    place = tmp_path / os.fsdecode(b"l\xe4tin")
    place.mkdir()
    (place / "b.mcap").write_bytes(BAG.read_bytes())
    for module in ("yaml", "numpy", "mcap"):
        (place / f"{module}.py").write_text("raise RuntimeError", encoding="ascii")
    program = f"{Path(sys.executable).parent}/sms-handover bag info $PWD/b.mcap {redirect}"
    environment = {
        **os.environ,
        "PYTHONIOENCODING": "ascii",
        "LC_ALL": "C",
        "PYTHONPATH": ":",
        "MPLBACKEND": "x",
    }
    done = subprocess.run(
        ["bash", "-c", program], cwd=place, env=environment, stderr=subprocess.PIPE, text=True, check=False
    )
    assert "Traceback" not in done.stderr and "ignored" not in done.stderr
    assert done.returncode == code
