"""A grasp holds inside its tolerances, is missed outside any of them, and a miss changes nothing."""

from math import isnan

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.model.poses import pose_distance, pose_of, se3_of
from sms_handover.plant.deputy import GraspTolerance, MasslessDeputy
from sms_handover.plant.grasping import execute_grasp
from sms_handover.types import GraspAction, GraspCommand, GraspEvent, GraspStatus, Pose, Twist

from .conftest import Draw

_TOLERANCE = GraspTolerance(position=0.01, angle=0.03, speed=0.02)
_FRAMES = {
    "left": Pose(np.array([0.0, 0.12, 0.0]), np.array([0.0, 0.0, 0.0, 1.0])),
    "right": Pose(np.array([0.0, -0.12, 0.0]), np.array([0.0, 0.0, 1.0, 0.0])),
}
_GRASP_A = GraspCommand(GraspAction.GRASP, "arm_a", "left")
_RELEASE_A = GraspCommand(GraspAction.RELEASE, "arm_a")
_TO_B = GraspCommand(GraspAction.TRANSFER, "arm_b", "right", from_arm="arm_a")


class Scene:
    """A deputy at rest, arm A at one grasp frame and arm B at the other, each off by what a test says."""

    def __init__(self, draw: Draw) -> None:
        """Place the deputy."""
        self.pose = draw.pose()
        self.deputy = MasslessDeputy(self.pose, _FRAMES)
        self.tools = {"arm_a": self.frame("left"), "arm_b": self.frame("right")}
        self.twists = {arm: Twist(np.zeros(3), np.zeros(3)) for arm in self.tools}

    def frame(self, name: str) -> Pose:
        """Return a grasp frame in ``world``."""
        return pose_of(se3_of(self.pose) * se3_of(_FRAMES[name]))

    def put_off(self, arm: str, metres: float, radians: float, speed: float) -> None:
        """Move the tool of an arm away from where it is."""
        off = pin.SE3(pin.exp3(np.array([0.0, radians, 0.0])), np.array([metres, 0.0, 0.0]))
        self.tools[arm] = pose_of(se3_of(self.tools[arm]) * off)
        self.twists[arm] = Twist(np.array([0.0, 0.0, speed]), np.ones(3))

    def answer(self, command: GraspCommand) -> GraspEvent:
        """Return the answer of the plant."""
        return execute_grasp(command, self.deputy, self.tools, self.twists, _TOLERANCE, stamp_ns=5)


@pytest.fixture
def scene(draw: Draw) -> Scene:
    """Both tools exactly at their grasp frames."""
    return Scene(draw)


def test_a_grasp_within_every_tolerance_holds(scene: Scene) -> None:
    """Just inside all three, the arm holds the deputy, and the event says how far it was off."""
    scene.put_off("arm_a", 0.0099, 0.0299, 0.0199)
    event = scene.answer(_GRASP_A)
    assert (event.status, event.stamp_ns, event.command) == (GraspStatus.SUCCEEDED, 5, _GRASP_A)
    errors = (event.position_error, event.angle_error, event.relative_speed)
    assert errors == pytest.approx((0.0099, 0.0299, 0.0199), abs=1e-15)
    assert event.detail == "arm_a holds the deputy"
    assert scene.deputy.holder == "arm_a"


@pytest.mark.parametrize(
    ("off", "detail"),
    [
        ((0.0101, 0.0, 0.0), "distance 10.1 mm, allowed 10 mm"),
        ((0.0, 0.0301, 0.0), "angle 1.725 deg, allowed 1.719 deg"),
        ((0.0, 0.0, 0.0201), "speed 20.1 mm/s, allowed 20 mm/s"),
        ((0.02, 0.0, 0.5), "distance 20 mm, allowed 10 mm; speed 500 mm/s, allowed 20 mm/s"),
    ],
)
def test_a_grasp_outside_a_tolerance_is_missed(
    scene: Scene, off: tuple[float, float, float], detail: str
) -> None:
    """One error too large is enough; the event names it with its bound, and the deputy stays where it was."""
    scene.put_off("arm_a", *off)
    event = scene.answer(_GRASP_A)
    assert (event.status, event.detail) == (GraspStatus.MISSED, detail)
    assert scene.deputy.holder == ""
    assert pose_distance(scene.deputy.state.deputy_in_world, scene.pose)[0] == 0.0


def test_the_deputy_can_be_let_go_and_grasped_again(scene: Scene) -> None:
    """Grasp, release, grasp by the other arm: each is answered, and errors of a release do not exist."""
    assert scene.answer(_GRASP_A).status is GraspStatus.SUCCEEDED
    event = scene.answer(_RELEASE_A)
    assert (event.status, event.detail) == (GraspStatus.SUCCEEDED, "arm_a let go")
    assert isnan(event.position_error) and isnan(event.angle_error) and isnan(event.relative_speed)
    assert scene.deputy.holder == ""
    assert scene.answer(GraspCommand(GraspAction.GRASP, "arm_b", "right")).status is GraspStatus.SUCCEEDED
    assert scene.deputy.holder == "arm_b"


def test_a_transfer_changes_hands_in_one_instant(scene: Scene) -> None:
    """Afterwards arm B holds it, and it moves with B, not with A."""
    scene.answer(_GRASP_A)
    assert scene.answer(_TO_B).status is GraspStatus.SUCCEEDED
    assert scene.deputy.holder == "arm_b"
    scene.deputy.follow(scene.tools["arm_b"], scene.twists["arm_b"])
    assert pose_distance(scene.deputy.state.deputy_in_world, scene.pose)[0] <= 1e-15


def test_a_missed_transfer_leaves_it_with_the_giver(scene: Scene) -> None:
    """If the taker is out of tolerance, the giver keeps its hold and the deputy its place in its hand."""
    scene.answer(_GRASP_A)
    scene.put_off("arm_b", 0.05, 0.0, 0.0)
    event = scene.answer(_TO_B)
    assert (event.status, event.detail) == (GraspStatus.MISSED, "distance 50 mm, allowed 10 mm")
    assert scene.deputy.holder == "arm_a"
    scene.deputy.follow(scene.tools["arm_a"], scene.twists["arm_a"])
    assert pose_distance(scene.deputy.state.deputy_in_world, scene.pose)[0] <= 1e-15


@pytest.mark.parametrize(
    ("held", "command", "detail"),
    [
        (False, _RELEASE_A, "arm_a does not hold the deputy"),
        (True, GraspCommand(GraspAction.RELEASE, "arm_b"), "arm_b does not hold the deputy"),
        (True, GraspCommand(GraspAction.GRASP, "arm_b", "right"), "arm_a holds the deputy already"),
        (True, _GRASP_A, "arm_a holds the deputy already"),
        (False, _TO_B, "arm_a does not hold the deputy"),
        (
            True,
            GraspCommand(GraspAction.TRANSFER, "arm_a", "left", from_arm="arm_b"),
            "arm_b does not hold the deputy",
        ),
    ],
)
def test_a_command_that_contradicts_the_holder_is_rejected(
    scene: Scene, held: bool, command: GraspCommand, detail: str
) -> None:
    """It is answered with the reason, and who holds the deputy does not change."""
    if held:
        scene.answer(_GRASP_A)
    before = scene.deputy.holder
    event = scene.answer(command)
    assert (event.status, event.detail) == (GraspStatus.REJECTED, detail)
    assert isnan(event.position_error) and isnan(event.angle_error) and isnan(event.relative_speed)
    assert scene.deputy.holder == before
