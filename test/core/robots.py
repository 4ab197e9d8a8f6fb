"""Robots for tests that must not pass by a coincidence of the shipped one."""

from dataclasses import replace

import numpy as np

from sms_handover.model.assembly import ArmDescription, RobotDescription
from sms_handover.model.parts import Inertia, JointDescription, Origin


def someone_else(description: RobotDescription, seed: int) -> RobotDescription:
    """Return a robot of the same build with every number changed, so that no coincidence passes.

    Its bodies are heaps of random points (so their inertias are physical), its axes point anywhere,
    its frames are turned about all axes, its motors have rotors.
    """
    random = np.random.default_rng(seed)

    def numbers(size: int) -> tuple[float, ...]:
        return tuple(random.uniform(-1.0, 1.0, size).tolist())

    def inertia(old: Inertia) -> Inertia:
        points = random.normal(size=(10, 3)) * 0.2
        points -= points.mean(axis=0)
        mass = old.mass * float(random.uniform(0.5, 2.0))
        spread = mass / 10.0 * points.T @ points
        full = np.trace(spread) * np.eye(3) - spread
        moments = (full[0, 0], full[0, 1], full[0, 2], full[1, 1], full[1, 2], full[2, 2])
        return Inertia(old.body, mass, tuple(0.1 * x for x in numbers(3)), tuple(map(float, moments)))

    def origin(old: Origin) -> Origin:
        return Origin(tuple(x + 0.1 * y for x, y in zip(old.xyz, numbers(3), strict=True)), numbers(3))

    def joint(old: JointDescription) -> JointDescription:
        axis = random.normal(size=3)
        axis /= np.linalg.norm(axis)
        rotor = float(random.uniform(0.1, 0.4))
        return replace(old, origin=origin(old.origin), axis=tuple(axis.tolist()), rotor_inertia=rotor)

    def arm(old: ArmDescription) -> ArmDescription:
        return replace(
            old,
            mount=origin(old.mount),
            joints=tuple(joint(item) for item in old.joints),
            links=tuple(replace(item, inertia=inertia(item.inertia)) for item in old.links),
            flange=origin(old.flange),
        )

    base = replace(description.base, inertia=inertia(description.base.inertia))
    return replace(description, base=base, arms=tuple(arm(item) for item in description.arms))
