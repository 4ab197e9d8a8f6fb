"""Content of a robot file: its YAML with the description files of its arms in their places."""

from collections.abc import Callable
from copy import copy
from functools import cache
from pathlib import Path
from typing import Any

from sms_handover.configuration.yaml_reader import Mapping, read_yaml

_ARMS, _DESCRIPTION = "arms", "description"
_CLEARANCE, _FILE = "clearance", "file"


def read_robot_content(path: Path) -> Mapping:
    """Return the content of a robot file; raises ConfigurationError on a file that cannot be read."""
    return with_arm_descriptions(read_yaml(path), path.parent)


def with_arm_descriptions(content: Mapping, folder: Path) -> Mapping:
    """Return the content of a robot with the arm files that it names read, relative to ``folder``.

    So are the paths of meshes.

    Anything that is not as a robot has it is left to the reader of robots.
    """
    arms, read = content.get(_ARMS), cache(read_yaml)  # arms of one kind name the same file
    result = copy(content)
    if isinstance(arms, list):
        result[_ARMS] = [_described(arm, folder, read) for arm in arms]
    elif isinstance(arms, Mapping):
        named = copy(arms)
        named.update({name: _described(arm, folder, read) for name, arm in arms.items()})
        result[_ARMS] = named
    if isinstance(content.get(_CLEARANCE), Mapping):
        result[_CLEARANCE] = _placed(content[_CLEARANCE], folder)
    return result


def _placed(value: Any, folder: Path) -> Any:
    """Return a part of the section on clearance with the files of meshes as URIs, which hold anywhere."""
    if isinstance(value, list):
        return [_placed(item, folder) for item in value]
    if not isinstance(value, Mapping):
        return value
    result = copy(value)
    for key, item in value.items():
        is_path = key == _FILE and isinstance(item, str) and item and "://" not in item
        result[key] = (folder / item).resolve().as_uri() if is_path else _placed(item, folder)
    return result


def _described(arm: Any, folder: Path, read: Callable[[Path], Mapping]) -> Any:
    """Return an arm with its description file read, if it names one."""
    name = arm.get(_DESCRIPTION) if isinstance(arm, Mapping) else None
    if not isinstance(name, str) or not name:
        return arm
    result = copy(arm)
    result[_DESCRIPTION] = read(folder / name)
    return result
