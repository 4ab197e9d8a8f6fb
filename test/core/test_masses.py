"""Masses of the deputy on their page: what its runs change of a scenario, and what it says of them."""

from pathlib import Path

import numpy as np
import pytest

from docs.mass_runs import MASSES, SIZES, Case, Load, Outcome, cases, grown, load_of, scenario_of, size_of
from docs.masses import page
from sms_handover.model.poses import pose_distance, pose_of, se3_of
from sms_handover.simulation.scenario import load_scenario
from sms_handover.types import Pose

_EPS = np.finfo(float).eps


def _frames(case: Case) -> dict[str, Pose]:
    """Return where the grasp frames of a case are in ``world``."""
    deputy = scenario_of(case).truth.schedule.deputy
    placed = se3_of(deputy.deputy_in_world)
    return {name: pose_of(placed * se3_of(pose)) for name, pose in deputy.grasp_frames.items()}


def test_a_larger_body_is_grasped_where_the_small_one_is() -> None:
    assert [size_of(mass) for mass in (1.0, 6.0, 12.0, 24.0)] == ["3U", "3U", "6U", "12U"]
    small, large = (_frames(Case("paper", mass, "known", "nmpc")) for mass in (1.0, 24.0))
    for name, frame in small.items():
        assert max(pose_distance(frame, large[name])) <= 100 * _EPS
    deputy = scenario_of(Case("paper", 24.0, "known", "nmpc")).truth.schedule.deputy
    np.testing.assert_allclose(deputy.size, SIZES["12U"][1])


@pytest.mark.parametrize(("belief", "factor"), [("known", 1.0), ("half of it", 0.5), ("unknown", 0.0)])
def test_what_is_believed_is_of_the_model_alone(belief: str, factor: float) -> None:
    scenario = scenario_of(Case("paper", 8.0, belief, "nmpc"))
    assert scenario.truth.schedule.deputy.mass == 8.0
    assert scenario.model.schedule.deputy.mass == 8.0 * factor


def test_a_wrist_feels_a_mass_most_of_all() -> None:
    """About the axis of its last joint the deputy adds m r^2 + I_zz to the gripper; the link adds some."""
    load, deputy = load_of(1.0), load_scenario("paper", {"deputy.mass": 1.0}).truth.schedule.deputy
    assert deputy.body is not None
    _, y, z = deputy.grasp_frames["end_a"].position
    gripper = 0.5 * 0.6451 * 0.05**2  # kg m^2, a cylinder about its axis
    added = (deputy.size[1] ** 2 + deputy.size[2] ** 2) / 12.0 + y**2 + z**2
    assert 0.5 < load.growth / (1.0 + added / gripper) < 1.0
    assert load.decay == pytest.approx(2.0 * load.growth / 1.25)  # A_2 = 5 / (2 T_r), T_r = 2 s


def test_the_page_has_every_case_and_keeps_what_was_run(tmp_path: Path) -> None:
    done = dict.fromkeys(cases(), Outcome("completes", (0.001, 0.002), 3.0, 1.5))
    text = page(done, {1.0: Load(1.0, 25.0, 40.0)})
    for mass in MASSES:
        assert f"| {mass:g} | {size_of(mass)} | known | completes | 0.001, 0.002 | 3.0 | 1.50 |" in text
    first = cases()[0]
    row = '{"case": {"scenario": "paper", "mass": 1.0, "belief": "known", "law": "nmpc"}, '
    row += '"outcome": {"words": "kept", "distances": [], "turn": 0.0, "peak": 0.0}}'
    (tmp_path / "rows.jsonl").write_text(row + "\n", encoding="utf-8")
    assert grown(tmp_path, [first])[first].words == "kept"
