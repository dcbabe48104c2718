"""The files of a shard: written all or not at all, and compared with what was written when read.

Files grow in a staging folder and are put into place when they are complete and on the disk. That
of the `simulations` comes last and is the commit mark: it carries rows and checksums of the others,
and without it the shard does not exist.
"""

import dataclasses
import hashlib
import json
import math
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, wait
from contextlib import ExitStack, suppress
from functools import partial
from io import BufferedIOBase
from pathlib import Path
from typing import Any

import pyarrow as pa

from overtaking.core.errors import DatasetError, OvertakingError, SchemaError
from overtaking.core.files import MISSING_FILE_ERRORS, unreadable_error
from overtaking.core.process_limits import submit, thread_pool
from overtaking.data import plan
from overtaking.data.location import Location
from overtaking.data.manifest import Manifest, ShardRecord
from overtaking.data.plan import Shard
from overtaking.data.tables.arrow import column_to_numpy
from overtaking.data.tables.digest import content_of
from overtaking.data.tables.files import (
    FileFacts,
    TableWriter,
    check_footer,
    facts_of,
    footer_rows,
    read_notes,
    read_table,
)
from overtaking.data.tables.schemas import KEYS, ROWS_OF_EACH, SCHEMAS, most_rows
from overtaking.model.scenario import MAX_DURATION
from overtaking.world.constants import STEP_MS

MARK = "simulations"
"""The table whose file is the commit mark of its shard."""

HASH_BYTES = 16
"""Length of the hash over the recorded integers of a simulation [bytes]."""

WRITING_THREADS = 4
"""Tables that are written beside each other; one of them takes most of the time."""

_FACTS, _CLIPPED, _SEAL = "overtaking.facts", "overtaking.clipped", "overtaking.seal"

Piece = tuple[int, Mapping[str, pa.Table]]
"""How many simulations, and their tables by name."""

Writers = Mapping[str, TableWriter]
"""The writer of each table, by its name."""


def name_of(table: str, shard: Shard) -> str:
    """Name of the file of a shard in its place."""
    return f"{table}/{shard.file_name}"


def write_shard(
    location: Location,
    shard: Shard,
    pieces: Iterable[Piece],
    *,
    schemas: Mapping[str, pa.Schema],
    fingerprint: str,
    on_piece: Callable[[int], None],
    clipped: Sequence[int] | None = None,
) -> ShardRecord:
    """Write the files of a shard and put them into place.

    Args:
        location: Where the data set lies, prepared for its tables.
        shard: Which simulations.
        pieces: Their tables, a few simulations at a time, in order.
        schemas: The schema of each table to write.
        fingerprint: Of the identity that the shard belongs to.
        on_piece: Called with the number of simulations of each piece that was written.
        clipped: Clipped answers of a policy, which grows as pieces are made; None without a policy.

    Raises:
        OSError: The disk is full or cannot be written.
    """
    with location.staging() as staging:
        marked = partial(_marked, fingerprint=fingerprint, clipped=clipped)
        facts = write_files(staging, shard, pieces, schemas, on_piece, marked)
        put_into_place(location, staging, shard, schemas)
    return _record(shard, facts, None if clipped is None else sum(clipped))


def write_files(
    staging: Path,
    shard: Shard,
    pieces: Iterable[Piece],
    schemas: Mapping[str, pa.Schema],
    on_piece: Callable[[int], None],
    finished: Callable[[Writers], dict[str, FileFacts]] | None = None,
) -> dict[str, FileFacts]:
    """Write unfinished files of a shard into a staging folder.

    Args:
        staging: The folder.
        shard: As in `write_shard`.
        pieces: As in `write_shard`.
        schemas: As in `write_shard`.
        on_piece: As in `write_shard`.
        finished: Completes the files; without notes in any of them if left out.
    """
    with ExitStack() as stack:
        writers = {
            name: stack.enter_context(TableWriter(unfinished(staging, name, shard), name, one))
            for name, one in schemas.items()
        }
        _write_pieces(pieces, writers, on_piece)
        return (finished or _finished)(writers)


