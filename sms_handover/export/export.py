"""Export a bag as tables in a new folder."""

import shutil
from pathlib import Path

from sms_handover.bag.info import BagInfo, read_info
from sms_handover.bag.run.reader import holds_run, read_run
from sms_handover.errors import BagError, ConfigurationError
from sms_handover.export.csv_files import CsvFormat
from sms_handover.export.matlab_files import MatlabFormat
from sms_handover.export.output import Tables
from sms_handover.export.parquet_files import ParquetFormat
from sms_handover.export.run_tables import run_tables
from sms_handover.export.selection import Selection, Wanted
from sms_handover.export.table import Format
from sms_handover.export.topic_tables import Progress, export_topics

CSV, PARQUET, MATLAB = "csv", "parquet", "matlab"
FORMATS = (CSV, PARQUET, MATLAB)

_BATCH = 5000  # rows written at once


def export(
    bag: Path,
    folder: Path,
    file_format: str,
    selection: Selection,
    *,
    by_topic: bool = False,
    progress: Progress | None = None,
) -> Tables:
    """Write the tables of the bag at ``bag`` into the new ``folder``.

    A run gives the tables of :func:`run_tables`. Any other bag, and a run if topics are selected or
    ``by_topic``, gives a table per topic. Raises BagError if the bag is damaged or nothing can be
    exported, ConfigurationError if the folder exists or a topic does not; the folder is then removed.
    """
    info = read_info(bag)
    absent = selection.topics.absent(info.topics)
    if absent:
        raise ConfigurationError(f"{bag} has no topic {', '.join(absent)}; it has {', '.join(info.topics)}")
    try:
        folder.mkdir()
    except FileExistsError:
        raise ConfigurationError(f"{folder} exists, choose another output folder") from None
    except OSError as error:
        raise ConfigurationError(f"cannot create {folder}: {error.strerror}") from error
    try:
        tables = Tables(folder, _format(file_format, folder, info))
        tables.missing = info.missing
        if holds_run(info) and selection.everything and not by_topic:
            _export_run(bag, tables, selection.wanted(info.start_ns))
        else:
            export_topics(info, tables, selection, progress)
        if not tables.rows:
            reasons = "; ".join(tables.skipped.values()) or "it has no topics, or none is selected"
            raise BagError(f"nothing to export from {bag}: {reasons}")
        tables.describe(info)
    except OSError as error:
        shutil.rmtree(folder)
        raise BagError(f"cannot write the tables to {folder}: {error.strerror or error}") from error
    except BaseException:
        shutil.rmtree(folder)
        raise
    return tables


def _format(name: str, folder: Path, info: BagInfo) -> Format:
    """Return a file format by name."""
    if name == PARQUET:
        return ParquetFormat(folder, info.path.name)
    return MatlabFormat(folder) if name == MATLAB else CsvFormat(folder)


def _export_run(bag: Path, tables: Tables, wanted: Wanted) -> None:
    """Write the tables of a run."""
    for table in run_tables(read_run(bag), wanted):
        stem, file = tables.open(table.name, table.columns)
        try:
            for rows in table.rows(_BATCH):
                file.write(rows)
                tables.rows[stem] += len(rows)
        finally:
            file.close()
