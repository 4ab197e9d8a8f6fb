"""What a document of a scene holds, read as the page reads it; and a scene played live."""

import base64
from dataclasses import replace
from typing import Any

import numpy as np

from sms_handover.scene.live import LiveFrame, LiveScene
from sms_handover.scene.scene import Scene
from sms_handover.types import Array


def times(document: Any) -> Array:
    """Return the instants in s."""
    return np.frombuffer(base64.b64decode(document["times"]), "<f8")


def poses(document: Any, bodies: int) -> Array:
    """Return the poses of all bodies (T, bodies, 7)."""
    numbers = np.frombuffer(base64.b64decode(document["poses"]), "<f4").astype(np.float64)
    return numbers.reshape(-1, bodies, 7)


def plans(document: Any, arms: int) -> tuple[Array, Array]:
    """Return the instants (P,) s of plans and their lines (P, arms, K, 3) m, none where there are none."""
    if "planned" not in document:
        return np.zeros(0), np.zeros((0, arms, 0, 3))
    lines = np.frombuffer(base64.b64decode(document["planned"]["points"]), "<f4").astype(np.float64)
    return times(document["planned"]), lines.reshape(-1, arms, document["planned"]["size"], 3)


def frames(run: Any, scene: Scene) -> list[LiveFrame]:
    """Return the instants of a scene as a graph would publish them."""
    ticks = np.searchsorted(run.tick_ns, scene.stamp_ns)
    return [
        LiveFrame(
            stamp_ns=int(stamp_ns),
            joint_names=run.joint_names,
            joint_position=run.joint_position[tick],
            base_in_world=run.base_pose[tick],
            deputy_in_world=scene.deputy_in_world[row],
            target_in_world={arm: poses[row] for arm, poses in scene.target_in_world.items()},
        )
        for row, (stamp_ns, tick) in enumerate(zip(scene.stamp_ns, ticks, strict=True))
    ]


def play(live: LiveScene, run: Any, scene: Scene, rows: slice = slice(None)) -> None:
    """Add some instants of a run to a live scene, with its phases, and its plans of these instants."""
    for frame in frames(run, scene)[rows]:
        phase = [phase for phase in scene.phases if phase.stamp_ns <= frame.stamp_ns][-1]
        live.set_phase(replace(phase, stamp_ns=frame.stamp_ns))
        for paths in run.planned_paths:
            if paths.stamp_ns == frame.stamp_ns:
                live.add_paths(paths)
        live.add(frame)
