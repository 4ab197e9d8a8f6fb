"""Campaign file: which scenarios run under which laws with which draws, and what is made of them."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from reprlib import repr as shortened
from types import MappingProxyType
from typing import Any

from sms_handover.campaign.definition.distributions import (
    Choice,
    Correlated,
    Distribution,
    Integers,
    Normal,
    Truncated,
    Uniform,
    correlated,
)
from sms_handover.campaign.definition.fields import (
    CAMPAIGN_FIELDS,
    COUNTED,
    DATA,
    EXTENDABLE,
    LIST,
    MOST_CASES,
    NONE,
    RANDOM,
)
from sms_handover.campaign.definition.sampler import Sampler, cases_of, read_sampler
from sms_handover.campaign.definition.success_expression import SuccessExpression, success_expression
from sms_handover.campaign.definition.value_targets import paths_of, set_twice
from sms_handover.campaign.definition.values import read_values, require_allowed, require_settable
from sms_handover.configuration.sections import Section
from sms_handover.control.registry import law_names, require_law
from sms_handover.errors import ConfigurationError

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,63}")
_NAME_IN_WORDS = "must be 1 to 64 letters, digits, _ or -, not beginning with -"
_LAW = re.compile(r"\w[\w.-]*")  # one that can be part of a file name and an argument of a command


@dataclass(frozen=True)
class ScenarioChoice:
    """A scenario of a campaign: its source, a name or a file, and values on top."""

    source: str
    values: Mapping[str, object]


@dataclass(frozen=True)
class StopRule:
    """Stop when Wilson's interval is narrow enough; looked at after fixed numbers of cases only."""

    half_width: float
    looks: tuple[int, ...]


@dataclass(frozen=True)
class Limits:
    """Limits of a case: ticks of its run (0: none), wall time s, memory MB, and tries after a death."""

    ticks: int = 0
    wall_time: float = 600.0  # s
    memory: float = 4000.0  # MB
    retries: int = 1


@dataclass(frozen=True)
class Keep:
    """What is kept beyond rows: trajectories of no, failed or all cases, and so many worst ones whole."""

    trajectories: str = NONE
    worst: int = 0
    worst_as: str = DATA


@dataclass(frozen=True, eq=False)
class Campaign:
    """A campaign as its file says it; ``cases`` is None where neither file nor caller gives their number."""

    name: str
    description: str
    seed: int
    cases: int | None
    sampler: Sampler
    scenarios: Mapping[str, ScenarioChoice]
    laws: tuple[str, ...]
    values: Mapping[str, object]
    draws: Mapping[str, Distribution]
    groups: tuple[Correlated, ...]
    success: SuccessExpression
    metrics: tuple[str, ...]
    worst_by: str
    stop: StopRule | None
    keep: Keep
    limits: Limits

    @property
    def paths(self) -> tuple[str, ...]:
        """The dotted paths of all that varies from case to case."""
        listed = tuple(self.sampler.rows[0]) if self.sampler.rows else ()
        return (*self.draws, *(path for group in self.groups for path in group.normals), *listed)

    @property
    def runs_per_case(self) -> int:
        """The number of runs that share the draws of a case."""
        return len(self.scenarios) * len(self.laws)


def read_campaign(path: Path, cases: int | None = None) -> Campaign:
    """Return the campaign in a file, with another number of ``cases`` if given.

    Raises ConfigurationError with file and line of what is wrong.
    """
    root = Section.read(path, spec=CAMPAIGN_FIELDS)
    name = root.text("name")
    if not _NAME.fullmatch(name):
        raise root.error(f"name is {name!r}, {_NAME_IN_WORDS}", "name")
    sampler = read_sampler(root, path.parent)
    if "cases" in root and sampler.kind not in COUNTED:
        raise root.error(f"sampler {sampler.kind} has its own number of cases: leave cases out", "cases")
    if cases is not None and sampler.kind not in EXTENDABLE:
        raise ConfigurationError(
            f"{path}: sampler {sampler.kind} has a fixed number of cases; {' and '.join(EXTENDABLE)} have not"
        )
    if cases is None and "cases" in root:
        cases = int(root.number("cases"))
    draws = _draws(root)
    groups = _groups(root)
    _require_apart(root, draws, groups, sampler)
    if sampler.kind not in COUNTED and (count := cases_of(sampler, list(draws.values()))) > MOST_CASES:
        raise root.error(f"sampler {sampler.kind} has {count} cases, must be <= {MOST_CASES}", "sampler")
    scenarios, laws, values = _scenarios(root), _laws(root), read_values(root)
    _require_different(root, scenarios, laws)
    _require_once(root, sampler, values, scenarios)
    with root.located("success"):
        success = success_expression(root.text("success") if "success" in root else "complete")
    return Campaign(
        name=name,
        description=root.text("description") if "description" in root else "",
        seed=int(root.number("seed")),
        cases=cases,
        sampler=sampler,
        scenarios=MappingProxyType(scenarios),
        laws=laws,
        values=MappingProxyType(values),
        draws=MappingProxyType(draws),
        groups=groups,
        success=success,
        metrics=_texts(root, "metrics"),
        worst_by=root.text("worst_by") if "worst_by" in root else "grasp_error",
        stop=_stop(root, sampler.kind),
        keep=_keep(root),
        limits=_limits(root),
    )


