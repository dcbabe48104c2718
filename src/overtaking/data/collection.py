"""Labels of a folder of recordings, a shard of them at a time: in parallel, and to be resumed.

Recordings have roads of their own, so the result is no data set, but the tables of labels and a
manifest. A recording that cannot be used is named with its error, and the others go on. What a
shard holds follows from its files alone: who makes it, and when, changes no byte.
"""

from __future__ import annotations

import hashlib
import json
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.core.errors import ConfigError, DatasetError, ImportFormatError
from overtaking.core.steps import Progress, Steps
from overtaking.data import lock, plan, shards
from overtaking.data.importing import READER_VERSION
from overtaking.data.interruption import all_or_nothing
from overtaking.data.location import PARTIAL, Folder, Location
from overtaking.data.manifest import ShardRecord, content_hash
from overtaking.data.tables.encode_labels import contents
from overtaking.data.tables.schemas import LABEL_TABLES, schema_of
from overtaking.data.tables.schemas import VERSION as TABLE_VERSION
from overtaking.labels.law import PORTUGAL
from overtaking.model.trajectory import UNKNOWNS
from overtaking.recordings.formats import read_recording
from overtaking.recordings.table_streams import uncompressed_name

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from overtaking.data.work import Executor, OnDone

MANIFEST = "recordings.json"

ENDINGS = {
    "commonroad": (".xml",),
    "exid": ("_tracks.csv",),
    "highd": ("_tracks.csv",),
    "ngsim": (".csv", ".txt"),
    "pinto2023": (".csv", ".parquet"),
    "table": (".csv", ".parquet", ".arrow", ".arrows", ".feather"),
}
"""How the names of recordings end, by format; the other files of a folder are left alone."""

TABLES = (*LABEL_TABLES, "simulations")

SHARD_SIZE = 256
"""Recordings of a shard: at most that much to do again."""

NUMBERS = 1_000_000
"""Numbers of simulations that each recording has; its own is the first divided by this."""

_OWN = frozenset({lock.FILE_NAME, PARTIAL})


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """The recordings of a shard.

    Attributes:
        shard: Their numbers.
        names: Their files.
    """

    shard: plan.Shard
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Labelling:
    """What all shards share; see `Work`.

    Attributes:
        file_format: Format of the recordings.
        folder: Where they lie.
        options: Options of the reader.
        fingerprint: Of all that decides the result.
    """

    file_format: str
    folder: str
    options: Mapping[str, Any]
    fingerprint: str

    def for_one_core(self) -> Labelling:
        """The same: nothing here has threads of its own."""
        return self

    def location(self, where: str) -> Location:
        """The folder of the result, if this process sees the same one.

        Raises:
            DatasetError: Something else is there, or nothing.
        """
        location = Folder(Path(where))
        if _begun(location) == self.fingerprint:
            return location
        raise _other(
            location, "one that every worker sees", "choose a folder that all machines share"
        )

    def make(self, task: Part, location: Location, on_done: OnDone) -> ShardRecord:
        """Put a shard into its place, unless it is there and intact.

        Raises:
            OSError: It cannot be written.
        """
        known = shards.finished_shard(
            location, task.shard, tables=TABLES, fingerprint=self.fingerprint
        )
        if known is not None:
            on_done(len(task.names))
            return known
        return shards.write_shard(
            location,
            task.shard,
            self._pieces(task, location, on_done),
            fingerprint=self.fingerprint,
            on_piece=on_done,
            schemas={name: schema_of(name, UNKNOWNS, recorded=True) for name in TABLES},
        )

    def _pieces(self, task: Part, location: Location, on_done: OnDone) -> Iterator[shards.Piece]:
        """The tables of each recording, counted when its last simulation is there."""
        refused: dict[str, str] = {}
        for number, name in enumerate(task.names, task.shard.first):
            try:
                path = Path(self.folder) / name
                scenes = read_recording(self.file_format, path, self.options).scenes
            except ImportFormatError as error:
                refused[name] = str(error)
                on_done(1)
                continue
            for chunk in plan.runs(0, min(len(scenes), NUMBERS), plan.RECORDED_CHUNK_SIZE):
                index = number * NUMBERS + np.arange(chunk.start, chunk.stop, dtype=np.int64)
                sources = [f"{name}: {one}" for one in scenes.sources(chunk)]
                made = contents(scenes.trajectories(chunk), index, TABLES, sources)
                yield int(chunk.stop >= len(scenes)), made
        if refused:  # Before the shard is in its place, which says that it is complete.
            location.put_text(_refusals(task.shard), _text(refused))


