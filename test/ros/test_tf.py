"""A node that knows nothing of us draws the robot from /tf and /tf_static alone, live."""

import json
import sysconfig
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from rosbags.typesys import Stores, get_typestore
from tf2_msgs.msg import TFMessage

from sms_handover.frames import BASE, DEPUTY, WORLD, grasp_frame, target_frame
from sms_handover.graph.topics import (
    BASE_ODOMETRY,
    DEPUTY_POSE,
    JOINT_STATES,
    ROBOT_DESCRIPTION,
    TF,
    TF_TYPE,
    target_pose,
)
from sms_handover.messages.stamps import stamp_ns
from sms_handover.messages.values import pose_values
from sms_handover.model.poses import pose_row
from sms_handover.ros.codecs.loop_messages import StateCodec
from sms_handover.scene.links import DescribedRobot

from ..transforms import TransformTree, matrix_of
from ..workspace import ROOT
from .bench import Bench
from .graph import ARMS, Graph, Messages

pytestmark = pytest.mark.ros

OFFICIAL = "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"  # of ROS 2 Jazzy
ROUNDING = 1e-12  # [m] and [-]


class Viewer:
    """The subscriptions of a node as tf2_ros makes them: its topics and its qualities of service."""

    def __init__(self, node: Node) -> None:
        self.fixed, self.moved = list[TFMessage](), list[TFMessage]()
        latched = QoSProfile(depth=100, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(TFMessage, "/tf", self.moved.append, QoSProfile(depth=100))
        node.create_subscription(TFMessage, "/tf_static", self.fixed.append, latched)

    def tree_at(self, stamp: int) -> TransformTree:
        """Return all transforms of one stamp, with those that never change."""
        tree = TransformTree()
        for message in [*self.fixed, *(moved for moved in self.moved if _stamp(moved) == stamp)]:
            tree.add(message)
        return tree


def _stamp(message: Any) -> int:
    stamp = message.transforms[0].header.stamp
    return int(stamp.sec * 10**9 + stamp.nanosec)


def test_a_viewer_sees_forward_kinematics_deputy_and_targets(bench: Bench) -> None:
    """Against poses computed from description and state, and those on topics of their own; early and late."""
    graph = Graph(bench)
    viewer = Viewer(bench.stranger("viewer"))
    bench.spin(bench._nodes[-1])
    bench.until(lambda: graph.plant.count_subscribers(TF) == 2, "the viewer")
    graph.run()
    bench.until(lambda: len(viewer.moved) == len(graph.heard[TF]) and viewer.fixed, "all transforms")
    messages, heard = Messages(), graph.heard
    robot = DescribedRobot(messages.of(graph, ROBOT_DESCRIPTION)[0].data)
    codec = StateCodec(graph.plant.robot.joint_names, WORLD, BASE)
    states = {stamp_ns(data): at for at, data in enumerate(heard[JOINT_STATES])}
    poses = {DEPUTY: DEPUTY_POSE, **{target_frame(arm): target_pose(arm) for arm in ARMS}}
    frames = graph.plant.schedule.deputy.grasp_frames
    stamps = graph.stamps(DEPUTY_POSE)
    assert len(viewer.moved) == 2 * len(stamps), "one message of the plant, one of the trajectory"
    for period in (0, 7, len(stamps) - 1):
        stamp = stamps[period]
        tree, at = viewer.tree_at(stamp), states[stamp]
        assert tree.frames == {*robot.links, *poses, *map(grasp_frame, frames)}
        state = codec.read(heard[JOINT_STATES][at], heard[BASE_ODOMETRY][at])
        base = pose_row(state.base_in_world)[np.newaxis]
        rows = robot.poses(base, state.joint_position[np.newaxis], graph.plant.robot.joint_names)[0]
        expected = {link: matrix_of(row) for link, row in zip(robot.links, rows, strict=True)}
        for frame, topic in poses.items():
            expected[frame] = matrix_of(np.array(pose_values(messages.of(graph, topic)[period])))
        for name, pose in frames.items():
            expected[grasp_frame(name)] = expected[DEPUTY] @ matrix_of(pose_row(pose))
        for frame, matrix in expected.items():
            assert np.abs(tree.in_world(frame) - matrix).max() < ROUNDING, (stamp, frame)


def test_the_type_is_that_of_ros() -> None:
    """By the hash that publishers announce; no two definitions have it in common."""
    file = Path(sysconfig.get_path("data"), "share", "tf2_msgs", "msg", "TFMessage.json")
    hashes = {item["type_name"]: item["hash_string"] for item in json.loads(file.read_text())["type_hashes"]}
    assert hashes[TF_TYPE] == get_typestore(Stores.ROS2_JAZZY).hash_rihs01(TF_TYPE) == OFFICIAL


def test_both_interface_packages_are_built_with_the_same_wheels() -> None:
    """Their manifests differ in what they are called only."""
    manifests = [
        (ROOT / folder / "pyproject.toml").read_text(encoding="utf-8").splitlines()
        for folder in ("interfaces", "interfaces_tf2")
    ]
    different = [pair for pair in zip(*manifests, strict=True) if pair[0] != pair[1]]
    assert [first.split(" = ")[0] for first, _ in different] == ["name", "description"]