def unfinished(staging: Path, table: str, shard: Shard) -> Path:
    """Path of an unfinished file of a shard."""
    return staging / f"{table}-{shard.file_name}"


def put_into_place(location: Location, staging: Path, shard: Shard, tables: Iterable[str]) -> None:
    """Put the finished files of a shard where they belong, the commit mark last."""
    for name in sorted(tables, key=lambda name: name == MARK):
        location.put(unfinished(staging, name, shard), name_of(name, shard))


def finished_shard(
    location: Location, shard: Shard, *, tables: tuple[str, ...], fingerprint: str
) -> ShardRecord | None:
    """The record of a shard that is there and intact; None if it has to be written.

    Every file is read, so that files damaged since are written again. A file that cannot be read
    may be intact and is not replaced.

    Args:
        location: Where the data set lies.
        shard: Which simulations.
        tables: The tables that it must have.
        fingerprint: Of the identity that it must belong to.

    Raises:
        DatasetError: The system does not let this process read a file.
    """
    try:
        return _finished_shard(location, shard, tables, fingerprint)
    except OSError as error:
        where = error.filename or location.at(name_of(MARK, shard))
        if (unreadable := unreadable_error(error, str(where), DatasetError)) is None:
            raise
        raise unreadable from error


def _finished_shard(
    location: Location, shard: Shard, tables: tuple[str, ...], fingerprint: str
) -> ShardRecord | None:
    """As `finished_shard`, but raises `OSError` where a file cannot be read."""
    try:
        mark = location.fetch(name_of(MARK, shard))
        notes, rows = read_notes(mark, MARK), read_table(mark, MARK)
    except (FileNotFoundError, SchemaError):
        return None
    known, clipped, content = notes.get(_FACTS, ""), notes.get(_CLIPPED), content_of(rows)
    if notes.get(_SEAL) != _seal(fingerprint, known, content, clipped):
        return None
    facts = {name: FileFacts(**one) for name, one in json.loads(known).items()}
    facts[MARK] = facts_of(mark, rows.num_rows, content)
    if not facts.keys() >= set(tables):  # Made before there were all of these tables.
        return None
    intact = (
        is_intact(partial(location.open, name_of(name, shard)), facts[name]) for name in tables
    )
    count = None if clipped is None else int(clipped)
    return _record(shard, facts, count) if all(intact) else None


def is_intact(opened: Callable[[], BufferedIOBase], facts: FileFacts) -> bool:
    """Whether a file is there and its bytes are those that were written.

    Args:
        opened: Opens it.
        facts: What was written.

    Raises:
        OSError: The system does not let this process read it.
    """
    try:
        with opened() as file:
            return hashlib.file_digest(file, "sha256").hexdigest() == facts.sha256
    except MISSING_FILE_ERRORS:
        return False


def _marked(
    writers: Writers, fingerprint: str, clipped: Sequence[int] | None
) -> dict[str, FileFacts]:
    """Complete the files; the commit mark carries rows and checksums of all others."""
    facts = _finished({name: writer for name, writer in writers.items() if name != MARK})
    known = json.dumps({name: dataclasses.asdict(one) for name, one in facts.items()})
    count = None if clipped is None else str(sum(clipped))
    seal = _seal(fingerprint, known, writers[MARK].content, count)
    counted = {} if count is None else {_CLIPPED: count}
    return {**facts, MARK: writers[MARK].finish({_FACTS: known, **counted, _SEAL: seal})}


def _finished(writers: Writers) -> dict[str, FileFacts]:
    """Complete some files, beside each other: each of them waits for the disk."""
    pool = thread_pool("write", WRITING_THREADS)
    underway: dict[str, Future[FileFacts]] = {}
    try:
        for name, writer in writers.items():
            underway[name] = submit(pool, TableWriter.finish, writer)
        return {name: future.result() for name, future in underway.items()}
    finally:
        wait(underway.values())  # A file must not be closed while a thread writes it.


