"""Named files of values: conditions, robots and schedules, kept with a campaign as they are at its begin."""

from collections.abc import Iterator, Mapping
from hashlib import sha256
from itertools import count
from pathlib import Path
from types import MappingProxyType
from urllib.parse import unquote, urlsplit

from sms_handover.configuration.conditions_content import condition_names, read_conditions_content
from sms_handover.configuration.documents import as_yaml
from sms_handover.configuration.robot_content import read_robot_content
from sms_handover.configuration.yaml_reader import load_mapping, read_file
from sms_handover.errors import ConfigurationError

_CONDITIONS = "common.conditions"
_FOLDERS: Mapping[str, str] = MappingProxyType(
    {_CONDITIONS: "conditions", "common.robot": "robots", "common.schedule": "schedules"}
)
_SUFFIX, _MESH = ".yaml", "mesh"


def is_file_path(path: str) -> bool:
    """Whether the value at a dotted path is the name of a file."""
    return path in _FOLDERS


def kept(path: str, value: object, folder: Path, files: dict[str, str]) -> object:
    """Return a value, where it names a file as that of a frozen campaign, to which the file is added.

    Paths are relative to ``folder``. Raises ConfigurationError on a file that cannot be read.
    """
    if not is_file_path(path) or not isinstance(value, str) or not value:
        return value
    source = folder / value
    text = _text(path, source)
    for number in count(1):
        suffix = f"_{number}" if number > 1 else ""
        name = f"{_FOLDERS[path]}/{source.stem}{suffix}{_SUFFIX}"
        if files.setdefault(name, text) == text:
            break
    return name


def kept_draw(path: str, value: object, folder: Path, files: dict[str, str]) -> object:
    """Return a value that is drawn as :func:`kept` does; a shipped name stays what rows have."""
    if path == _CONDITIONS and value in condition_names():
        files[f"{_FOLDERS[path]}/{value}{_SUFFIX}"] = _text(path, Path(str(value)))
        return value
    return kept(path, value, folder, files)


def keep_cell(path: str, value: object, files: dict[str, str]) -> None:
    """Add what a cell of a table names to the files of a frozen campaign; raises ConfigurationError."""
    if value and not (path == _CONDITIONS and value in condition_names()):
        raise ConfigurationError(
            f"{path} is {value!r}: a table names no files but shipped conditions, "
            f"{', '.join(condition_names())}; draw others by a choice"
        )
    kept_draw(path, value, Path(), files)


def located(values: Mapping[str, object], folder: Path) -> dict[str, object]:
    """Return values of a frozen campaign that is unpacked below a folder, with the paths of its files."""
    found = dict(values)
    for path, value in values.items():
        if is_file_path(path) and isinstance(value, str) and value:
            file = folder / kept_name(path, value)
            if file.is_file():
                found[path] = str(file)
    return found


def kept_name(path: str, value: str) -> str:
    """Return the name, within a frozen campaign, of the file that one of its values stands for."""
    return value if value.endswith(_SUFFIX) else f"{_FOLDERS[path]}/{value}{_SUFFIX}"


def mesh_digests(files: Mapping[str, str]) -> dict[str, str]:
    """Return SHA-256 of every mesh that frozen scenarios and robots name by a ``file:`` URI, by that URI.

    Meshes stay where they are; that one was changed is another campaign. Raises ConfigurationError on one
    that cannot be read.
    """
    found: dict[str, str] = {}
    for name, text in files.items():
        uris = _meshes(load_mapping(text, Path(name))) if _MESH in text else ()
        for uri in uris:
            path = Path(unquote(urlsplit(uri).path))
            try:
                found[uri] = sha256(path.read_bytes()).hexdigest()
            except OSError as error:
                raise ConfigurationError(f"{name}: cannot read the mesh {path}: {error.strerror}") from error
    return found


def _meshes(value: object) -> Iterator[str]:
    """Yield the URIs of all meshes in the content of a file."""
    items = value.values() if isinstance(value, Mapping) else value if isinstance(value, list) else ()
    for item in items:
        yield from _meshes(item)
    mesh = value.get(_MESH) if isinstance(value, Mapping) else None
    uri = mesh.get("file") if isinstance(mesh, Mapping) else None
    if isinstance(uri, str) and uri.startswith("file:"):
        yield uri


def _text(path: str, source: Path) -> str:
    """Return the content of a file as a text that names no other file; raises ConfigurationError."""
    if path == _CONDITIONS:
        return as_yaml(read_conditions_content(source))
    if _FOLDERS[path] == "robots":
        return as_yaml(read_robot_content(source))
    text = read_file(source)  # the record of a run has a schedule as it was written
    load_mapping(text, source)
    return text
