"""Specification of the fields of YAML files and parameter groups: what each may hold, said in one place.

The readers check with it, ``list paths`` prints it, and the JSON Schemas for editors are made from it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf
from reprlib import repr as shortened
from typing import Any, get_args

from sms_handover.configuration.checks import check_number, check_vector
from sms_handover.errors import ConfigurationError, UnknownNameError

FLOATS, TEXTS = tuple[float, ...], tuple[str, ...]


@dataclass(frozen=True)
class ValueSpec:
    """Meaning, unit and allowed values of one value; bounds hold for each number of a list.

    ``kind`` is its type: float, int, bool, str, ``FLOATS``, ``TEXTS``, or object for any value; ``size`` is
    the number of entries of a list, any number if None. ``minimum`` and ``maximum`` are inclusive.
    """

    description: str
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    above: float | None = None
    kind: Any = float
    size: int | None = None

    @property
    def allowed(self) -> str:
        """The allowed values in words; '' if every value of the type is."""
        bounds = (("above", self.above), ("at least", self.minimum), ("at most", self.maximum))
        said = [f"{words} {bound:.15g}" for words, bound in bounds if bound is not None]
        count = [] if self.size is None else [f"{self.size} numbers"]
        return " | ".join(self.choices) or ", ".join(count + said)

    def check(self, value: object, what: str, error: type[ConfigurationError] = ConfigurationError) -> Any:
        """Return a value as its kind; a list gives a tuple, an integer is accepted as a float.

        Raises ``error``, and UnknownNameError on text that is none of the choices.
        """
        above = -inf if self.above is None else self.above
        if self.size is not None:
            return check_vector(value, self.size, what, self.unit, above=above, error=error)
        if self.kind in (FLOATS, TEXTS):
            if not isinstance(value, list | tuple):
                raise error(f"{what} is {shortened(value)}, must be a list")
            of_items = replace(self, kind=get_args(self.kind)[0])
            return tuple(of_items.check(item, what, error) for item in value)
        if self.kind is bool or self.kind is str:
            if not isinstance(value, self.kind):
                allowed = "text" if self.kind is str else "true or false"
                raise error(f"{what} is {shortened(value)}, must be {allowed}")
            if self.choices and value not in self.choices:
                raise UnknownNameError("value", str(value), self.choices, what)
            return value
        low = -inf if self.minimum is None else self.minimum
        high = inf if self.maximum is None else self.maximum
        whole = self.kind is int
        return check_number(
            value, what, self.unit, minimum=low, maximum=high, above=above, whole=whole, error=error
        )


@dataclass(frozen=True)
class MappingSpec:
    """A mapping with known keys; of the optional ones in ``one_of`` it has exactly one."""

    description: str
    required: Mapping[str, "Spec"] = field(default_factory=dict)
    optional: Mapping[str, "Spec"] = field(default_factory=dict)
    one_of: tuple[str, ...] = ()

    @property
    def fields(self) -> dict[str, "Spec"]:
        """The specifications of all keys."""
        return {**self.required, **self.optional}


@dataclass(frozen=True)
class NamedSpec:
    """A mapping from names, such as those of the arms, to values of one kind."""

    description: str
    each: "Spec"


@dataclass(frozen=True)
class ListSpec:
    """A list of mappings, which are addressed by their ``name`` where they have one."""

    description: str
    each: MappingSpec
    shortest: int = 0


@dataclass(frozen=True)
class EitherSpec:
    """One of a few words, or something else."""

    words: ValueSpec
    other: ValueSpec | MappingSpec


Spec = ValueSpec | MappingSpec | NamedSpec | ListSpec | EitherSpec


def vector(size: int, description: str, unit: str = "", *, above: float | None = None) -> ValueSpec:
    """Return the specification of a list of ``size`` numbers."""
    return ValueSpec(description, unit, above=above, kind=FLOATS, size=size)


def text(description: str, choices: tuple[str, ...] = ()) -> ValueSpec:
    """Return the specification of a text."""
    return ValueSpec(description, choices=choices, kind=str)
