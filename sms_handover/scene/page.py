"""A page that plays runs in 3D: one file that needs no network and can stand in a frame of another page."""

import base64
import json
import re
from collections.abc import Mapping
from html import escape
from importlib.resources import files

import numpy as np
import numpy.typing as npt

from sms_handover.errors import ConfigurationError
from sms_handover.frames import DEPUTY
from sms_handover.model.poses import pose_row
from sms_handover.scene.scene import Scene
from sms_handover.scene.shapes import Shape
from sms_handover.types import GraspAction, GraspEvent
from sms_handover.units import ns_to_seconds

_PARTS = {
    "style": "page.css",
    "three": "three.min.js",
    "body": "body.js",
    "picture": "picture.js",
    "player": "player.js",
}


def animation_html(scenes: Mapping[str, Scene], *, title: str = "Handover", start: float = 0.0) -> str:
    """Return a page that plays ``scenes``, by the name of each run; it shows ``start`` (s) at first.

    Of several runs the first is solid and the others are translucent over it; they can also be put side
    by side. In a frame the page sends ``{type: "time", t}`` to the page around it whenever its time
    changes, and takes the same message, as well as ``{type: "theme", theme: "light" | "dark"}``.
    Raises ConfigurationError if there is no scene.
    """
    if not scenes:
        raise ConfigurationError("there is no run to show: give at least one")
    data = {"start": start, "runs": [_document(name, scene) for name, scene in scenes.items()]}
    folder = files("sms_handover.scene") / "web"
    page = (folder / "page.html").read_text(encoding="utf-8")
    parts = {name: (folder / file).read_text(encoding="utf-8") for name, file in _PARTS.items()}
    parts["three"] = f"/*\n{(folder / 'three.LICENSE.txt').read_text(encoding='utf-8')}*/\n{parts['three']}"
    parts["data"] = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    parts["title"] = escape(title)
    return re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], page)


def _document(name: str, scene: Scene) -> dict[str, object]:
    """Return a scene as JSON values; the poses of all bodies are one block of single precision."""
    targets = [f"{arm}/target" for arm in scene.arms]
    blocks = [scene.link_in_world, scene.deputy_in_world[:, None]]
    blocks += [scene.target_in_world[arm][:, None] for arm in scene.arms]
    return {
        "name": name,
        "arms": scene.arms,
        "bodies": [*scene.links, DEPUTY, *targets],
        "shapes": [_shape(shape) for shape in scene.shapes],
        "deputy_size": scene.deputy_size.tolist(),
        "times": _base64(scene.stamp_ns / 1e9, "<f8"),
        "poses": _base64(np.concatenate(blocks, axis=1), "<f4"),
        "phases": [{"name": p.name, "start": ns_to_seconds(p.stamp_ns)} for p in scene.phases],
        "events": [{"time": ns_to_seconds(e.stamp_ns), "text": _told(e)} for e in scene.grasp_events],
    }


def _shape(shape: Shape) -> dict[str, object]:
    """Return a shape as JSON values."""
    return {
        "link": shape.link,
        "kind": shape.kind,
        "size": shape.size,
        "pose": pose_row(shape.pose_in_link).tolist(),
        "rgba": [round(part, 6) for part in shape.rgba],
    }


def _told(event: GraspEvent) -> str:
    """Return what came of a grasp command in one line."""
    command = event.command
    what = f"{command.arm} lets go"
    if command.action is not GraspAction.RELEASE:
        what = f"{command.arm} takes {command.grasp_frame}"
    if command.action is GraspAction.TRANSFER:
        what += f" from {command.from_arm}"
    return f"{ns_to_seconds(event.stamp_ns):g} s: {what}: {event.status.value}"


def _base64(values: npt.ArrayLike, kind: str) -> str:
    """Return numbers as base64 of their little-endian bytes."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
