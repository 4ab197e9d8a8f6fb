"""Sampler of a campaign: how its cases are spread, and how many they are."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod
from pathlib import Path
from types import MappingProxyType

from sms_handover.campaign.definition.case_table import read_table
from sms_handover.campaign.definition.distributions import Distribution, Value
from sms_handover.campaign.definition.fields import (
    CAMPAIGN_FIELDS,
    COUNTED,
    GRID,
    LIST,
    MORRIS,
    RANDOM,
)
from sms_handover.configuration.sections import Section


@dataclass(frozen=True)
class Sampler:
    """How cases are spread: the kind, the numbers it takes, and the rows of a table."""

    kind: str
    numbers: Mapping[str, int]
    rows: tuple[Mapping[str, Value], ...] = ()


def read_sampler(root: Section, folder: Path) -> Sampler:
    """Return how cases are spread; raises ConfigurationError."""
    value = root.value("sampler") if "sampler" in root else RANDOM
    if isinstance(value, str):
        return Sampler(root.name("sampler", "sampler", COUNTED) if "sampler" in root else RANDOM, {})
    section = root.section("sampler")
    kind = section.one_of("sampler")
    inner = section.section(kind)
    if kind == LIST:
        with inner.located("file"):
            return Sampler(kind, {}, read_table(folder / inner.text("file")))
    numbers = {key: int(inner.number(key)) for key in inner.keys}
    base, levels = numbers.get("base", 2), numbers.get("levels", 2)
    if base & (base - 1):
        raise inner.error(f"{inner.path('base')} is {base}, must be a power of two", "base")
    if kind == MORRIS and levels % 2:
        raise inner.error(f"{inner.path('levels')} is {levels}, must be even", "levels")
    return Sampler(kind, MappingProxyType(numbers))


def cases_of(sampler: Sampler, draws: Sequence[Distribution]) -> int:
    """Return how many cases a sampler has that has its own number of them."""
    kind, numbers = sampler.kind, sampler.numbers
    if kind == LIST:
        return len(sampler.rows)
    if kind == GRID:
        return prod(len(one.options) or numbers["levels"] for one in draws)
    if kind == MORRIS:
        return numbers["trajectories"] * (len(draws) + 1)
    return numbers["base"] * (len(draws) + 2)


def csv_file_of(path: Path) -> Path | None:
    """Return the table that a campaign file names, None if it names none."""
    root = Section.read(path, spec=CAMPAIGN_FIELDS)
    if "sampler" not in root or isinstance(root.value("sampler"), str):
        return None
    section = root.section("sampler")
    return path.parent / section.section(LIST).text("file") if LIST in section else None
