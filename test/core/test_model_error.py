"""Model error: draws are possible bodies of the declared spread, and each is in the robot that is built."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.conditions.model_error import (
    BodySpread,
    ModelError,
    MountSpread,
    drawn_inertia,
    with_model_error,
)
from sms_handover.conditions.random_streams import RandomStreams
from sms_handover.model.description import load_robot
from sms_handover.model.parts import Inertia
from sms_handover.model.robot_model import RobotModel

_BODY = Inertia("link", 2.0, (0.1, 0.0, -0.2), (0.02, 0.001, 0.0, 0.03, 0.0, 0.012))


def test_a_draw_of_any_spread_is_a_possible_body() -> None:
    """Inertia itself rejects an impossible one; a spread of 2 stretches an axis by e^2 and more."""
    for seed in range(100):
        drawn_inertia(_BODY, BodySpread(2.0, 0.5, 2.0), RandomStreams(seed))


def test_draws_have_their_declared_spread() -> None:
    spread = BodySpread(0.02, 0.005, 0.1)
    drawn = [drawn_inertia(_BODY, spread, RandomStreams(seed)) for seed in range(600)]
    logs = np.log([body.mass / _BODY.mass for body in drawn])
    assert logs.std() == pytest.approx(0.02, rel=0.12)  # four sigma of 600
    shifts = np.array([body.com for body in drawn]) - _BODY.com
    assert shifts.std(axis=0) == pytest.approx(3 * [0.005], rel=0.12)
    second = [(0.5 * np.trace(body.matrix) * np.eye(3) - body.matrix) / body.mass for body in drawn]
    bare = (0.5 * np.trace(_BODY.matrix) * np.eye(3) - _BODY.matrix) / _BODY.mass
    per_mass = np.array(
        [np.log(s[0, 0] / body.mass * 2.0 / bare[0, 0]) for s, body in zip(second, drawn, strict=True)]
    )
    assert per_mass.std() == pytest.approx(0.1, rel=0.12)


def test_every_value_drawn_is_in_the_robot_that_the_plant_builds() -> None:
    known, streams = load_robot(), RandomStreams(8)
    error = ModelError(BodySpread(0.05, 0.01, 0.1), BodySpread(0.02, 0.005, 0.1), MountSpread(0.002, 0.01))
    true = with_model_error(known, error, streams)
    model = RobotModel(true).pin
    links = [link.inertia for arm in true.arms for link in arm.links]
    bodies = [true.base.inertia, *links]
    assert len({body.mass for body in bodies}) == len(bodies)
    base = model.inertias[1]
    assert base.mass == pytest.approx(true.base.inertia.mass, rel=1e-12)
    assert base.lever == pytest.approx(true.base.inertia.com, abs=1e-12)
    assert base.inertia == pytest.approx(true.base.inertia.matrix, rel=1e-9)
    inner = [inertia for arm in true.arms for inertia in (link.inertia for link in arm.links[:-1])]
    for body in inner:  # the last link carries the gripper
        joint = model.getJointId(model.frames[model.getFrameId(body.body)].name.replace("link", "joint"))
        assert model.inertias[joint].mass == pytest.approx(body.mass, rel=1e-12)
        assert model.inertias[joint].lever == pytest.approx(body.com, abs=1e-12)
        assert model.inertias[joint].inertia == pytest.approx(body.matrix, rel=1e-9, abs=1e-15)
    for arm, before in zip(true.arms, known.arms, strict=True):
        assert 0.0 < np.abs(np.subtract(arm.mount.xyz, before.mount.xyz)).max() < 0.01
        turned = pin.rpy.rpyToMatrix(*before.mount.rpy).T @ pin.rpy.rpyToMatrix(*arm.mount.rpy)
        assert 0.0 < np.linalg.norm(pin.log3(turned)) < 0.06
        joint = model.getJointId(arm.joints[0].name)
        frame = pin.SE3(pin.rpy.rpyToMatrix(*arm.mount.rpy), np.array(arm.mount.xyz))
        first = arm.joints[0].origin
        frame *= pin.SE3(pin.rpy.rpyToMatrix(*first.rpy), np.array(first.xyz))
        assert model.jointPlacements[joint].isApprox(frame, 1e-12)


def test_one_error_moves_no_draw_of_another() -> None:
    known, nothing = load_robot(), BodySpread()
    some = BodySpread(0.05, 0.01, 0.1)
    everything = with_model_error(known, ModelError(some, some, MountSpread(0.002, 0.0)), RandomStreams(2))
    of_base = with_model_error(known, ModelError(some, nothing, MountSpread()), RandomStreams(2))
    of_links = with_model_error(known, ModelError(nothing, some, MountSpread()), RandomStreams(2))
    assert of_base.base == everything.base
    assert [arm.links for arm in of_links.arms] == [arm.links for arm in everything.arms]
    without = [
        replace(arm, mount=other.mount) for arm, other in zip(everything.arms, of_links.arms, strict=True)
    ]
    assert tuple(without) == of_links.arms
