"""Values of a campaign by dotted path: which ones it may set, what they may be, and which name a file."""

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import get_type_hints

from sms_handover.configuration.field_specification import EitherSpec, Spec, ValueSpec
from sms_handover.configuration.parameters import specs_of
from sms_handover.configuration.scenario_file import SHORT
from sms_handover.configuration.sections import Section
from sms_handover.configuration.value_paths import spec_of
from sms_handover.configuration.values import DOCUMENTS, ROLES
from sms_handover.errors import ConfigurationError
from sms_handover.simulation.scenario import ParameterSet

_SET: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("seed", "common.seed"), "'seed' of the campaign, from which those of runs follow"),
        **dict.fromkeys(("law", "controller.law"), "the list 'laws' of the campaign"),
        "common.scenario": "'scenarios' of the campaign",
        "common.values": "each of them by its own path",
    }
)
_OF_GRAPH = tuple(  # parameters of processes and of the graph, of which a case in one process has nothing
    f"common.{name}"
    for name in (
        *("mode", "transport", "spin", "cpu", "priority", "lock_memory"),
        *("autostart", "peers", "external"),
    )
)
_FILES = ("description", "file")  # steps of documents below which a text is the path of a file


def read_values(section: Section) -> dict[str, object]:
    """Return the ``values`` of a section by dotted path, none if it has none.

    A common beginning may be a key of its own, as :func:`~sms_handover.simulation.scenario.load_scenario` has
    it. Raises ConfigurationError on what a campaign sets itself, and on a file that it could not keep.
    """
    if "values" not in section:
        return {}
    values, found = section.section("values"), dict[str, object]()
    for key in values.keys:
        value = values.value(key)
        inner = value if isinstance(value, Mapping) and "." not in key else None
        for path, one in [(key, value)] if inner is None else [(f"{key}.{k}", v) for k, v in inner.items()]:
            if path in found:
                raise values.error(f"{path} is given twice", key)
            with values.located(key):
                require_settable(path)
                _require_no_file(path, one)
                if one is not None:  # which removes what is there
                    require_allowed(path, one)
            found[path] = one
    return found


def require_settable(path: str, what: str = "") -> None:
    """Raise ConfigurationError on a path that a campaign sets itself, or that it has no use for."""
    if path in _SET:
        raise ConfigurationError(f"{what or path} is set by the campaign itself: give {_SET[path]}")
    if path in _OF_GRAPH:
        raise ConfigurationError(
            f"{what or path} has no effect in a campaign, whose cases run without a graph: leave it out"
        )


def require_allowed(path: str, value: object, what: str = "") -> None:
    """Raise ConfigurationError unless a path may have a value, as far as no scenario is needed to know."""
    spec = _spec(path)
    if isinstance(spec, EitherSpec):
        inner = spec.words if isinstance(value, str) else spec.other
        spec = inner if isinstance(inner, ValueSpec) else None
    if isinstance(spec, ValueSpec) and spec.kind is not object:
        spec.check(value, what or path)


@cache
def _spec(path: str) -> Spec | None:
    """Return the specification of the value at a path, None where it depends on scenario or law."""
    first, dot, name = path.partition(".")
    if first in SHORT and not dot:
        first, name = SHORT[first], first
    group = get_type_hints(ParameterSet).get(first)
    return specs_of(group).get(name) if group else spec_of(path)


def _require_no_file(path: str, value: object) -> None:
    """Raise ConfigurationError where a value in a document names a file."""
    first, last = path.partition(".")[0], path.rpartition(".")[2]
    if first not in (*DOCUMENTS, *ROLES):
        return
    if isinstance(value, Mapping):
        for key, inner in value.items():
            _require_no_file(f"{path}.{key}", inner)
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            _require_no_file(f"{path}[{index}]", inner)
    elif last in _FILES and isinstance(value, str):
        raise ConfigurationError(
            f"{path} names the file {value!r}, which a campaign cannot keep: give it in a scenario file"
        )
