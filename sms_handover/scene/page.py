"""A page that shows runs in 3D: one file that needs no network and can stand in a frame of another page."""

import json
import re
from collections.abc import Mapping
from html import escape
from importlib.resources import files

from sms_handover.errors import ConfigurationError
from sms_handover.scene.document import Document, scene_document
from sms_handover.scene.scene import Scene

STREAM = "stream"  # relative to the page: where a live one gets its frames

_PARTS = {
    "style": "page.css",
    "licence": "three.LICENSE.txt",
    "three": "three.min.js",
    "body": "body.js",
    "picture": "picture.js",
    "player": "player.js",
    "start": "start.js",
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
    return _page(title, {"start": start, "runs": [scene_document(*item) for item in scenes.items()]})


def live_html(*, title: str = "Handover") -> str:
    """Return a page that shows a run while it goes on; it gets the frames from where it came from."""
    return _page(title, {"stream": STREAM})


def _page(title: str, data: Document) -> str:
    """Put the parts of the page together."""
    folder = files("sms_handover.scene") / "web"
    parts = {name: (folder / file).read_text(encoding="utf-8") for name, file in _PARTS.items()}
    parts["data"] = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    parts["title"] = escape(title)
    page = (folder / "page.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], page)
