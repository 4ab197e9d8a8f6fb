"""Clearance: signed distances of all bodies against MuJoCo.

MuJoCo reads shapes and their places from the URDF text by itself and has a collision library of its own.
"""

from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pinocchio as pin

from sms_handover.clearance.bodies import BodyKind
from sms_handover.clearance.distances import ClearanceModel
from sms_handover.frames import BASE
from sms_handover.model.description import load_robot
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import BASE_NQ, Pose
from test.evidence import Record

_POSES = 1000
_FAR = 10.0  # [m] beyond which MuJoCo is not asked for a distance
_BOUND = 1e-5  # [m] of two iterative methods on cylinders; the last steps of both are of 1e-6 m
_SOLID, _DRAWN = 0, 1  # [-] groups of <collision> and <visual> elements in MuJoCo's reading


def test_distances_of_all_pairs(record: Record) -> None:
    robot = RobotModel(load_robot())
    ours = ClearanceModel(robot.pin, robot.urdf, robot.arms, np.array([0.1, 0.34, 0.1]))
    root = ET.fromstring(robot.urdf)
    kept = {"fusestatic": "false", "discardvisual": "false", "balanceinertia": "false"}
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", kept)
    theirs = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    geoms = _geoms(theirs, ours)
    pairs = [(k, geoms[a.name], geoms[b.name]) for k, (a, b) in enumerate(ours.pairs) if b.name in geoms]
    data = mujoco.MjData(theirs)
    places = [int(theirs.joint(name).qposadr[0]) for name in robot.joint_names]
    random = np.random.default_rng(16)
    deputy, q = Pose(np.array([9.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0])), pin.neutral(robot.pin)
    apart, inside = 0.0, 0.0
    for _ in range(_POSES):
        q[BASE_NQ:] = data.qpos[places] = random.uniform(robot.lower, robot.upper).clip(-np.pi, np.pi)
        mujoco.mj_forward(theirs, data)
        distances = ours.distances(q, deputy)
        for k, one, other in pairs:
            distance = mujoco.mj_geomDistance(theirs, data, one, other, _FAR, None)
            error = abs(distance - distances[k])
            if distances[k] > 0.0:
                apart = max(apart, error)
            else:
                inside = max(inside, error)
    against = f"MuJoCo {mujoco.__version__}, URDF"
    assert len(pairs) == len([pair for pair in ours.pairs if pair[1].kind is not BodyKind.DEPUTY])
    record("distance of bodies that are apart", apart, _BOUND, unit="m", against=against)
    record("depth of bodies that enter each other", inside, _BOUND, unit="m", against=against)


def _geoms(theirs: mujoco.MjModel, ours: ClearanceModel) -> dict[str, int]:
    """Return MuJoCo's shape of each body of the robot: what is solid, and the panels, drawn alone."""
    found: dict[str, int] = {}
    for group in (_SOLID, _DRAWN):
        for geom in np.flatnonzero(theirs.geom_group == group):
            link = theirs.body(theirs.geom_bodyid[geom]).name
            if group == _SOLID:
                found[link] = int(geom)
            elif link == BASE and not np.array_equal(theirs.geom_pos[geom], theirs.geom_pos[found[BASE]]):
                found[f"{BASE}_{sum(name.startswith(BASE) for name in found) + 1}"] = int(geom)
    assert set(found) == {body.name for body in ours.bodies if body.kind is not BodyKind.DEPUTY}
    return found
