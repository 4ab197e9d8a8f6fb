"""Columns of the cases of each scenario and law, in the order of cases, for the statistics."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import nan

import numpy as np
import numpy.typing as npt

from sms_handover.campaign.record.journal import Entry
from sms_handover.types import Array

Group = tuple[str, str]  # scenario and law
Numbers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class CaseColumns:
    """The cases (N,) of a scenario under a law: numbers, outcomes, metrics and numeric inputs.

    A metric is NaN where it is not defined, as after a numeric failure; ``solve``, the median wall time of a
    solve in s, where the law makes no plans.
    """

    case: Numbers
    succeeded: Flags
    numeric_failure: Flags
    cpu: Array
    metrics: Mapping[str, Array]
    inputs: Mapping[str, Array]
    solve: Array

    def common(self, other: "CaseColumns") -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """Return the places of the cases that both have, in the one and in the other."""
        _, one, another = np.intersect1d(self.case, other.case, assume_unique=True, return_indices=True)
        return one, another


def columns_of(entries: Iterable[Entry]) -> dict[Group, CaseColumns]:
    """Return the columns of each scenario under each law."""
    groups: dict[Group, list[Entry]] = {}
    for entry in sorted(entries, key=lambda item: item.row.task):
        groups.setdefault(entry.row.task[1:], []).append(entry)
    return {group: _columns(group_entries) for group, group_entries in groups.items()}


def _columns(entries: list[Entry]) -> CaseColumns:
    """Return the columns of some cases."""
    metrics = dict.fromkeys(name for entry in entries for name in entry.row.metrics)
    inputs = dict.fromkeys(name for entry in entries for name in entry.row.inputs)
    columns = {path: [_number(entry.row.inputs.get(path)) for entry in entries] for path in inputs}
    return CaseColumns(
        np.array([entry.row.task.case for entry in entries], dtype=np.int64),
        np.array([entry.row.succeeded for entry in entries], dtype=np.bool_),
        np.array([entry.row.numeric_failure for entry in entries], dtype=np.bool_),
        np.array([entry.beside.cpu for entry in entries]),
        {name: np.array([_number(entry.row.metrics.get(name)) for entry in entries]) for name in metrics},
        {path: np.array(values) for path, values in columns.items() if not all(np.isnan(values))},
        np.array([_number(entry.beside.solve) for entry in entries]),
    )


def _number(value: object) -> float:
    """Return a number, NaN for anything else."""
    return float(value) if isinstance(value, int | float) else nan