def _write_pieces(
    pieces: Iterable[Piece], writers: Writers, on_piece: Callable[[int], None]
) -> None:
    """Write each piece, the tables beside each other, while the next piece is being made."""
    pool = thread_pool("write", WRITING_THREADS)
    underway: list[Future[None]] = []
    simulations = 0

    def finish() -> None:
        for future in underway:
            future.result()
        if underway:
            on_piece(simulations)

    try:
        for count, tables in pieces:
            finish()
            underway.clear()
            for name, one in writers.items():
                underway.append(submit(pool, one.write, tables[name]))
            simulations = count
        finish()
    finally:
        wait(underway)  # A file must not be closed while a thread writes it.


def _seal(fingerprint: str, facts: str, content: str, clipped: str | None) -> str:
    """Hash over all that a commit mark says: of which identity, of the other files, of its own."""
    said = (fingerprint, facts, content, *([] if clipped is None else [clipped]))
    return hashlib.sha256("\n".join(said).encode()).hexdigest()


def _record(shard: Shard, facts: Mapping[str, FileFacts], clipped: int | None) -> ShardRecord:
    return ShardRecord(
        number=shard.number,
        first=shard.first,
        simulations=shard.num_simulations,
        tables={name: facts[name] for name in sorted(facts)},
        clipped=clipped,
    )


def _most_steps_and_frames(spec: Mapping[str, Any]) -> tuple[int, int]:
    """Most steps and most frames of a simulation.

    Args:
        spec: The specification, resolved; that of recordings is empty.
    """
    if not spec:
        longest = int(1000 * MAX_DURATION) + 1  # Frames of a recording are a millisecond apart.
        return longest, longest
    horizon_ms = math.ceil(1000.0 * spec["time"]["horizon_s"])
    interval_ms = spec["profile"]["frame_interval_ms"]
    return horizon_ms // STEP_MS + 1, horizon_ms // interval_ms + 1


def _other_rows(table: str, where: str, expected: str, got: object) -> DatasetError:
    return DatasetError(
        what=f"rows of table {table}",
        where=where,
        expected=expected,
        got=got,
        next_step="restore the file from a copy, or generate the data set again",
    )


