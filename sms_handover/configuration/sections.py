"""Sections of a YAML file: typed access to keys; each error names file, line, path and what is allowed."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from reprlib import repr as shortened
from typing import Any

from sms_handover.configuration.field_specification import (
    EitherSpec,
    ListSpec,
    MappingSpec,
    NamedSpec,
    Spec,
    ValueSpec,
)
from sms_handover.configuration.yaml_reader import Mapping, read_yaml
from sms_handover.errors import ConfigurationError, UnknownNameError


class Section:
    """A mapping of a YAML file; ``kind`` is the error that its getters raise.

    With a specification of its fields, unknown and missing keys are rejected at once, and each getter
    checks the value of its key as specified.
    """

    def __init__(
        self,
        values: Mapping,
        file: Path,
        kind: type[ConfigurationError] = ConfigurationError,
        path: str = "",
        spec: Spec | None = None,
    ) -> None:
        self._values, self._file, self._kind, self._path = values, values.file or file, kind, path
        self._spec = spec
        for key in values:
            if not isinstance(key, str):
                raise self.error(f"key {key!r} must be text", key)
        if isinstance(spec, MappingSpec):
            self.only(tuple(spec.required), tuple(spec.optional))

    @classmethod
    def read(
        cls, file: Path, kind: type[ConfigurationError] = ConfigurationError, spec: Spec | None = None
    ) -> "Section":
        """Return the top-level mapping of a file; raises ConfigurationError."""
        return cls(read_yaml(file), file, kind, spec=spec)

    def __contains__(self, key: str) -> bool:
        return key in self._values

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys in the order of the file."""
        return tuple(self._values)

    def where(self, key: object = None) -> str:
        """Return file and line of a key, or where else it was set; by default of the section itself.

        A section without a file is where its values were set.
        """
        origins = self._values.origins
        if key in origins:
            return origins[key]
        if origins and self._file == Path():
            return ", ".join(dict.fromkeys(origins.values()))
        return f"{self._file}:{self._values.lines.get(key, self._values.line)}"

    def path(self, key: str) -> str:
        """Return the dotted path of a key."""
        return f"{self._path}.{key}" if self._path else key

    def error(self, text: str, key: object = None) -> ConfigurationError:
        """Return an error at a key, by default at the section itself."""
        return self._kind(f"{self.where(key)}: {text}")

    def unknown(self, what: str, name: str, known: Iterable[str], key: str) -> ConfigurationError:
        """Return the error on an unknown name at a key."""
        where = f"{self.where(key)}: {self._path}" if self._path else self.where(key)
        error = UnknownNameError(what, name, known, where)
        return error if self._kind is ConfigurationError else self._kind(str(error))

    @contextmanager
    def located(self, key: str | None = None) -> Iterator[None]:
        """Put file and line of a key before an error raised inside that has no place yet."""
        try:
            yield
        except self._kind as error:
            if str(error).startswith((f"{self._file}:", f"{self.where(key)}:")):
                raise
            raise self.error(str(error), key) from error

    def only(self, required: Sequence[str], optional: Sequence[str] = ()) -> None:
        """Reject unknown keys and missing ones."""
        known = (*required, *optional)
        for key in self.keys:
            if key not in known:
                raise self.unknown("key", key, known, key)
        for key in required:
            self.value(key)

    def value(self, key: str) -> Any:
        """Return the plain value of a key."""
        if key not in self._values:
            raise self.error(f"{self.path(key)} is missing")
        return self._values[key]

    def section(self, key: str) -> "Section":
        """Return the mapping of a key."""
        return self._mapping(self.value(key), key, self.path(key), self._field(key))

    def sections(self, key: str) -> list["Section"]:
        """Return the mappings in the list of a key; each has its name, or its index, in its path."""
        values, spec = self.value(key), self._field(key)
        if not isinstance(values, list):
            raise self._refusal(key, "a list")
        if isinstance(spec, ListSpec) and len(values) < spec.shortest:
            raise self.error(f"{self.path(key)} has {len(values)} entries, must be >= {spec.shortest}", key)
        each = spec.each if isinstance(spec, ListSpec) else None
        found = []
        for index, item in enumerate(values):
            name = item.get("name") if isinstance(item, Mapping) else None
            place = f".{name}" if isinstance(name, str) and name else f"[{index}]"
            found.append(self._mapping(item, key, self.path(key) + place, each))
        return found

    def text(self, key: str) -> str:
        """Return the text of a key, which is not empty."""
        value = self.value(key)
        if not isinstance(value, str) or not value:
            raise self._refusal(key, "text")
        return value

    def name(self, key: str, kind: str, known: Iterable[str]) -> str:
        """Return the text of a key, which is one of the known names of a kind."""
        name = self.text(key)
        if name not in known:
            raise self.unknown(kind, name, known, key)
        return name

    def number(self, key: str, missing: float | None = None) -> float:
        """Return the number of a key, as its specification allows; ``missing`` if the key is not given."""
        return missing if missing is not None and key not in self else float(self._checked(key))

    def word(self, key: str) -> Any:
        """Return the value of a key that may have a word, or one number, in place of something else."""
        spec = self._spec.fields[key] if isinstance(self._spec, MappingSpec) else None
        if not isinstance(spec, EitherSpec):
            raise TypeError(f"{self.path(key)} is not specified as one of two")
        return spec.words.check(self.value(key), self._what(key), self._kind)

    def vector(
        self, key: str, size: int | None = None, missing: tuple[float, ...] | None = None
    ) -> tuple[float, ...]:
        """Return the numbers of a key; ``missing`` if it is not given.

        ``size`` is how many there are, where the specification does not say it.
        """
        if missing is not None and key not in self:
            return missing
        numbers: tuple[float, ...] = self._checked(key, size)
        return numbers

    def one_of(self, what: str) -> str:
        """Return which of the keys the mapping has, of which its specification asks for exactly one."""
        known = self._spec.one_of if isinstance(self._spec, MappingSpec) else ()
        given = [key for key in known if key in self]
        if len(given) != 1:
            raise self.error(f"{what} must have exactly one of {', '.join(known)}")
        return given[0]

    def _field(self, key: str) -> Spec | None:
        """Return the specification of a key; of a word or something else, that of something else."""
        spec = self._spec
        found = (
            spec.fields[key]
            if isinstance(spec, MappingSpec)
            else spec.each
            if isinstance(spec, NamedSpec)
            else None
        )
        return found.other if isinstance(found, EitherSpec) else found

    def _checked(self, key: str, size: int | None = None) -> Any:
        """Return the value of a key, checked as specified."""
        spec = self._field(key)
        if not isinstance(spec, ValueSpec):
            raise TypeError(f"{self.path(key)} is not specified as a value")
        spec = spec if size is None else replace(spec, size=size)
        return spec.check(self.value(key), self._what(key), self._kind)

    def _mapping(self, value: object, key: str, path: str, spec: Spec | None) -> "Section":
        """Return a mapping at a key as a section."""
        if not isinstance(value, Mapping):
            raise self.error(f"{path} is {shortened(value)}, must be a mapping", key)
        return Section(value, self._file, self._kind, path, spec)

    def _refusal(self, key: str, allowed: str) -> ConfigurationError:
        """Return the error on a value of the wrong type."""
        return self.error(f"{self.path(key)} is {shortened(self.value(key))}, must be {allowed}", key)

    def _what(self, key: str) -> str:
        """Return file, line and dotted path of a key."""
        return f"{self.where(key)}: {self.path(key)}"
