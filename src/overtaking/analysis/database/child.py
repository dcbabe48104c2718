"""DuckDB in a worker process, which the system holds to its memory.

It answers one request: `BEGUN`, the names of the columns, rows, and whether there are more; or an
error.

A bound of the database alone is not enough: DuckDB computes 2,048 rows at a time, whatever is in
them, and counts no text against its memory limit until it keeps it.
"""

from __future__ import annotations

import os
import sys
from importlib.abc import MetaPathFinder
from typing import TYPE_CHECKING, Any

import duckdb
import pyarrow as pa

from overtaking.analysis.database.query import BEGUN, too_large
from overtaking.analysis.database.views import SCHEMA, VIEWS
from overtaking.core import process_limits
from overtaking.core.errors import ConfigError
from overtaking.core.process_limits import limit_process, remaining_answer_bytes

if TYPE_CHECKING:
    from collections.abc import Callable

    from overtaking.core.worker_process import ParentConnection

_MOST_THREADS = 8
_OVERHEAD_MIB = 256
"""Stacks of threads, and pieces of the files that are read."""

_MOST_CHARACTERS = 100_000
_ROWS_AT_A_TIME = 256
_SETTINGS = (
    # The sizes of streams are unknown, and guesses put the states of all vehicles into memory; in
    # the order of the query, a join keeps the table on its right.
    "SET disabled_optimizers = 'build_side_probe_side'",
    "SET temp_directory = ''",  # Nothing is written to disk: a query that needs more memory fails.
    "SET autoinstall_known_extensions = false",
    "SET autoload_known_extensions = false",
    "SET enable_external_access = false",
    "SET lock_configuration = true",
)


class _WithoutPandas(MetaPathFinder):
    """Lets pandas look as if it were not installed.

    `pyarrow.dataset` tries to import it, which takes as long as all other imports together, and
    no answer needs it.
    """

    def find_spec(self, fullname: str, *_: object) -> None:
        """Refuse pandas, and leave all else to the finders behind."""
        if fullname == "pandas":
            raise ModuleNotFoundError(fullname, name=fullname)


def main(parent: ParentConnection) -> None:
    """Answer one request."""
    sys.meta_path.insert(0, _WithoutPandas())
    asked = next(iter(parent))
    try:
        _answer(asked, parent.send)
    except (duckdb.OutOfMemoryException, MemoryError):
        parent.send(too_large(asked["memory_mib"]))
    except (duckdb.Error, pa.ArrowException, RecursionError) as error:
        said = next((line for line in str(error).splitlines() if line.strip()), "an error")
        parent.send(
            _wrong("one that DuckDB can answer", said, 'ask "SHOW ALL TABLES" what there is')
        )
    except ConfigError as error:
        parent.send(error)


def _answer(asked: dict[str, Any], send: Callable[[object], None]) -> None:
    """Send the answer piece by piece."""
    memory_mib = asked["memory_mib"]
    os.chdir(asked["folder"])
    connection = _connected(asked["tables"], memory_mib)
    statement = _only_statement(connection, asked["sql"])
    limit_process(memory_mib + _OVERHEAD_MIB)
    send(BEGUN)
    found = connection.execute(statement)
    send(tuple(column[0] for column in found.description or ()))
    left, room = asked["max_rows"], None
    while rows := found.fetchmany(min(_ROWS_AT_A_TIME, left + 1)):
        room = remaining_answer_bytes(room, rows, "sql", memory_mib)
        send(rows[:left])
        if len(rows) > left:
            break
        left -= len(rows)
    send(bool(rows))


def _connected(tables: dict[str, tuple[list[str], Any]], memory_mib: int) -> Any:
    """A database with the tables and the paper's views, locked."""
    import pyarrow.dataset as arrow

    threads = min(_MOST_THREADS, process_limits.processors_to_use())
    pa.set_cpu_count(threads)
    pa.set_io_thread_count(threads)
    connection: Any = duckdb.connect(":memory:", config={"threads": threads})
    for name, (files, schema) in tables.items():
        source: Any = arrow.dataset(files, schema=schema, format="parquet")
        connection.register(name, source)
    connection.execute(f"CREATE SCHEMA {SCHEMA}")
    for view in VIEWS:
        if set(view.tables) <= set(tables):
            connection.execute(view.statement)
    connection.execute(f"SET memory_limit = '{memory_mib}MiB'")
    for setting in _SETTINGS:
        connection.execute(setting)
    return connection


def _only_statement(connection: Any, sql: str) -> Any:
    """The query, parsed.

    Raises:
        ConfigError: It is not exactly one query.
    """
    if len(sql) > _MOST_CHARACTERS:
        raise _no_query(f"one of {len(sql)} characters")
    statements = connection.extract_statements(sql)
    if len(statements) != 1:
        raise _no_query(f"{len(statements) or 'no'} statements")
    kind = statements[0].type.name
    if kind != "SELECT":
        raise _no_query(f"a statement of the kind {kind}")
    return statements[0]


def _no_query(got: str) -> ConfigError:
    return _wrong("one SELECT, DESCRIBE, SUMMARIZE or SHOW", got, "ask one question at a time")


def _wrong(expected: str, got: str, next_step: str) -> ConfigError:
    return ConfigError(what="query", where="sql", expected=expected, got=got, next_step=next_step)