def _scenarios(root: Section) -> dict[str, ScenarioChoice]:
    """Return the scenarios by their names in the campaign."""
    section = root.section("scenarios")
    found = {}
    for name in section.keys:
        if not _NAME.fullmatch(name):
            raise section.error(f"scenario name {name!r} {_NAME_IN_WORDS}", name)
        if isinstance(section.value(name), str):
            found[name] = ScenarioChoice(section.text(name), MappingProxyType({}))
        else:
            inner = section.section(name)
            found[name] = ScenarioChoice(inner.text("scenario"), MappingProxyType(read_values(inner)))
    if not found:
        raise root.error("scenarios is empty, must have at least one", "scenarios")
    return found


def _laws(root: Section) -> tuple[str, ...]:
    """Return the control laws, each once."""
    laws = _texts(root, "laws")
    for law in laws:
        if not _LAW.fullmatch(law):
            raise root.error(
                f"law {law!r} cannot be in a campaign, which names files by it: its name must be letters, "
                "digits, _, . or -, beginning with a letter, a digit or _",
                "laws",
            )
        require_law(law, f"{root.where('laws')}: laws")
    if not laws or len(set(laws)) < len(laws):
        known = ", ".join(law_names())
        raise root.error(f"laws is {list(laws)}, must be one or more of {known}, each once", "laws")
    return laws


def _require_different(root: Section, scenarios: Iterable[str], laws: Sequence[str]) -> None:
    """Reject scenarios and laws whose names, joined as those of files are, are the same."""
    seen: dict[str, tuple[str, str]] = {}
    for pair in product(scenarios, laws):
        other = seen.setdefault("_".join(pair), pair)
        if other != pair:
            raise root.error(
                f"scenario {pair[0]!r} with law {pair[1]!r} would have the files of scenario {other[0]!r} "
                f"with law {other[1]!r}: rename a scenario",
                "scenarios",
            )


def _texts(root: Section, key: str) -> tuple[str, ...]:
    """Return the texts of a key, none if it is not given."""
    value = root.value(key) if key in root else []
    if not isinstance(value, list) or not all(isinstance(item, str) and item for item in value):
        raise root.error(f"{root.path(key)} is {shortened(value)}, must be a list of texts", key)
    return tuple(value)


def _draws(root: Section) -> dict[str, Distribution]:
    """Return the distribution of every drawn value."""
    if "draws" not in root:
        return {}
    section = root.section("draws")
    for path in section.keys:
        with section.located(path):
            require_settable(path)
    return {path: _distribution(section.section(path), path) for path in section.keys}


def _distribution(section: Section, path: str) -> Distribution:
    """Return how one value is drawn."""
    kind = section.one_of(path)
    inner = section.section(kind)
    with inner.located():
        if kind == "normal":
            return Normal(inner.number("mean"), inner.number("std"))
        if kind == "truncated":
            mean, std, low, high = (inner.number(key) for key in ("mean", "std", "low", "high"))
            return Truncated(mean, std, low, high)
        if kind == "uniform":
            return Uniform(inner.number("low"), inner.number("high"))
        if kind == "integers":
            return Integers(int(inner.number("low")), int(inner.number("high")))
        return _choice(inner, path)


def _choice(section: Section, path: str) -> Choice:
    """Return a choice of plain values."""
    values = section.value("values")
    if not isinstance(values, list) or not all(isinstance(item, bool | int | float | str) for item in values):
        raise section.error(
            f"{section.path('values')} is {shortened(values)}, must be a list of numbers, texts or true and "
            "false",
            "values",
        )
    for value in values:
        with section.located("values"):
            require_allowed(path, value)
    weights = section.vector("weights", missing=(1.0,) * len(values))
    return Choice(tuple(values), weights)


