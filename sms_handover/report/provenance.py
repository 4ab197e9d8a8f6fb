"""Provenance of recordings side by side: versions, parameters, schedules, and where they differ."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import unified_diff
from hashlib import sha256

from sms_handover.bag.info import BagInfo

NOT_RECORDED = "-"
EVERY_NODE = "every node"

_WHERE_RECORDED = {("recorder", "folder")}  # where the bag was stored, not how the run was made
_START = "start"  # of a run, always different
_HASH_LENGTH = 12  # [characters] of a hash that are shown
_SHARED_BY = 2  # [nodes] smallest number that can share a parameter


@dataclass(frozen=True)
class ComparedValue:
    """One item of the provenance of every run; '-' where a bag lacks it."""

    group: str
    name: str
    values: tuple[str, ...]

    @property
    def differs(self) -> bool:
        """Whether the runs do not all have the same value."""
        return len(set(self.values)) > 1


def compared_versions(infos: Sequence[BagInfo]) -> tuple[ComparedValue, ...]:
    """Return versions, revision, seed, robot description and schedule of every bag, but not its start."""
    records = [
        {**info.provenance, "robot description": _hash(info.urdf_text), "schedule": _hash(info.schedule_text)}
        for info in infos
    ]
    names = dict.fromkeys(name for record in records for name in record if name != _START)
    return tuple(
        ComparedValue("", _readable(name), tuple(record.get(name, NOT_RECORDED) for record in records))
        for name in names
    )


def compared_parameters(infos: Sequence[BagInfo]) -> tuple[ComparedValue, ...]:
    """Return the parameters of all nodes of every bag; those that all nodes share come first, once."""
    runs = [info.parameters for info in infos]
    shared = [_shared(parameters) for parameters in runs]
    common = [name for name in shared[0] if all(name in each for each in shared)] if shared else []
    found = [ComparedValue(EVERY_NODE, name, tuple(_text(each[name]) for each in shared)) for name in common]
    keys = dict.fromkeys((node, name) for run in runs for node, values in run.items() for name in values)
    for node, name in keys:
        if name in common or (node, name) in _WHERE_RECORDED:
            continue
        values = [_text(run[node][name]) if name in run.get(node, {}) else NOT_RECORDED for run in runs]
        found.append(ComparedValue(node, name, tuple(values)))
    return tuple(found)


def schedule_difference(infos: Sequence[BagInfo], names: Sequence[str]) -> str:
    """Return the difference of each later schedule from the first, '' if they are the same."""
    texts = [(info.schedule_text or "").splitlines() for info in infos]
    lines: list[str] = []
    for text, name in zip(texts[1:], names[1:], strict=True):
        lines += unified_diff(texts[0], text, names[0], name, lineterm="")
    return "\n".join(lines)


def _shared(parameters: Mapping[str, Mapping[str, object]]) -> dict[str, object]:
    """Return the parameters that every node has with the same value."""
    nodes = list(parameters.values())
    if len(nodes) < _SHARED_BY:
        return {}
    return {
        name: value
        for name, value in nodes[0].items()
        if all(name in node and node[name] == value for node in nodes)
    }


def _text(value: object) -> str:
    """Return the value of a parameter as in a YAML file."""
    return json.dumps(value, ensure_ascii=False, default=str)


def _hash(text: str | None) -> str:
    """Return a short hash of a text, '-' for None."""
    return NOT_RECORDED if text is None else f"sha256 {sha256(text.encode()).hexdigest()[:_HASH_LENGTH]}"


def _readable(name: str) -> str:
    """Return the name of an item of a provenance record for display."""
    package = name.removeprefix("version.")
    return package if package != name else name.replace("_", " ")
