"""Solids (boxes and cylinders) as flat faces, and their projection by a camera."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise, product
from math import cos, pi, sin
from typing import Literal

import numpy as np

from sms_handover.types import Array

_SIDES = 20  # of a cylinder
_LARGEST = 0.12  # [m] edge of a part of a box's face; only small parts can be sorted by depth
_EDGE_ON = 1e-9  # [-] cosine to the line of sight below which a face is not drawn: rounding would decide
_AMBIENT = 0.55  # [-] brightness of a face in shadow


@dataclass(frozen=True, eq=False)
class Camera:
    """Parallel projection of the world from ``azimuth`` about z, from x to y, and ``elevation``, rad."""

    azimuth: float
    elevation: float

    def axes(self) -> Array:
        """Return as rows the picture's right, its up, and the direction from the world to the camera."""
        ca, sa, ce, se = cos(self.azimuth), sin(self.azimuth), cos(self.elevation), sin(self.elevation)
        return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])

    def seen(self, points: Array) -> Array:
        """Return the projections (..., 2) m of points (..., 3) m."""
        return np.asarray(points @ self.axes()[:2].T)


@dataclass(frozen=True, eq=False)
class Picture:
    """Projected faces, the farthest first: corners (K, 2) m, brightness (F,), and index of the solid."""

    corners: tuple[Array, ...]
    brightness: Array
    solid: tuple[int, ...]


@lru_cache(maxsize=64)
def faces_of(kind: Literal["box", "cylinder"], size: tuple[float, ...]) -> tuple[Array, ...]:
    """Return the faces (corners, 3) m of a solid about its centre, each counter-clockwise from outside."""
    return tuple(_box(size) if kind == "box" else _cylinder(*size))


def picture_of(solids: Sequence[Sequence[Array]], camera: Camera, light: Array) -> Picture:
    """Return the projection of solids, given by their faces in the world; ``light`` points at the sun."""
    view = camera.axes()
    seen: list[tuple[float, Array, float, int]] = []
    for number, faces in enumerate(solids):
        for face in faces:
            normal = np.cross(face[1] - face[0], face[2] - face[1])
            normal /= np.linalg.norm(normal)
            if normal @ view[2] <= _EDGE_ON:
                continue
            lit = max(0.0, float(normal @ light))
            depth = float(face.mean(axis=0) @ view[2])
            seen.append((depth, camera.seen(face), _AMBIENT + (1.0 - _AMBIENT) * lit, number))
    seen.sort(key=lambda item: item[0])
    return Picture(
        tuple(item[1] for item in seen), np.array([item[2] for item in seen]), tuple(i[3] for i in seen)
    )


def _box(size: tuple[float, ...]) -> list[Array]:
    """Return the six faces of a box, the large ones in parts."""
    faces = []
    half = np.array(size) / 2.0
    for normal, sign in product(range(3), (-1.0, 1.0)):
        u, v = (normal + 1) % 3, (normal + 2) % 3
        steps = [
            np.linspace(-half[axis], half[axis], 1 + max(1, round(size[axis] / _LARGEST))) for axis in (u, v)
        ]
        for (a, b), (c, d) in product(*(pairwise(edge) for edge in steps)):
            face = np.zeros((4, 3))
            face[:, normal] = sign * half[normal]
            face[:, u] = (a, b, b, a)
            face[:, v] = (c, c, d, d)
            faces.append(face if sign > 0.0 else face[::-1])
    return faces


def _cylinder(radius: float, length: float) -> list[Array]:
    """Return the sides and the two ends of a cylinder along z."""
    angles = 2.0 * pi * np.arange(_SIDES) / _SIDES
    circle = radius * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(_SIDES)])
    up = np.array([0.0, 0.0, length / 2.0])
    top, bottom = circle + up, circle - up
    after = np.roll(np.arange(_SIDES), -1)
    sides = [np.array([bottom[i], bottom[j], top[j], top[i]]) for i, j in enumerate(after)]
    return [*sides, top, bottom[::-1]]
