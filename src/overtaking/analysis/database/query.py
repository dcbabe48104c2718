"""SQL queries of a data set, which can read its tables and nothing else.

The database lives in the memory of a process of its own. It holds the tables as streams, never sees
the name of a file and is forbidden to open one: a query can neither write nor read anything else.
"""

from __future__ import annotations

import contextlib
import csv
import io
import re
import time
from dataclasses import dataclass
from threading import Event
from types import NoneType
from typing import TYPE_CHECKING, Any

from overtaking.analysis.database.views import VIEWS
from overtaking.core.equality import ContentEquality
from overtaking.core.errors import ConfigError, check_extra
from overtaking.core.process_limits import check_query_limits, query_limit_error
from overtaking.core.representation import ShownAsTable, json_values
from overtaking.core.worker_process import WORKER_ENDED, WorkerProcess

if TYPE_CHECKING:
    import pandas as pd

    from overtaking.data.load import Dataset

MAX_ROWS = 10_000
TIMEOUT_S = 60.0
MEMORY_MIB = 1024
"""Default limits of a query."""

_MODULE = "overtaking.analysis.database.child"

BEGUN = "begun"
"""The first message of the process: the query begins now."""

_PATIENCE_S = 60.0
"""Longest time for the process to start [s]."""

_POLL_S = 0.2
"""A cancelled query ends within this time [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer(ShownAsTable, ContentEquality):
    """The answer to a query.

    Attributes:
        columns: Names of the columns.
        rows: The rows.
        is_cut: Whether there are more than the limit.
    """

    columns: tuple[str, ...]
    rows: list[tuple[Any, ...]]
    is_cut: bool

    def values(self) -> dict[str, Any]:
        """The answer for JSON."""
        return json_values(self)

    def to_pandas(self) -> pd.DataFrame:
        """The rows as a DataFrame; null is NaN in columns of floats, NA in columns of integers."""
        import pandas as pd

        cells = zip(*self.rows, strict=True) if self.rows else [()] * len(self.columns)
        frame = pd.DataFrame({number: _to_series(column) for number, column in enumerate(cells)})
        frame.columns = pd.Index(self.columns)  # Names may repeat.
        return frame

    def csv(self) -> str:
        """The answer as CSV with a header; null is empty."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows(json_values(self.rows))
        return text.getvalue()


def query(
    data: Dataset,
    sql: str,
    *,
    max_rows: int = MAX_ROWS,
    timeout_s: float = TIMEOUT_S,
    memory_mib: int = MEMORY_MIB,
    cancelled: Event | None = None,
) -> Answer:
    """The answer to one query.

    Args:
        data: The data set; its tables have their own names and units, and the paper's entities are
            views in the schema `paper`.
        sql: One SELECT, or DESCRIBE, SUMMARIZE, SHOW, in DuckDB's dialect.
        max_rows: Most rows, 1 to 1e9.
        timeout_s: Time limit [s], 0.001 to 1e9.
        memory_mib: Memory limit of the database [MiB], 16 to 1e9, which Linux enforces; the answer
            may take an eighth of it.
        cancelled: Ends the query when another thread sets it; None: it cannot be cancelled.

    Raises:
        ConfigError: It is no query, is wrong, is cancelled, or exceeds its time or memory.
        DatasetError: A file of the data set is damaged.
        MissingExtraError: DuckDB is not installed.
    """
    check_extra("sql", "duckdb", what="DuckDB, which answers SQL", where="sql")
    check_query_limits("sql", max_rows=max_rows, timeout_s=timeout_s, memory_mib=memory_mib)
    request = {
        "sql": sql,
        **_tables(data, sql),
        "max_rows": max_rows,
        "memory_mib": memory_mib,
    }
    # The default pool of Arrow reserves a gigabyte of addresses.
    with WorkerProcess(_MODULE, variables={"ARROW_DEFAULT_MEMORY_POOL": "system"}) as worker:
        worker.send(request)
        try:
            return _answer(worker, timeout_s, cancelled or Event())
        except TimeoutError:
            bound = f"an answer within {timeout_s:g} s"
            raise query_limit_error("sql", bound, "one that takes longer") from None
        except EOFError:
            ending = worker.describe_exit()
            if "exit status 1" in ending and "MemoryError" not in ending:
                raise RuntimeError(ending) from None  # A fault of our own.
            raise too_large(memory_mib) from None


