"""Metadata of a bag as rosbag2 keeps it in ``metadata.yaml`` and inside the file, version 9."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from sms_handover.configuration.yaml_reader import load, read_text
from sms_handover.errors import BagError

METADATA_FILE = "metadata.yaml"
ROSBAG2_KEY = "rosbag2_bagfile_information"
ROSBAG2_RECORD = "rosbag2"  # name of the metadata record with the same text
LARGEST_METADATA = 2**22  # [byte] some 4000 topics, or 20 000 files of a split bag
_VERSION = 9
_ROS_DISTRO = "jazzy"


@dataclass(frozen=True)
class TopicCount:
    """A topic of a bag with its number of messages; ``qos`` are profiles as rosbag2 writes them."""

    name: str
    type: str
    encoding: str
    type_hash: str
    qos: Sequence[Mapping[str, object]]
    message_count: int


@dataclass(frozen=True)
class FileSpan:
    """A file of a bag: first and last log time, 0 without messages, and number of messages."""

    name: str
    start_ns: int
    end_ns: int
    message_count: int


def bag_information(files: Sequence[FileSpan], topics: Sequence[TopicCount]) -> dict[str, Any]:
    """Return the body of the metadata for a bag of these MCAP files."""
    filled = [file for file in files if file.message_count]
    start_ns = min((file.start_ns for file in filled), default=0)
    end_ns = max((file.end_ns for file in filled), default=0)
    return {
        "version": _VERSION,
        "storage_identifier": "mcap",
        **_span(start_ns, end_ns, sum(topic.message_count for topic in topics)),
        "topics_with_message_count": [_topic_information(topic) for topic in topics],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [
            {"path": file.name, **_span(file.start_ns, file.end_ns, file.message_count)} for file in files
        ],
        "custom_data": None,
        "ros_distro": _ROS_DISTRO,
    }


def metadata_of(bag: Path) -> dict[str, Any] | None:
    """Return the body of the ``metadata.yaml`` in a folder, None without one; raises BagError."""
    file = bag / METADATA_FILE
    if not file.is_file():
        return None
    try:
        body = load(read_text(file, LARGEST_METADATA), LARGEST_METADATA)[ROSBAG2_KEY]
        return dict(body)
    except (OSError, UnicodeDecodeError, yaml.YAMLError, LookupError, TypeError, ValueError) as error:
        raise BagError(f"{file} is not readable: {' '.join(str(error).split())[:200]}") from error


def counts_of(metadata: Mapping[str, Any]) -> dict[str, int]:
    """Return the number of messages by topic from the body of ``metadata.yaml``; raises BagError."""
    counts: dict[str, int] = {}
    try:
        for item in metadata.get("topics_with_message_count") or ():
            name = str(item["topic_metadata"]["name"])
            counts[name] = counts.get(name, 0) + int(item["message_count"])
    except (LookupError, TypeError, ValueError) as error:
        raise BagError(f"{METADATA_FILE} is not readable: its topics are no list of topics") from error
    return counts


@dataclass(frozen=True)
class FileList:
    """The files that ``metadata.yaml`` lists, in its order, and the names of those that are not there.

    ``counts`` are the numbers of messages that it states, by topic.
    """

    files: tuple[Path, ...] = ()
    missing: tuple[str, ...] = ()
    counts: Mapping[str, int] = field(default_factory=dict)


def files_in_metadata(bag: Path) -> FileList:
    """Return the files that the ``metadata.yaml`` in a folder lists, none if it is missing or unreadable.

    Raises BagError on a compression that is not zstd.
    """
    try:
        metadata = metadata_of(bag) or {}
        names = [str(name) for name in metadata.get("relative_file_paths") or ()]
        counts = counts_of(metadata)
    except (BagError, TypeError):
        return FileList()
    mode, form = (str(metadata.get(f"compression_{key}") or "") for key in ("mode", "format"))
    if mode.upper() in {"FILE", "MESSAGE"} and form != "zstd":
        raise BagError(
            f"{bag} is compressed as {form!r}, only zstd is read; 'ros2 bag convert' makes another bag of it"
        )
    found = {name: _listed(bag, name) for name in dict.fromkeys(names)}
    missing = [Path(name).name for name, file in found.items() if file is None]
    return FileList(tuple(file for file in found.values() if file), tuple(missing), counts)


def _listed(bag: Path, name: str) -> Path | None:
    """Return a listed file: by its path in the bag, or as of old rosbag2 versions beside the metadata."""
    for file in (bag / name, bag / Path(name).name):
        if file.exists() and file.resolve().is_relative_to(bag.resolve()):
            return file
    return None


def to_yaml(value: object) -> str:
    """Return YAML text in block style, keys in the order given."""
    return str(yaml.safe_dump(value, sort_keys=False, default_flow_style=False, allow_unicode=True))


def qos_text(profiles: Sequence[Mapping[str, object]]) -> str:
    """Return the YAML list that a channel carries as ``offered_qos_profiles``."""
    return to_yaml([dict(profile) for profile in profiles]).strip() if profiles else ""


def _span(start_ns: int, end_ns: int, message_count: int) -> dict[str, Any]:
    """Return the entries of both a bag and a file; new objects each time, so YAML needs no anchors."""
    return {
        "duration": {"nanoseconds": end_ns - start_ns},
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "message_count": message_count,
    }


def _topic_information(topic: TopicCount) -> dict[str, Any]:
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.type,
            "serialization_format": topic.encoding,
            "offered_qos_profiles": [dict(profile) for profile in topic.qos],
            "type_description_hash": topic.type_hash,
        },
        "message_count": topic.message_count,
    }
