"""Parquet files, with the unit of each column in its metadata; needs pyarrow."""

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

from sms_handover.errors import ConfigurationError
from sms_handover.export.table import Column, Format, Kind, ListOf, StructOf, TableFile


class ParquetFormat(Format):
    """Parquet files in a folder, with the name of the bag in their metadata."""

    suffix = ".parquet"

    def __init__(self, folder: Path, bag: str) -> None:
        """Write to ``folder``; raises ConfigurationError if pyarrow is not installed."""
        try:
            self._arrow: Any = import_module("pyarrow")
            self._parquet: Any = import_module("pyarrow.parquet")
        except ImportError as error:
            raise ConfigurationError(
                "Parquet needs pyarrow, which is not installed: pip install 'sms_handover[parquet]', "
                "or export with --format csv"
            ) from error
        self._folder = folder
        self._metadata = {"bag": bag.encode(errors="backslashreplace")}

    def open(self, stem: str, columns: Sequence[Column]) -> TableFile:
        """Create the file of a table."""
        arrow = self._arrow
        fields = [
            arrow.field(
                column.name, self._type(column.kind), metadata={"unit": column.unit} if column.unit else None
            )
            for column in columns
        ]
        schema = arrow.schema(fields, metadata=self._metadata)
        path = self._folder / f"{stem}{self.suffix}"
        stream = path.open("xb")  # Arrow opens no path that is not UTF-8
        return _ParquetFile(arrow, self._parquet.ParquetWriter(stream, schema, compression="zstd"), stream)

    def _type(self, kind: Kind) -> Any:
        """Return the Arrow type of a kind."""
        arrow = self._arrow
        if isinstance(kind, ListOf):
            return arrow.list_(self._type(kind.item))
        if isinstance(kind, StructOf):
            return arrow.struct([arrow.field(name, self._type(item)) for name, item in kind.fields])
        make: Any = getattr(arrow, "bool_" if kind == "bool" else kind)
        return make()


class _ParquetFile(TableFile):
    """One Parquet file; each batch of rows becomes a row group."""

    def __init__(self, arrow: Any, writer: Any, stream: BinaryIO) -> None:
        self._arrow, self._writer, self._schema, self._stream = arrow, writer, writer.schema, stream

    def write(self, rows: Sequence[Sequence[Any]]) -> None:
        """Append rows."""
        if rows:
            columns = [
                self._arrow.array(values, type=field.type)
                for values, field in zip(zip(*rows, strict=True), self._schema, strict=True)
            ]
            self._writer.write_table(self._arrow.Table.from_arrays(columns, schema=self._schema))

    def close(self) -> None:
        """Complete the file."""
        with self._stream:
            self._writer.close()