def _groups(root: Section) -> tuple[Correlated, ...]:
    """Return the groups of draws that depend on each other."""
    if "correlated" not in root:
        return ()
    found = []
    for section in root.sections("correlated"):
        draws = section.section("draws")
        for path in draws.keys:
            with draws.located(path):
                require_settable(path)
        each = {path: draws.section(path) for path in draws.keys}
        normals = {path: Normal(one.number("mean"), one.number("std")) for path, one in each.items()}
        with section.located("correlation"):
            found.append(correlated(normals, section.value("correlation")))
    return tuple(found)


def _require_apart(
    root: Section, draws: Mapping[str, Any], groups: tuple[Correlated, ...], sampler: Sampler
) -> None:
    """Reject draws beside a table that has the values already, and those that a sampler cannot take."""
    if sampler.kind == LIST and (draws or groups):
        raise root.error("sampler list has all values in its file: leave draws and correlated out", "sampler")
    if sampler.kind not in (RANDOM, LIST) and not (draws or groups):
        raise root.error(f"sampler {sampler.kind} needs draws", "sampler")
    if sampler.kind not in (RANDOM, *COUNTED, LIST) and groups:
        raise root.error(f"sampler {sampler.kind} needs independent draws: leave correlated out", "sampler")


def _require_once(
    root: Section, sampler: Sampler, values: Mapping[str, object], scenarios: Mapping[str, ScenarioChoice]
) -> None:
    """Reject a drawn value that another draw, or one of the values, sets too."""
    drawn: list[tuple[str, str]] = []  # path and place
    if "draws" in root:
        drawn += [(path, root.section("draws").where(path)) for path in root.section("draws").keys]
    if "correlated" in root:
        for section in root.sections("correlated"):
            drawn += [(path, section.section("draws").where(path)) for path in section.section("draws").keys]
    if sampler.rows:
        drawn += [(path, f"{root.where('sampler')}: column {path}") for path in sampler.rows[0]]
    fixed = [
        path for given in (values, *(one.values for one in scenarios.values())) for path in paths_of(given)
    ]
    for path, other in set_twice([path for path, _ in drawn], fixed):
        place = [place for one, place in drawn if one == path][-1]
        by = "among values" if other in fixed else "drawn"
        raise ConfigurationError(f"{place}: {path} is set twice: {other} is {by} too; leave one out")


def _stop(root: Section, kind: str) -> StopRule | None:
    """Return when to stop early, which takes a sampler whose first cases are a sample of all."""
    if "stop" not in root:
        return None
    if kind not in EXTENDABLE:
        raise root.error(
            f"stop is for the samplers {' and '.join(EXTENDABLE)}, not for {kind}, whose first cases are no "
            "sample of all: leave stop out",
            "stop",
        )
    section = root.section("stop")
    numbers = section.vector("looks")
    looks = tuple(int(look) for look in numbers)
    if list(numbers) != sorted(set(looks)) or not looks:
        told = shortened([f"{number:g}" for number in numbers]).replace("'", "")
        raise section.error(f"{section.path('looks')} is {told}, must be whole numbers that rise", "looks")
    return StopRule(section.number("half_width"), looks)


def _keep(root: Section) -> Keep:
    """Return what is kept beyond rows."""
    if "keep" not in root:
        return Keep()
    section = root.section("keep")
    given: dict[str, Any] = {}
    for key in ("trajectories", "worst_as"):
        if key in section:
            known = CAMPAIGN_FIELDS.optional["keep"].optional[key].choices  # type: ignore[union-attr]
            given[key] = section.name(key, "choice", known)
    if "worst" in section:
        given["worst"] = int(section.number("worst"))
    keep = Keep(**given)
    if "worst_as" in section and not keep.worst:
        raise section.error("keep.worst_as is for the cases of keep.worst, which is 0: give it", "worst_as")
    return keep


def _limits(root: Section) -> Limits:
    """Return the limits of a case."""
    if "limits" not in root:
        return Limits()
    section = root.section("limits")
    given: dict[str, Any] = {
        **{key: int(section.number(key)) for key in ("ticks", "retries") if key in section},
        **{key: section.number(key) for key in ("wall_time", "memory") if key in section},
    }
    return Limits(**given)
