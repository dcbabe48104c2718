"""The paper's table in a CSV or Parquet file: written whole or not at all, every cell checked."""

# pyarrow ships no types, and it makes its compute functions when it is imported.
# pyright: reportUnknownParameterType=false, reportAttributeAccessIssue=false

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import IO, TYPE_CHECKING

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.core.files import atomic_file, unreadable_error
from overtaking.core.process_limits import refusal_of
from overtaking.recordings.messages import refused
from overtaking.recordings.pinto2023_schema import COLUMNS, SCHEMA, VEHICLE_COLUMNS
from overtaking.recordings.pinto2023_text import CellError, from_text, to_text
from overtaking.recordings.table_streams import open_bytes

if TYPE_CHECKING:
    from collections.abc import Iterable


_TEXT = pa.schema([(name, pa.string()) for name in COLUMNS], metadata=SCHEMA.metadata)
_MAX_SHOWN = 60

_MAX_TEXT_BYTES = (1 << 31) - 1
_MAX_EXPANSION, _SMALL_BYTES = 100, 1 << 24
"""The text of a Parquet file may have so many times its size, and always 16 MB; ours has 9 times
its size. A few bytes can stand for any number of rows."""


def write_table(tables: Iterable[pa.Table], path: Path | str) -> int:
    """Write the paper's table, one part after the other.

    The file appears under its name only when it is complete; a file of that name is replaced.

    Args:
        tables: The parts, each of `SCHEMA`; only one is held at a time.
        path: The file; its ending, `.csv` or `.parquet`, chooses the format.

    Returns:
        Number of rows written.

    Raises:
        ConfigError: The ending is neither, or the path is a folder.
        OSError: The file cannot be written.
    """
    target = Path(path)
    if target.suffix not in (".csv", ".parquet") or target.is_dir():
        raise ConfigError(
            what="the paper's table",
            where=str(target),
            expected="a file name that ends in .csv or .parquet",
            got="a folder" if target.is_dir() else repr(target.suffix),
            next_step="choose such a name",
        )
    write = _write_csv if target.suffix == ".csv" else _write_parquet
    target.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(target) as partial, partial.open("xb") as file:
        return write(file, tables)


def _write_parquet(file: IO[bytes], tables: Iterable[pa.Table]) -> int:
    """Write Parquet with the cells as text, as in the paper; returns the number of rows."""
    rows = 0
    with pq.ParquetWriter(file, _TEXT, compression="zstd") as writer:
        for table in tables:
            writer.write_table(to_text(table))
            rows += table.num_rows
    return rows


def _write_csv(file: IO[bytes], tables: Iterable[pa.Table]) -> int:
    """Write CSV (RFC 4180) with quotes around cells with commas; returns the number of rows."""
    rows = 0
    file.write((",".join(COLUMNS) + "\r\n").encode())
    for table in tables:
        text = to_text(table)
        cells = [
            pc.binary_join_element_wise('"', text[name], '"', "")
            if name in VEHICLE_COLUMNS
            else text[name]
            for name in COLUMNS
        ]
        for chunk in pc.binary_join_element_wise(*cells, ",").chunks:
            file.write("".join(line + "\r\n" for line in chunk.to_pylist()).encode())
        rows += table.num_rows
    return rows


def read_table(path: Path | str) -> pa.Table:
    """Read the paper's table from a CSV or Parquet file.

    Args:
        path: A file that `write_table` wrote, or one of that form.

    Returns:
        The values, a table of `SCHEMA`; no collision, which the paper writes as 0, is null.

    Raises:
        ImportFormatError: The file is not such a table; the message names line and column.
    """
    source = Path(path)
    is_parquet = source.suffix.lower() in (".parquet", ".pq")
    try:
        text = _parquet_text(source) if is_parquet else _csv_text(source)
        return from_text(text)
    except CellError as error:
        place = f"row {error.row + 1}" if is_parquet else f"line {error.row + 2}"
        raise refused(
            str(source),
            f"{place}, column {error.column}",
            error.expected,
            error.got[:_MAX_SHOWN],
            "correct the cell",
        ) from None


