"""Whatever waits for ROS looks up again: a wait without an end sleeps through a signal that comes between.

rclpy wakes the executor before it shuts the context down; one that looks in between waits on, for good.
"""

import ast
from collections.abc import Iterator

import pytest

from .workspace import ROOT

FOLDERS = ("sms_handover", "examples", "benchmarks", "test")
TIMED = {"spin_once": 2, "spin_until_future_complete": 3}  # [-] arguments, the timeout the last of them


def endless_waits(source: str) -> Iterator[int]:
    """Yield the line of every spin without a timeout."""
    for node in ast.walk(ast.parse(source)):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
            continue
        name, receiver = node.func.attr, ast.unparse(node.func.value)
        by_name = {keyword.arg for keyword in node.keywords}
        timed = "timeout_sec" in by_name or len(node.args) >= TIMED.get(name, 0)
        endless = name == "spin" and receiver.endswith(("rclpy", "executor"))
        if endless or (name in TIMED and not timed):
            yield node.lineno


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_spin_has_a_timeout(folder: str) -> None:
    files = sorted((ROOT / folder).rglob("*.py"))
    assert files
    found = {
        f"{path.relative_to(ROOT)}:{line}"
        for path in files
        for line in endless_waits(path.read_text("utf-8"))
    }
    assert found == set()


@pytest.mark.parametrize(
    "endless", ["rclpy.spin(node)", "executor.spin()", "executor.spin_once()", "rclpy.spin_once(node)"]
)
def test_a_spin_without_a_timeout_is_seen(endless: str) -> None:
    assert list(endless_waits(f"import rclpy\n{endless}\n")) == [2]
    assert not list(endless_waits("import rclpy\nrclpy.spin_once(node, timeout_sec=0.1)\n"))
