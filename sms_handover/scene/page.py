"""Page that shows runs in 3D: one self-contained file that also works in a frame of another page."""

import json
import re
from collections.abc import Mapping
from html import escape
from importlib.resources import files

from sms_handover.errors import ConfigurationError
from sms_handover.scene.document import Document, scene_document
from sms_handover.scene.scene import Scene

STREAM = "stream"  # address of the frames of a live page, relative to the page

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
    """Return a page that plays ``scenes``, by the name of each run, beginning at ``start`` (s).

    Of several runs the first is solid and the others are translucent; they can also be shown side by
    side. In a frame the page sends ``{type: "time", t}`` to its parent whenever its time changes, and
    accepts the same message, as well as ``{type: "theme", theme: "light" | "dark"}``. Raises
    ConfigurationError if there is no scene.
    """
    if not scenes:
        raise ConfigurationError("there is no run to show: give at least one")
    return _page(title, {"start": start, "runs": [scene_document(*item) for item in scenes.items()]})


def live_html(*, title: str = "Handover") -> str:
    """Return a page that shows a run live; it gets the frames from the server of the page."""
    return _page(title, {"stream": STREAM})


def _page(title: str, data: Document) -> str:
    folder = files("sms_handover.scene") / "web"
    parts = {name: (folder / file).read_text(encoding="utf-8") for name, file in _PARTS.items()}
    parts["data"] = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    parts["title"] = escape(title)
    page = (folder / "page.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], page)