def _to_series(cells: tuple[Any, ...]) -> pd.Series[Any]:
    """A column of an answer."""
    import pandas as pd

    # pandas makes floats of integers beside nulls; these are exact up to 2**53 only.
    if None in cells and {type(cell) for cell in cells} == {int, NoneType}:
        with contextlib.suppress(OverflowError):  # DuckDB has integers of 128 bits.
            return pd.Series(cells, dtype="Int64")
        return pd.Series(cells, dtype=object)
    return pd.Series(cells)


def _answer(worker: WorkerProcess, timeout_s: float, cancelled: Event) -> Answer:
    """The answer of the process, which begins with the names of the columns or an error.

    Raises:
        ConfigError: The process has refused the query, or it is cancelled.
        EOFError: It ended before the answer was complete.
        TimeoutError: The answer was not complete in time.
    """
    columns: tuple[str, ...] = ()
    rows: list[tuple[Any, ...]] = []
    end = time.monotonic() + _PATIENCE_S
    while True:
        message = _next_message(worker, end, cancelled)
        if message == BEGUN:
            end = time.monotonic() + timeout_s
        elif message is WORKER_ENDED:
            raise EOFError
        elif isinstance(message, ConfigError):
            raise message
        elif isinstance(message, bool):
            return Answer(columns=columns, rows=rows, is_cut=message)
        elif isinstance(message, tuple):
            columns = message
        else:
            rows += message


def _next_message(worker: WorkerProcess, end: float, cancelled: Event) -> Any:
    """The next message of the process.

    Args:
        worker: The process.
        end: Instant of `time.monotonic` at which waiting ends [s].
        cancelled: Set when the query is cancelled.

    Raises:
        ConfigError: The query is cancelled.
        TimeoutError: No message arrived until the end.
    """
    while True:
        left = end - time.monotonic()
        try:
            return worker.receive(max(0.0, min(left, _POLL_S)))
        except TimeoutError:
            if cancelled.is_set():
                raise ConfigError(
                    what="query",
                    where="sql",
                    expected="an answer",
                    got="the end of the program before it",
                    next_step="start it again",
                ) from None
            if left <= _POLL_S:
                raise


def _tables(data: Dataset, sql: str) -> dict[str, Any]:
    """The part of the request about tables.

    Views need the columns of unused tables too; the files of those tables stay closed.

    Returns:
        `tables` with the files of each table, and its schema where a query cannot read it; and the
        `folder` that the names of files are relative to: Arrow takes names in UTF-8 only, but the
        name of the folder may have other bytes.
    """
    from overtaking.data.tables.schemas import SCHEMAS  # Slow; `child` needs none of it.

    named = _named(sql, data.kept_tables)
    files = {table: data.files(table, is_checked=table in named) for table in data.kept_tables}
    folder = next(iter(files.values()))[0].parents[1]
    tables = {
        table: (
            [path.relative_to(folder).as_posix() for path in files[table]],
            None if table in named else SCHEMAS[table],
        )
        for table in data.kept_tables
    }
    return {"folder": str(folder.absolute()), "tables": tables}


def _named(sql: str, tables: tuple[str, ...]) -> set[str]:
    """The tables that a query may read: those whose names occur in it, as words."""
    words = {word.lower() for word in re.findall(r"\w+", sql)}
    needed = {table for view in VIEWS if view.name.lower() in words for table in view.tables}
    return {table for table in tables if table in words or table in needed}


def too_large(memory_mib: int) -> ConfigError:
    """The error of a query that exceeds its memory [MiB]."""
    return query_limit_error("sql", f"at most {memory_mib} MiB of memory", "one that needs more")
