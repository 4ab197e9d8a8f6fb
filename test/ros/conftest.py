"""What the tests of the edge share: a ROS domain that nobody else is in, and a bench in it."""

import gc
from collections.abc import Iterator
from pathlib import Path

import pytest

from sms_handover.launcher.domain import _is_used, reserved_domain

from .bench import Bench


@pytest.fixture(scope="session")
def domain() -> Iterator[int]:
    """A ROS domain of this test process alone."""
    with reserved_domain(None) as number:
        yield number


@pytest.fixture
def bench(domain: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    """A bench for nodes, empty and not started."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_STATIC_PEERS", "")
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "ros_log"))
    bench = Bench(domain, tmp_path)
    yield bench
    bench.close()
    if _is_used(domain):
        gc.collect()  # a node that has failed is kept by its traceback, and would meet the next test's
