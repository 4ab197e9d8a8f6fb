"""Values of a campaign by dotted path: which ones it sets itself, and which ones would name a file unseen."""

from collections.abc import Mapping
from types import MappingProxyType

from sms_handover.configuration.sections import Section
from sms_handover.configuration.values import DOCUMENTS, ROLES
from sms_handover.errors import ConfigurationError

_SET: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("seed", "common.seed"), "'seed' of the campaign, from which those of runs follow"),
        **dict.fromkeys(("law", "controller.law"), "the list 'laws' of the campaign"),
        "common.scenario": "'scenarios' of the campaign",
        "common.values": "each of them by its own path",
    }
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
            found[path] = one
    return found


def require_settable(path: str, what: str = "") -> None:
    """Raise ConfigurationError on the path of a value that a campaign sets itself."""
    if path in _SET:
        raise ConfigurationError(f"{what or path} is set by the campaign itself: give {_SET[path]}")


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
