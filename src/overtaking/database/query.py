"""Questions to a data set in SQL, which can read its tables and nothing else.

The database lives in memory and holds the tables as streams that are read from outside: it never
sees the name of a file and is forbidden to open one, so there is nothing that a query could write
over, and nothing beside the data set that it could read.
"""

from __future__ import annotations

import re
import threading
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from overtaking.core.bounds import check_bounds
from overtaking.core.errors import ConfigError, MissingExtraError
from overtaking.core.summary import Summarized
from overtaking.database.views import SCHEMA, VIEWS
from overtaking.tables.schemas import SCHEMAS

if TYPE_CHECKING:
    from collections.abc import Generator

    from overtaking.datasets.load import Dataset

MAX_ROWS = 10_000
TIMEOUT_S = 60.0
MEMORY_MIB = 1024
"""Bounds of a query, unless others are asked for."""

_MAX_CHARACTERS = 100_000
_SETTINGS = (
    # The sizes of streams are unknown, and guesses put the states of all vehicles into memory; in
    # the order of the query, a join keeps the table on its right.
    "SET disabled_optimizers = 'build_side_probe_side'",
    "SET temp_directory = ''",  # Nothing is written to disk: what needs more memory fails.
    "SET autoinstall_known_extensions = false",
    "SET autoload_known_extensions = false",
    "SET enable_external_access = false",
    "SET lock_configuration = true",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer(Summarized):
    """What a query gives.

    Attributes:
        columns: Names of the columns.
        rows: The rows, as many as were asked for.
        is_cut: Whether there are more.
    """

    columns: tuple[str, ...]
    rows: list[tuple[Any, ...]]
    is_cut: bool


def query(
    data: Dataset,
    sql: str,
    *,
    max_rows: int = MAX_ROWS,
    timeout_s: float = TIMEOUT_S,
    memory_mib: int = MEMORY_MIB,
) -> Answer:
    """The answer to one question.

    Args:
        data: The data set; its tables have their own names and units, and the paper's entities are
            views in the schema `paper`.
        sql: One SELECT, or DESCRIBE, SUMMARIZE, SHOW, in DuckDB's dialect.
        max_rows: How many rows to give at most.
        timeout_s: How long it may take [s].
        memory_mib: How much memory the database may use [MiB].

    Raises:
        ConfigError: It is no query, is wrong, or needs more time or memory than it may.
        DatasetError: A file of the data set is damaged.
        MissingExtraError: DuckDB is not installed.
    """
    duckdb = _duckdb()
    check_bounds("sql", max_rows=max_rows, timeout_s=timeout_s, memory_mib=memory_mib)
    with duckdb.connect(":memory:") as connection:
        _fill(connection, data, sql, memory_mib)
        try:
            statement = _only_statement(connection, sql)
            with _time_limit(connection, timeout_s):
                found = connection.execute(statement)
                names = tuple(column[0] for column in found.description or ())
                rows = found.fetchmany(max_rows + 1)
        except duckdb.InterruptException as error:
            raise _over(f"an answer within {timeout_s:g} s", "one that takes longer") from error
        except duckdb.OutOfMemoryException as error:
            raise _over(f"at most {memory_mib} MiB of memory", "one that needs more") from error
        except duckdb.Error as error:
            raise _refused(_first_line(error)) from error
    return Answer(columns=names, rows=rows[:max_rows], is_cut=len(rows) > max_rows)


def _fill(connection: Any, data: Dataset, sql: str, memory_mib: int) -> None:
    """Put the tables and the paper's views into a database, then lock it."""
    import pyarrow.dataset as arrow

    tables = data.kept_tables
    named = _named(sql, tables)
    for table in tables:
        files = [str(path) for path in data.files(table, is_checked=table in named)]
        # Views want to know the columns of tables that nobody asks about; their files stay closed.
        schema = None if table in named else SCHEMAS[table]
        source: Any = arrow.dataset(files, schema=schema, format="parquet")
        connection.register(table, source)
    connection.execute(f"CREATE SCHEMA {SCHEMA}")
    for view in VIEWS:
        if set(view.tables) <= set(tables):
            connection.execute(f"CREATE VIEW {SCHEMA}.{view.name} AS {view.body}")
    connection.execute(f"SET memory_limit = '{memory_mib}MiB'")
    for setting in _SETTINGS:
        connection.execute(setting)


def _named(sql: str, tables: tuple[str, ...]) -> set[str]:
    """The tables that a query may read: those whose names occur in it, as words."""
    words = {word.lower() for word in re.findall(r"\w+", sql)}
    needed = {table for view in VIEWS if view.name.lower() in words for table in view.tables}
    return {table for table in tables if table in words or table in needed}


def _only_statement(connection: Any, sql: str) -> Any:
    """The query, parsed.

    Raises:
        ConfigError: It is not exactly one, or one that is no question.
    """
    if len(sql) > _MAX_CHARACTERS:
        raise _no_query(f"one of {len(sql)} characters")
    statements = connection.extract_statements(sql)
    if len(statements) != 1:
        raise _no_query(f"{len(statements) or 'no'} statements")
    kind = statements[0].type.name
    if kind != "SELECT":
        raise _no_query(f"a statement of the kind {kind}")
    return statements[0]


@contextmanager
def _time_limit(connection: Any, seconds: float) -> Generator[None]:
    """Stop what a connection does after some time."""
    timer = threading.Timer(seconds, connection.interrupt)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _duckdb() -> Any:
    """DuckDB, which not everybody has."""
    try:
        import duckdb
    except ImportError:
        raise MissingExtraError.of(
            what="DuckDB, which answers SQL",
            where="sql",
            expected="the extra [sql]",
            got="no such package",
            next_step="run: pip install 'overtaking[sql]'",
        ) from None
    return duckdb


def _first_line(error: Exception) -> str:
    """What DuckDB says, without the drawing of the place."""
    return next((line for line in str(error).splitlines() if line.strip()), "an error")


def _no_query(got: str) -> ConfigError:
    return ConfigError.of(
        what="query",
        where="sql",
        expected="one SELECT, DESCRIBE, SUMMARIZE or SHOW",
        got=got,
        next_step="ask one question at a time",
    )


def _over(expected: str, got: str) -> ConfigError:
    return ConfigError.of(
        what="query",
        where="sql",
        expected=expected,
        got=got,
        next_step="ask for less, or allow more",
    )


def _refused(said: str) -> ConfigError:
    return ConfigError.of(
        what="query",
        where="sql",
        expected="one that DuckDB can answer",
        got=said,
        next_step='ask "SHOW ALL TABLES" what there is',
    )
