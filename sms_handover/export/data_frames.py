"""Data frames of a run, for pandas: the tables that an export writes, with the same columns."""

from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from sms_handover.errors import MissingDependencyError
from sms_handover.export.run_tables import run_tables
from sms_handover.run_data import RunData

if TYPE_CHECKING:
    import pandas as pd


def data_frames(run: RunData) -> "dict[str, pd.DataFrame]":
    """Return the tables of a run by name: ``ticks``, ``references``, ``grasp_events``, ``run_events``.

    Rows and columns are those of ``sms-handover bag export``. ``frame.attrs["units"]`` has the unit of every
    column, "" where there is none. Raises MissingDependencyError without pandas.
    """
    try:
        pandas = import_module("pandas")
    except ImportError as error:
        raise MissingDependencyError("data frames", "pandas", "pandas") from error
    frames = {}
    for table in run_tables(run, lambda stamps: np.ones(stamps.shape, dtype=np.bool_)):
        names = [column.name for column in table.columns]
        frame = pandas.DataFrame(dict(zip(names, table.values, strict=True)))
        frame.attrs["units"] = {column.name: column.unit for column in table.columns}
        frames[table.name] = frame
    return frames
