"""Makes a data set of what others have recorded: the whole folder at once, or nothing.

A recording is read before anything is written, so there is nothing to resume: the folder grows
beside its place and takes its name when it is complete.
"""

import platform
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pyarrow as pa

from overtaking.core.folders import refuse_strangers, whole_folder
from overtaking.data import card, manifest, plan, write
from overtaking.data.contents import contents
from overtaking.data.interruption import Terminated, termination_raises
from overtaking.data.manifest import Identity, Manifest, Provenance, ShardRecord, Source
from overtaking.data.place import Folder, Place
from overtaking.data.plan import SHARD_SIZE
from overtaking.data.recipe import Keep
from overtaking.data.refusals import asked_to_end, no_room
from overtaking.data.tables.schemas import VERSION as TABLE_VERSION
from overtaking.data.tables.unknown import schema_of
from overtaking.model.road import Road
from overtaking.model.trajectory import Trajectories

READER_VERSION = "1"
"""Changes whenever the same file gives other values."""

SIMULATOR = "recording"
"""What the manifest names where a data set was not simulated."""


class Scenes(Protocol):
    """What a reader of recordings has found."""

    def __len__(self) -> int:
        """Number of simulations."""
        ...

    @property
    def name(self) -> str:
        """What the recording calls itself."""
        ...

    @property
    def road(self) -> Road:
        """The road of all simulations."""
        ...

    @property
    def unknown(self) -> frozenset[str]:
        """What the recording does not tell."""
        ...

    @property
    def counts(self) -> dict[str, Any]:
        """What was found."""
        ...

    @property
    def notes(self) -> dict[str, Any]:
        """What was decided, left out or measured."""
        ...

    def trajectories(self, numbers: range) -> Trajectories:
        """Some of the simulations."""
        ...

    def sources(self, numbers: range) -> list[str]:
        """Where they come from."""
        ...


def write_scenes(
    scenes: Scenes,
    out: Path,
    *,
    file_format: str,
    files: Mapping[str, str],
    options: Mapping[str, Any],
    on_piece: Callable[[int, int], None] | None = None,
) -> None:
    """Write a data set of recorded scenes.

    Args:
        scenes: What was found.
        out: Folder for it; it must not exist, or be empty.
        file_format: Format of the recording.
        files: SHA-256 of each file that was read, by its name.
        options: What was asked for.
        on_piece: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: The folder holds something.
        DatasetError: It cannot be written, or the process was asked to end; nothing is left behind.
    """
    refuse_strangers(out)
    source = Source(
        format=file_format,
        files=dict(files),
        recording=scenes.name,
        options=dict(options),
        counts=scenes.counts,
        notes=scenes.notes,
    )
    try:
        with termination_raises(), whole_folder(out) as folder:
            _write(scenes, _identity(scenes, source), folder, on_piece or _silent)
    except OSError as error:
        next_step = "make room or choose another folder; nothing was written"
        error.filename = None  # It lies in a folder that is gone.
        raise no_room(out, error, next_step) from error
    except Terminated:
        next_step = "import it again; nothing was written"
        raise asked_to_end(out, "time to complete it", next_step) from None


def _identity(scenes: Scenes, source: Source) -> Identity:
    """What decides the content."""
    return Identity(
        profile=source.format,
        spec={},
        spec_hash="",
        road=scenes.road,
        seed=None,
        simulations=len(scenes),
        shard_size=SHARD_SIZE,
        keep=Keep.FRAMES,
        table_version=TABLE_VERSION,
        simulator=SIMULATOR,
        simulator_version=READER_VERSION,
        unknown=tuple(sorted(scenes.unknown)),
        source=source,
    )


def _write(
    scenes: Scenes, identity: Identity, folder: Path, on_piece: Callable[[int, int], None]
) -> None:
    """Everything that belongs into the folder."""
    tables, done = identity.keep.tables, 0
    place = Folder(folder)
    place.prepare(tables)

    def count(simulations: int) -> None:
        nonlocal done
        done += simulations
        on_piece(done, len(scenes))

    started = _now()
    records = tuple(
        write.write_shard(
            place,
            shard,
            _pieces(scenes, shard, tables),
            tables=tables,
            fingerprint=identity.fingerprint,
            on_piece=count,
            schemas={name: schema_of(name, scenes.unknown, recorded=True) for name in tables},
        )
        for shard in plan.shards(len(scenes))
    )
    _complete(place, identity, records, started)
    place.sweep()


def _pieces(
    scenes: Scenes, shard: plan.Shard, tables: tuple[str, ...]
) -> Iterator[Mapping[str, pa.Table]]:
    """The tables of a shard, as many simulations at a time as memory is meant to hold."""
    for numbers in plan.chunks(shard, plan.RECORDED_CHUNK_SIZE):
        index = np.arange(numbers.start, numbers.stop, dtype=np.int64)
        yield contents(scenes.trajectories(numbers), index, tables, scenes.sources(numbers))


def _complete(
    place: Place, identity: Identity, records: tuple[ShardRecord, ...], started: str
) -> None:
    """The data card and the manifest."""
    content = manifest.content_hash(records)
    card.write_cards(place, identity, records, content)
    complete = Manifest(
        complete=True,
        content_hash=content,
        identity=identity,
        shards=records,
        provenance=Provenance(
            started=started,
            finished=_now(),
            package=version("overtaking"),
            packages={name: version(name) for name in ("numpy", "pyarrow")},
            python=platform.python_version(),
            machine=f"{platform.system()} {platform.machine()}",
        ),
    )
    manifest.write_manifest(place, complete)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _silent(done: int, total: int) -> None:
    """Tell nobody."""
