"""The page of a scene before any browser has seen it: complete, of modest weight, and refused where empty."""

import re
from dataclasses import replace

import pytest

from sms_handover.errors import ConfigurationError
from sms_handover.scene.page import animation_html
from sms_handover.scene.scene import Scene, make_scene
from sms_handover.simulation.simulate import simulate

from .conftest import MakeScenario

LIBRARY = 700_000  # [B] of scripts, styles and the library that draws


@pytest.fixture
def scene(make_scenario: MakeScenario) -> Scene:
    scenario = make_scenario()
    return make_scene(simulate(scenario), scenario.truth.robot.urdf, scenario.truth.schedule.deputy.size)


def test_it_names_nothing_to_load(scene: Scene) -> None:
    page = animation_html({"nmpc": scene})
    assert re.findall(r"<(?:script|link|img|iframe)[^>]*(?:src|href)=\"(?!data:)", page) == []
    assert "{{" not in re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)


def test_an_instant_weighs_its_poses_in_single_precision(scene: Scene) -> None:
    frames = slice(0, 11)
    shorter = replace(
        scene,
        stamp_ns=scene.stamp_ns[frames],
        link_in_world=scene.link_in_world[frames],
        deputy_in_world=scene.deputy_in_world[frames],
        target_in_world={arm: poses[frames] for arm, poses in scene.target_in_world.items()},
    )
    short, long = (len(animation_html({"nmpc": item})) for item in (shorter, scene))
    more = len(scene.stamp_ns) - 11
    bodies = len(scene.links) + 1 + len(scene.arms)  # the deputy, and a target per arm
    single, double, base64 = 4, 8, 4 / 3  # [B]
    assert long - short == pytest.approx(more * (bodies * 7 * single + double) * base64, abs=8)
    assert short < LIBRARY


def test_the_licence_of_the_library_goes_with_it(scene: Scene) -> None:
    page = animation_html({"nmpc": scene})
    assert "three.js authors" in page and "MIT" in page


def test_a_page_without_a_run_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="there is no run to show"):
        animation_html({})
