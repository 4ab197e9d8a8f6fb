"""Snapshots: a run goes on in another process as if nothing had happened."""

from pathlib import Path

import numpy as np
import pytest

from test.core.loop_rest import digests_of_rests
from test.core.retried_handover import EARLIEST_END, LAWS, MISSED, retried_handover
from test.evidence import Record

COUNT = 50  # random ticks under each law


@pytest.mark.parametrize("law", LAWS)
def test_the_rest_of_a_run_from_a_snapshot(law: str, tmp_path: Path, record: Record) -> None:
    """The handover has a grasp that misses, its retry, a transfer and a release."""
    chosen = np.random.default_rng(14).choice(EARLIEST_END, size=COUNT - len(MISSED), replace=False)
    ticks = {*MISSED, *chosen.tolist()}
    assert len(ticks) == COUNT
    digests = digests_of_rests({**retried_handover(tmp_path), "controller": LAWS[law]}, ticks, tmp_path)
    assert len(digests) == COUNT
    record(
        f"{law}: snapshots at {COUNT} random ticks from which the rest of the run differs in any bit",
        sum(uninterrupted != restored for uninterrupted, restored in digests),
        0,
        against="the uninterrupted run, and a fresh process that reads the snapshots from files",
    )
