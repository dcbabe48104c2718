"""Tables in memory, of pandas or any library with Arrow's C interface, as tables of Arrow."""

# pyright: reportUnknownParameterType=false, reportAttributeAccessIssue=false

from __future__ import annotations

from typing import Any

import pyarrow as pa

from overtaking.recordings.table_errors import refused


def arrow_table(table: Any) -> tuple[pa.Table, list[str]]:
    """A table of Arrow, and the names of the index of a data frame.

    Args:
        table: A data frame of pandas, an object with `__arrow_c_stream__` or `__arrow_c_array__`
            such as tables of polars, DuckDB and Ibis, or a mapping of columns.

    Raises:
        ImportFormatError: It is no table.
    """
    try:
        if isinstance(table, pa.Table):
            return table, []
        if isinstance(table, dict):
            return pa.table(table), []
        # pandas has the C interface as well, but there a NaN is no missing cell.
        if hasattr(table, "iloc") and hasattr(table, "index"):
            index_names = [name for name in table.index.names if isinstance(name, str)]
            return _arrow_of_pandas(table.rename(columns=str)), index_names
        if hasattr(table, "__arrow_c_stream__"):
            return pa.RecordBatchReader.from_stream(table).read_all(), []
        if hasattr(table, "__arrow_c_array__"):
            return pa.Table.from_batches([pa.record_batch(table)]), []
    except (pa.ArrowException, TypeError, ValueError, AttributeError, UnicodeError) as error:
        raise _table_error(str(error)) from None
    raise _table_error(f"an object of type {type(table).__name__}")


def _arrow_of_pandas(frame: Any) -> pa.Table:
    """A data frame as a table of Arrow; a column of numbers and texts becomes one of texts."""
    try:
        return pa.Table.from_pandas(frame, preserve_index=False)
    except (pa.ArrowInvalid, pa.ArrowTypeError):
        objects = [name for name in frame.columns if frame[name].dtype == object]
        texts = {name: frame[name].map(str).where(frame[name].notna(), None) for name in objects}
        return pa.Table.from_pandas(frame.assign(**texts), preserve_index=False)


def _table_error(got: str) -> Exception:
    return refused(
        "table",
        "table",
        "a data frame of pandas, a table with Arrow's C interface, or a dict of columns",
        got,
        "collect a lazy table first; convert another one into a data frame of pandas",
    )