def label_folder(
    file_format: str,
    folder: Path,
    out: Path,
    options: Mapping[str, Any],
    *,
    executor: Callable[[int], Executor],
    resume: bool = False,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Label all recordings of a folder.

    Args:
        file_format: One of `ENDINGS`.
        folder: Where the recordings lie.
        out: Folder for the tables.
        options: Options of the reader.
        executor: Chooses who makes the shards, given their number.
        resume: Whether to complete what an earlier call has begun.
        progress: Called with the number of recordings that are done, and of all.

    Returns:
        The content of the manifest.

    Raises:
        ConfigError: There is no recording, or an option is not for the format.
        DatasetError: The folder holds something else or cannot be written, or the process was asked
            to end; finished shards are kept.
    """
    names = _names(file_format, folder)
    said = _identity(file_format, folder, names, options)
    job = Labelling(
        file_format=file_format,
        folder=str(folder.resolve()),
        options=options,
        fingerprint=hashlib.sha256(_text(said).encode()).hexdigest(),
    )
    location = Folder(out)
    with all_or_nothing(out, "time to complete it", "complete it with --resume"), location.locked():
        is_first = _begin(location, job, resume=resume)
        location.sweep()
        location.prepare(TABLES)
        parts = [
            Part(shard=shard, names=tuple(names[shard.first : shard.stop]))
            for shard in plan.shards(len(names), SHARD_SIZE)
        ]
        try:
            step = Steps(len(names), progress)
            with closing(executor(len(parts))(job, parts, location, step)) as made:
                records = sorted(made, key=lambda one: one.number)
            return _complete(location, job, said, records)
        except ConfigError:
            if is_first:  # The manifest of a call that cannot succeed would keep the right one out.
                location.remove(MANIFEST)
            raise
        finally:
            location.sweep()


def _names(file_format: str, folder: Path) -> list[str]:
    """The recordings of a folder, in order."""
    if file_format not in ENDINGS:
        raise ConfigError.not_among("format", "import", ENDINGS, file_format)
    endings = ENDINGS[file_format]
    may_be_compressed = file_format != "commonroad"  # XML is read uncompressed only.
    names = sorted(
        file.name
        for file in folder.iterdir()
        if (uncompressed_name(file) if may_be_compressed else file.name).endswith(endings)
    )
    if names:
        return names
    raise ConfigError.of(
        what="folder",
        where=str(folder),
        expected=f"recordings, files that end in {' or '.join(endings)}",
        got="none",
        next_step="check the folder and the format",
    )


def _identity(
    file_format: str, folder: Path, names: list[str], options: Mapping[str, Any]
) -> dict[str, Any]:
    """All that decides the result, but for the bytes of the recordings, whose sizes stand in."""
    columns = options.get("columns")
    is_file = isinstance(columns, str | Path) and Path(columns).is_file()
    files = "\n".join(f"{name} {(folder / name).stat().st_size}" for name in names)
    return {
        "format": file_format,
        "options": {name: repr(value) for name, value in sorted(options.items())},
        "columns": Path(str(columns)).read_text(encoding="utf-8") if is_file else "",
        "recordings": len(names),
        "files_sha256": hashlib.sha256(files.encode()).hexdigest(),
        "rules": PORTUGAL.version + PORTUGAL.two_way_version,
        "reader": READER_VERSION,
        "tables": TABLE_VERSION,
    }


def _begin(location: Folder, job: Labelling, *, resume: bool) -> bool:
    """Write the first manifest, or check that an earlier call may be continued; whether first."""
    if not location.has(MANIFEST):
        if strangers := location.names() - _OWN:
            raise _other(
                location, "an empty folder", "choose another", f"one with {min(strangers)}"
            )
        location.put_text(MANIFEST, _text({"fingerprint": job.fingerprint, "complete": False}))
        return True
    if _begun(location) != job.fingerprint:
        raise _other(location, "the labels of these recordings", "choose another folder")
    if not resume:
        next_step = "complete it with --resume, or choose another folder"
        raise _other(location, "an empty folder", next_step, "one that was begun")
    return False


def _complete(
    location: Folder, job: Labelling, said: dict[str, Any], records: list[ShardRecord]
) -> dict[str, Any]:
    """Write the last manifest."""
    refused = sum(
        len(json.loads((location.path / name).read_text(encoding="utf-8")))
        for name in location.names()
        if name.startswith("refused-")
    )
    values = {
        **said,
        "fingerprint": job.fingerprint,
        "complete": True,
        "simulations": sum(one.tables[shards.MARK].rows for one in records),
        "refused": refused,
        "content_hash": content_hash(tuple(records)),
    }
    location.put_text(MANIFEST, _text(values))
    return values


def _begun(location: Folder) -> str | None:
    """The fingerprint that a folder was begun with."""
    try:
        return json.loads((location.path / MANIFEST).read_text(encoding="utf-8"))["fingerprint"]
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _refusals(shard: plan.Shard) -> str:
    """Name of the file of recordings of a shard that could not be used, with their errors."""
    return f"refused-{shard.number:05d}.json"


def _text(values: Mapping[str, Any]) -> str:
    return json.dumps(values, indent=1, ensure_ascii=False) + "\n"


def _other(location: Location, expected: str, next_step: str, got: str = "others") -> DatasetError:
    return DatasetError.of(
        what="folder of labels",
        where=str(location),
        expected=expected,
        got=got,
        next_step=next_step,
    )