class ShardFiles:
    """Opens the files of a data set for reading.

    Args:
        location: Where they lie.
        manifest: Their rows and checksums.
    """

    def __init__(self, location: Location, manifest: Manifest) -> None:
        """Read nothing yet."""
        self._location, self._manifest = location, manifest
        self._intact: set[str] = set()
        self._most_rows = most_rows(*_most_steps_and_frames(manifest.identity.spec))
        self.shards = plan.shards(manifest.num_simulations, manifest.identity.shard_size)

    def one(self, table: str, shard: Shard) -> Path:
        """A file, after a test of its checksum.

        Raises:
            DatasetError: It is missing or damaged, or there never was such a table.
        """
        name = name_of(table, shard)
        path = self._fetched(table, shard)
        if name not in self._intact:
            facts = self._manifest.shards[shard.number].tables[table]
            try:
                has_its_bytes = is_intact(partial(path.open, "rb"), facts)
            except OSError as error:
                raise self._unreadable(name, error) from error
            if not has_its_bytes:
                raise self._damaged(name, "others")
            self._check_rows(check_footer(path, table), str(path), table, shard)
            self._intact.add(name)
        return path

    def of(self, table: str, *, is_checked: bool = True) -> list[Path]:
        """The files of a table, in the order of their simulations.

        Args:
            table: Name of a table that was kept.
            is_checked: Whether the checksums of the files are tested.
        """
        give = self.one if is_checked else self._fetched
        return [give(table, shard) for shard in self.shards]

    def verify(self) -> None:
        """Read every file and test its checksum.

        Raises:
            DatasetError: One of them is missing or damaged.
        """
        self._intact.clear()
        for shard in self.shards:
            for table in self._manifest.shards[shard.number].tables:
                self.one(table, shard)

    def check_first_shard(self) -> None:
        """Check version, columns and number of rows of each table in the first shard.

        Only the metadata at the ends of the files is read. A missing or damaged file is found when
        it is read, by its checksum.

        Raises:
            DatasetError: A table has more rows than its simulations can have, or others than the
                manifest states.
            SchemaError: A table lacks a column, or is of a newer version.
        """
        shard = self.shards[0]
        for table in self._manifest.shards[0].tables:
            if table not in SCHEMAS:
                continue
            name = name_of(table, shard)
            unreadable = (OSError, UnicodeDecodeError, pa.ArrowException)
            with suppress(*unreadable), self._location.open(name) as file:
                where = self._location.at(name)
                self._check_rows(footer_rows(file, where, table), where, table, shard)

    def check_simulations(self, rows: pa.Table, where: str, table: str, shard: Shard) -> None:
        """Refuse rows of simulations that are not in the shard, and too many rows of one.

        Args:
            rows: Rows of the shard, sorted by their first key.
            where: Their file, for messages.
            table: Name of their table.
            shard: Which simulations.

        Raises:
            DatasetError: There are such rows.
        """
        column = KEYS[table][0]
        if column not in rows.column_names or not rows.num_rows:
            return
        key = column_to_numpy(rows[column])
        most = self._most_rows[table]
        if (key[most:] == key[:-most]).any():
            raise _other_rows(table, where, f"at most {most} for a simulation", "more")
        is_other = (key < shard.first) | (key >= shard.stop)
        if is_other.any():
            expected = f"simulations {shard.first} to {shard.stop - 1}"
            raise _other_rows(table, where, expected, int(key[is_other][0]))

    def _check_rows(self, got: int, where: str, table: str, shard: Shard) -> None:
        """Check the number of rows of a file, before any row is decoded.

        Args:
            got: Number of rows by the metadata of the file.
            where: The file, for messages.
            table: Name of its table.
            shard: Which simulations.

        Raises:
            DatasetError: The manifest states another number, or simulations cannot have so many.
        """
        facts = self._manifest.shards[shard.number].tables[table]
        each = ROWS_OF_EACH.get(table)
        most = self._most_rows[table] * shard.num_simulations
        if got > most:
            expected = f"at most {most} for {shard.num_simulations} simulations"
        elif got != facts.rows:
            expected = f"{facts.rows}, as the manifest states"
        elif each and got != each * shard.num_simulations:
            expected = f"{each * shard.num_simulations}, {each} for each simulation"
        elif table == MARK and facts.size_bytes < HASH_BYTES * got:
            # Trace hashes cannot be compressed: the size of this file limits all other tables.
            expected = f"at least {HASH_BYTES} bytes each in {facts.size_bytes} bytes"
        else:
            return
        raise _other_rows(table, where, expected, got)

    def _fetched(self, table: str, shard: Shard) -> Path:
        if table not in SCHEMAS:  # Its name would be a part of a path.
            raise DatasetError.unknown_choice(
                what="table", where=str(self._location), choices=SCHEMAS, got=table
            )
        if table not in self._manifest.shards[shard.number].tables:
            raise self._missing_table(table)
        name = name_of(table, shard)
        try:
            return self._location.fetch(name)
        except MISSING_FILE_ERRORS as error:
            raise self._damaged(name, error.strerror or str(error)) from None
        except OSError as error:
            raise self._unreadable(name, error) from error

    def _unreadable(self, name: str, error: OSError) -> OvertakingError:
        """The error for a file that the system or a store does not hand out."""
        where = self._location.at(name)
        return unreadable_error(error, where, DatasetError) or DatasetError(
            what="file",
            where=where,
            expected="a file that this process can read",
            got=str(error),
            next_step="check the connection to the store, and try again",
        )

    def _damaged(self, name: str, got: str) -> DatasetError:
        return DatasetError(
            what="file",
            where=self._location.at(name),
            expected="the bytes that were written",
            got=got,
            next_step=f"run: overtaking generate --resume --out {shlex.quote(str(self._location))}",
        )

    def _missing_table(self, table: str) -> DatasetError:
        """The error for a table that every data set has, and the manifest does not list."""
        return DatasetError(
            what=f"table {table}",
            where=str(self._location),
            expected="files of it in the manifest",
            got="none",
            next_step=f"run: overtaking label {shlex.quote(str(self._location))}",
        )
