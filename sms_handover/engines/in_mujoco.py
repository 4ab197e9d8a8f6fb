"""Replay in MuJoCo, by its RK4 in steps of a tick."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from sms_handover.engines.mujoco_robot import MujocoRobot
from sms_handover.engines.protocol import Effect, Motion, Replay
from sms_handover.frames import tool_frame
from sms_handover.types import Array
from sms_handover.units import ns_to_seconds

_LACKS = {Effect.JOINT_STOPS: "its joint limits are springs"}


class InMujoco:
    """MuJoCo, given the MJCF of the robot."""

    @property
    def title(self) -> str:
        """Its name and version."""
        return f"MuJoCo {mujoco.__version__}"

    @property
    def lacks(self) -> Mapping[Effect, str]:
        """The effects that it cannot replay, and why."""
        return _LACKS

    def run(self, replay: Replay) -> Motion:
        """Integrate a replay without an effect that it lacks."""
        robot = MujocoRobot(replay.urdf, replay.rotor_inertia)
        order = [replay.joint_names.index(name) for name in robot.joint_names]
        back = np.argsort(order).tolist()
        robot.place(_with_joints(replay.start_q, order), _with_joints(replay.start_v, order))
        efforts, tick_s = replay.efforts[:, order], ns_to_seconds(replay.tick_ns)
        rows, momenta, tick = list[Array](), list[tuple[Array, Array]](), 0
        tools: dict[str, list[Array]] = {arm: [] for arm in replay.arms}
        for sample in replay.samples.tolist():
            for effort in efforts[tick:sample]:
                robot.drive(effort)
                robot.advance(tick_s, 1)
            tick = sample
            robot.evaluate()
            rows.append(_with_joints(robot.state[0], back))
            for arm, poses in tools.items():
                poses.append(robot.pose(tool_frame(arm)))
            momenta.append(robot.momentum())
        linear, angular = (np.array(part) for part in zip(*momenta, strict=True))
        return Motion(np.array(rows), {arm: np.array(poses) for arm, poses in tools.items()}, linear, angular)


def _with_joints(values: Array, order: Sequence[int]) -> Array:
    """Return q or v with its joints, the last entries, in another order."""
    head = values.size - len(order)
    return np.concatenate([values[:head], values[head:][list(order)]])
