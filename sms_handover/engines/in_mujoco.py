"""Replay in MuJoCo, by its RK4 in steps of a tick."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from sms_handover.engines.mujoco_deputy import MujocoScene
from sms_handover.engines.protocol import Effect, Motion, Replay
from sms_handover.frames import tool_frame
from sms_handover.plant.external_wrenches import sum_over
from sms_handover.types import Array
from sms_handover.units import ns_to_seconds

_LACKS = {
    Effect.PANELS: "its joints are those of the arms alone",
    Effect.DEPUTY_WRENCHES: "wrenches are put on the base alone",
    Effect.JOINT_STOPS: "its joint limits are springs",
    Effect.FRICTION: "its dry friction is a soft constraint, without stiction",
}


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
        scene = MujocoScene(replay)
        order = [replay.joint_names.index(name) for name in scene.robot.joint_names]
        scene.robot.place(_with_joints(replay.start_q, order), _with_joints(replay.start_v, order))
        efforts, tick_s = replay.efforts[:, order], ns_to_seconds(replay.tick_ns)
        holds, samples = list(replay.holds), set(replay.samples.tolist())
        taken, impulses, start = _Samples(replay, order), list[Array](), 0
        for stop in sorted({*samples, *(hold.tick for hold in holds)}):
            for tick in range(start, stop):
                scene.robot.drive(efforts[tick])
                if replay.wrenches:
                    scene.robot.evaluate()
                    body = scene.robot.as_body
                    scene.robot.push(sum_over(replay.wrenches, tick * tick_s, tick_s, body))
                scene.advance(tick_s)
            start = stop
            if stop in samples:
                taken.add(scene)
            while holds and holds[0].tick == stop:  # after the state of this tick, before its integration
                impulse = scene.hold(holds.pop(0).holder)
                impulses += [] if impulse is None else [impulse]
        return taken.motion(impulses)


class _Samples:
    """States that are to be compared, as MuJoCo has them."""

    def __init__(self, replay: Replay, order: Sequence[int]) -> None:
        self._back = np.argsort(order).tolist()
        self._q, self._deputy = list[Array](), list[Array]()
        self._momenta = list[tuple[Array, Array]]()
        self._tools: dict[str, list[Array]] = {arm: [] for arm in replay.arms}

    def add(self, scene: MujocoScene) -> None:
        """Take the present state."""
        scene.evaluate()
        self._q.append(_with_joints(scene.robot.state[0], self._back))
        self._momenta.append(scene.momentum())
        for arm, poses in self._tools.items():
            poses.append(scene.robot.pose(tool_frame(arm)))
        deputy = scene.deputy
        self._deputy += [] if deputy is None else [deputy]

    def motion(self, impulses: list[Array]) -> Motion:
        """Return all of them, with the impulses of grasps."""
        linear, angular = (np.array(part) for part in zip(*self._momenta, strict=True))
        tools = {arm: np.array(poses) for arm, poses in self._tools.items()}
        deputy, given = np.array(self._deputy).reshape(-1, 7), np.array(impulses).reshape(-1, 6)
        return Motion(np.array(self._q), tools, linear, angular, deputy, given)


def _with_joints(values: Array, order: Sequence[int]) -> Array:
    """Return q or v with its joints, the last entries, in another order."""
    head = values.size - len(order)
    return np.concatenate([values[:head], values[head:][list(order)]])
