"""What the layouts for other people's tools name, and how these tools would look it up in a bag."""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from sms_handover.bag.files import files_of
from sms_handover.configuration.package_files import config_file

FOXGLOVE = config_file("layouts/foxglove.json")
PLOTJUGGLER = config_file("layouts/plotjuggler.xml")

_STEP = re.compile(r"([A-Za-z_]\w*)(?:\[(\d+)\])?")
_ANGLES = ("roll", "pitch", "yaw")  # PlotJuggler adds these to every quaternion
_POSED = ("geometry_msgs/msg/PoseStamped", "nav_msgs/msg/Odometry")

Messages = Mapping[str, tuple[str, Any]]  # by topic: type and last message


def last_messages(bag: Path) -> Messages:
    """Return the last message of every topic in a bag, as a library decodes it that knows nothing of us."""
    found: dict[str, tuple[str, Any]] = {}
    for file in files_of(bag).files:
        with file.open("rb") as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            for schema, channel, _, message in reader.iter_decoded_messages():
                found[channel.topic] = (schema.name if schema else "", message)
    return found


def foxglove_layout() -> Any:
    """Return the layout for Foxglove."""
    return json.loads(FOXGLOVE.read_text(encoding="utf-8"))


def foxglove_paths() -> Iterator[tuple[str, str]]:
    """Yield every message path of the layout for Foxglove, with its label."""
    for config in foxglove_layout()["configById"].values():
        yield from ((path["value"], path["label"]) for path in config.get("paths", ()))


def foxglove_value(path: str, messages: Messages) -> Any:
    """Return what a path like ``/topic/name.field[2].x`` leads to; LookupError if nowhere."""
    topic, *steps = path.split(".")
    _, value = messages[topic]
    for step in steps:
        parts = _STEP.fullmatch(step)
        if parts is None or not hasattr(value, parts[1]):
            raise LookupError(f"{path}: {step} is no field of {type(value).__name__}")
        value = getattr(value, parts[1])
        if parts[2] is not None:
            value = value[int(parts[2])]
    return value


def plotjuggler_curves() -> list[str]:
    """Return the name of every curve of the layout for PlotJuggler."""
    return [curve.attrib["name"] for curve in ET.parse(PLOTJUGGLER).iter("curve")]


def plotjuggler_value(name: str, messages: Messages) -> float:
    """Return the last value of a series by the names that PlotJuggler 3.16 gives; raises LookupError.

    A joint state becomes ``topic/joint/field``, everything else ``topic/field/field``; a quaternion gets
    roll, pitch and yaw besides its own four.
    """
    topic = max((t for t in messages if name.startswith(f"{t}/")), key=len, default="")
    if not topic:
        raise LookupError(f"{name}: no such topic")
    kind, value = messages[topic]
    *steps, last = name.removeprefix(f"{topic}/").split("/")
    if kind == "sensor_msgs/msg/JointState":
        (joint,) = steps
        if joint not in value.name:
            raise LookupError(f"{name}: no joint {joint}")
        return float(getattr(value, last)[value.name.index(joint)])
    for step in [*steps, last]:
        if step == last in _ANGLES and kind in _POSED and hasattr(value, "w"):
            return 0.0
        if not hasattr(value, step):
            raise LookupError(f"{name}: {step} is no field of {type(value).__name__}")
        value = getattr(value, step)
    return float(value)
