"""A run in the worst place there is: it runs, and leaves its bag."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sms_handover.bag.repair.check import check

from ..ros.short_handover import short_handover

pytestmark = pytest.mark.system


def test_a_run_leaves_its_bag_wherever_it_is_started(tmp_path: Path) -> None:
    """No stream is open, no home is there, and what other software wants of ROS and Python is not ours.

    The folder that the user stands in has modules of the names of those that the nodes import.
    """
    for name in ("yaml", "numpy", "mcap"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('a stranger')\n", encoding="ascii")
    (tmp_path / "schedule.yaml").write_text(short_handover(), encoding="utf-8")
    environment = {name: value for name, value in os.environ.items() if name != "HOME"}
    environment |= {
        "RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp",
        "ROS_DISCOVERY_SERVER": "127.0.0.1:11811",
        "ROS_LOG_DIR": "/proc/none",
        "PYTHONPATH": "/nowhere:",
        "LC_ALL": "C",
        "PYTHONIOENCODING": "ascii",
    }
    command = f"{Path(sys.executable).parent}/sms-handover run --schedule schedule.yaml -o run"
    done = subprocess.run(
        ["sh", "-c", f"{command} <&- >&- 2>&-"], cwd=tmp_path, env=environment, timeout=180.0, check=False
    )
    assert done.returncode == 0
    assert check(tmp_path / "run" / "bag").complete
