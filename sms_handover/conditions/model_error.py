"""Model error: a true robot as a draw around the one that is known; every draw is a possible body."""

from dataclasses import dataclass, replace
from math import exp

import numpy as np
import pinocchio as pin

from sms_handover.conditions.random_streams import RandomStreams
from sms_handover.model.assembly import ArmDescription, RobotDescription
from sms_handover.model.parts import Inertia, Origin
from sms_handover.types import Array

_AXES = 3


@dataclass(frozen=True)
class BodySpread:
    """Standard deviations of a body: log mass [-], centre of mass m, log spread of mass per axis [-]."""

    mass: float = 0.0
    com: float = 0.0
    inertia: float = 0.0


@dataclass(frozen=True)
class MountSpread:
    """Standard deviations of the mount of an arm: coordinates m, angles rad."""

    position: float = 0.0
    angle: float = 0.0


@dataclass(frozen=True)
class ModelError:
    """How far a robot is from what is known of it: standard deviations of base, links and mounts."""

    base: BodySpread
    links: BodySpread
    mounts: MountSpread

    @property
    def any(self) -> bool:
        """Whether the robot differs from what is known of it."""
        return (self.base, self.links, self.mounts) != (BodySpread(), BodySpread(), MountSpread())


def with_model_error(robot: RobotDescription, error: ModelError, streams: RandomStreams) -> RobotDescription:
    """Return the robot as a draw around ``robot``: each body and mount from a stream of its own name."""
    arms = tuple(_arm(arm, error, streams) for arm in robot.arms)
    base = replace(robot.base, inertia=drawn_inertia(robot.base.inertia, error.base, streams))
    return replace(robot, base=base, arms=arms)


def drawn_inertia(inertia: Inertia, spread: BodySpread, streams: RandomStreams) -> Inertia:
    """Return the inertia of a body of the same name as a draw: m' = k m, c' = c + d, S' = k T S T.

    S = tr(I)/2 - I is the second moment of mass about the centre of mass, the upper left part of the
    pseudo-inertia [Wensing2018]; it is positive definite for every possible body. log k and d are normal,
    and T is symmetric, T = exp(W) with W normal: on the diagonal with the half of ``spread.inertia``, beside
    it with its half divided by sqrt(2). So S' is positive definite too, and the body possible.
    """
    draw = streams.parameters(f"model_error.{inertia.body}").standard_normal(1 + 2 * _AXES + _AXES)
    factor = exp(spread.mass * float(draw[0]))
    com = tuple(float(c + spread.com * d) for c, d in zip(inertia.com, draw[1:4], strict=True))
    moments = inertia.matrix
    second = 0.5 * np.trace(moments) * np.eye(_AXES) - moments
    stretched = factor * _symmetric_stretch(0.5 * spread.inertia, draw[4:]) @ second
    stretched = stretched @ _symmetric_stretch(0.5 * spread.inertia, draw[4:])
    full = np.trace(stretched) * np.eye(_AXES) - stretched
    six = (full[0, 0], full[0, 1], full[0, 2], full[1, 1], full[1, 2], full[2, 2])
    return Inertia(inertia.body, factor * inertia.mass, com, tuple(map(float, six)))


def _symmetric_stretch(sigma: float, draw: Array) -> Array:
    """Return exp(W) (3, 3) of six standard normal numbers."""
    xx, yy, zz, xy, xz, yz = draw
    aside = np.array([[0.0, xy, xz], [xy, 0.0, yz], [xz, yz, 0.0]]) / np.sqrt(2.0)
    values, vectors = np.linalg.eigh(sigma * (np.diag([xx, yy, zz]) + aside))
    result: Array = (vectors * np.exp(values)) @ vectors.T
    return result


def _arm(arm: ArmDescription, error: ModelError, streams: RandomStreams) -> ArmDescription:
    """Return an arm with its links and its mount drawn."""
    links = tuple(
        replace(link, inertia=drawn_inertia(link.inertia, error.links, streams)) for link in arm.links
    )
    draw = streams.parameters(f"model_error.{arm.name}.mount").standard_normal(2 * _AXES)
    return replace(arm, links=links, mount=_mount(arm.mount, error.mounts, draw))


def _mount(mount: Origin, spread: MountSpread, draw: Array) -> Origin:
    """Return a mount with errors of place and direction; without an error of one, that stays bit for bit."""
    place = tuple(float(x + spread.position * d) for x, d in zip(mount.xyz, draw[:3], strict=True))
    if not spread.angle:
        return Origin(place, mount.rpy)
    turned = pin.rpy.rpyToMatrix(np.array(mount.rpy)) @ pin.exp3(spread.angle * draw[3:])
    return Origin(place, tuple(map(float, pin.rpy.matrixToRpy(turned))))