def _parquet_text(source: Path) -> pa.Table:
    """The cells of a Parquet file."""
    most = min(max(_MAX_EXPANSION * source.stat().st_size, _SMALL_BYTES), _MAX_TEXT_BYTES)
    with source.open("rb") as file:
        try:
            # One file, not a folder of partitions, and no columns guessed from the path.
            schema = _text_schema(source, pq.ParquetFile(file), most)
            # Equal cells stay one until it is known how long all of them are.
            table = pq.ParquetFile(file, read_dictionary=COLUMNS).read()
            table.validate(full=True)  # Text that is no UTF-8, for one, is read without complaint.
        except (pa.ArrowException, OSError) as error:  # Arrow raises both on damaged pages.
            refusal = unreadable_error(error, str(source), ImportFormatError)
            raise refusal or _unreadable(source, "a Parquet file", error) from None
    size = 0
    for chunk in (chunk for column in table.columns for chunk in column.chunks):
        lengths = pc.binary_length(chunk.dictionary).cast(pa.int64())
        size += pc.sum(lengths.take(chunk.indices)).as_py() or 0
    _refuse_bomb(source, size, most)
    return table.cast(schema)


def _text_schema(source: Path, file: pq.ParquetFile, most: int) -> pa.Schema:
    """The columns of a Parquet file, held to what it says of itself before any cell is read."""
    schema, about = file.schema_arrow, file.metadata
    _check_names(source, schema.names)
    for field in schema:
        if not (pa.types.is_string(field.type) or pa.types.is_large_string(field.type)):
            raise _unreadable(source, "columns of text", f"{field.name} of type {field.type}")
    pages = sum(about.row_group(k).total_byte_size for k in range(about.num_row_groups))
    ends = len(COLUMNS) * about.num_rows  # In a CSV file a comma or an end of line for each cell.
    _refuse_bomb(source, max(pages, ends), most)
    return schema


def _refuse_bomb(source: Path, size: int, most: int) -> None:
    """Refuse text that is longer than the size of the file allows."""
    if size > most:
        raise _unreadable(source, f"at most {most >> 20} MB of text", f"{size >> 20} MB or more")


def _csv_text(source: Path) -> pa.Table:
    """The cells of a CSV file."""
    try:
        with open_bytes(source) as file:
            lines = io.TextIOWrapper(file, encoding="utf-8-sig", newline="")
            _check_names(source, next(csv.reader(lines), []))
        with open_bytes(source) as file:
            return pacsv.read_csv(
                pa.PythonFile(file, mode="r"),
                # One thread, because only then Arrow knows the number of a bad row.
                read_options=pacsv.ReadOptions(
                    use_threads=False, column_names=COLUMNS, skip_rows=1
                ),
                parse_options=pacsv.ParseOptions(ignore_empty_lines=False),
                convert_options=pacsv.ConvertOptions(
                    column_types=dict.fromkeys(COLUMNS, pa.string()), strings_can_be_null=False
                ),
            )
    except (pa.ArrowException, UnicodeDecodeError, csv.Error) as error:
        if (refusal := refusal_of(error, str(source))) is not None:
            raise refusal from error
        raise _unreadable(source, "22 cells of UTF-8 text in each line", error) from None


def _check_names(source: Path, names: list[str]) -> None:
    """Refuse a file whose columns are not the paper's, in the paper's order."""
    for position, (expected, got) in enumerate(zip(COLUMNS, [*names, *[""] * 22], strict=False)):
        if got != expected:
            raise refused(
                str(source),
                f"line 1, column {position + 1}",
                f"the name {expected}",
                got[:_MAX_SHOWN],
                f"give the file the columns {' '.join(COLUMNS)}",
            )
    if len(names) != len(COLUMNS):
        raise _unreadable(source, f"{len(COLUMNS)} columns", f"{len(names)}")


def _unreadable(source: Path, expected: str, got: object) -> ImportFormatError:
    """The file as a whole is not what its name promises."""
    return refused(str(source), "the paper's table", expected, str(got), "export it again")
