"""Table of all cases as a Parquet file: inputs, how each ended, metrics; cost and host at the end."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from sms_handover.campaign.record.durable_file import write_durably
from sms_handover.campaign.record.journal import Entry
from sms_handover.campaign.sampling.designs import needed

TABLE = "cases.parquet"
INPUT, METRIC = "input.", "metric."  # what the names of columns begin with


def write_table(path: Path, entries: Iterable[Entry]) -> int:
    """Write the rows of a campaign in the order of cases; return their number.

    Raises MissingDependencyError without pyarrow, SmsHandoverError where it cannot be written.
    """
    arrow, parquet = needed("pyarrow", "pyarrow"), needed("pyarrow.parquet", "pyarrow")
    rows = sorted(entries, key=lambda entry: entry.row.task)
    names = dict.fromkeys(name for entry in rows for name in entry.row.inputs)
    metrics = dict.fromkeys(name for entry in rows for name in entry.row.metrics)
    columns: dict[str, Any] = {
        "case": arrow.array([entry.row.task.case for entry in rows], arrow.int64()),
        "scenario": arrow.array([entry.row.task.scenario for entry in rows], arrow.string()),
        "law": arrow.array([entry.row.task.law for entry in rows], arrow.string()),
        "seed": arrow.array([entry.row.seed for entry in rows], arrow.int64()),
        **{INPUT + name: _values(arrow, [entry.row.inputs.get(name) for entry in rows]) for name in names},
        "status": arrow.array([entry.row.status.value for entry in rows], arrow.string()),
        "cause": arrow.array([entry.row.cause for entry in rows], arrow.string()),
        "success": arrow.array([entry.row.succeeded for entry in rows], arrow.bool_()),
        "numeric_failure": arrow.array([entry.row.numeric_failure for entry in rows], arrow.bool_()),
        "mission_failure": arrow.array([entry.row.mission_failure for entry in rows], arrow.bool_()),
        **{
            METRIC + name: arrow.array([entry.row.metrics.get(name) for entry in rows], arrow.float64())
            for name in metrics
        },
        "run_digest": arrow.array([entry.row.run_digest for entry in rows], arrow.string()),
        "row_digest": arrow.array([entry.row.digest for entry in rows], arrow.string()),
        "cpu": arrow.array([entry.beside.cpu for entry in rows], arrow.float64()),
        "wall": arrow.array([entry.beside.wall for entry in rows], arrow.float64()),
        "host": arrow.array([entry.beside.host for entry in rows], arrow.string()),
        "solve": arrow.array([entry.beside.solve for entry in rows], arrow.float64()),
        "tries": arrow.array([entry.beside.tries for entry in rows], arrow.int64()),
    }
    table = arrow.BufferOutputStream()
    parquet.write_table(arrow.table(columns), table, compression="zstd")
    write_durably({path: memoryview(table.getvalue())})
    return len(rows)


def _values(arrow: Any, values: list[Any]) -> Any:
    """Return drawn values as a column: numbers, true and false, or texts."""
    given = [value for value in values if value is not None]
    if all(isinstance(value, bool) for value in given):
        return arrow.array(values, arrow.bool_())
    if all(isinstance(value, int) and not isinstance(value, bool) for value in given):
        return arrow.array(values, arrow.int64())
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in given):
        return arrow.array([None if value is None else float(value) for value in values], arrow.float64())
    return arrow.array([None if value is None else str(value) for value in values], arrow.string())
