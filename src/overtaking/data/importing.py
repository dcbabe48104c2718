"""Makes a data set from recordings: the folder appears whole, or not at all.

A recording is read before anything is written, so there is nothing to resume: the folder grows
beside its location and takes its name when it is complete.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from overtaking.core.files import atomic_folder, check_folder_is_free
from overtaking.core.progress import ProgressCallback, ProgressCounter
from overtaking.data import plan, shards
from overtaking.data.completion import complete
from overtaking.data.import_report import write_report
from overtaking.data.interruption import all_or_nothing
from overtaking.data.location import Folder
from overtaking.data.manifest import Identity, Manifest, Provenance, Source
from overtaking.data.plan import SHARD_SIZE
from overtaking.data.recipe import Keep
from overtaking.data.tables.encode_labels import contents
from overtaking.data.tables.schemas import VERSION as TABLE_VERSION
from overtaking.data.tables.schemas import schema_of

if TYPE_CHECKING:
    from overtaking.recordings.formats import Imported
    from overtaking.recordings.pinto2023_import import TableScenes
    from overtaking.recordings.scenes import Scenes as CutScenes

    Scenes = CutScenes | TableScenes

READER_VERSION = "3"
"""Changes whenever the same file gives other values."""

SIMULATOR = "recording"
"""The simulator in the manifest of an imported data set."""


def write_scenes(
    read: "Imported", out: Path, file_format: str, on_piece: ProgressCallback | None = None
) -> None:
    """Write a data set of recorded scenes.

    Args:
        read: The recording.
        out: Folder for it; it must not exist, or be empty.
        file_format: Format of the recording.
        on_piece: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: The folder holds something.
        DatasetError: It cannot be written, or the process was asked to end; nothing is left behind.
    """
    check_folder_is_free(out)
    identity = _identity(read, file_format)
    after = "import it again; nothing was written"
    with all_or_nothing(out, "time to complete it", after), atomic_folder(out) as folder:
        _write(read.scenes, identity, folder, ProgressCounter(len(read.scenes), on_piece))


def _identity(read: "Imported", file_format: str) -> Identity:
    """The identity of the data set."""
    scenes = read.scenes
    source = Source(
        format=file_format,
        files=read.files,
        recording=scenes.name,
        options=read.options,
        counts=scenes.counts,
        notes=scenes.notes,
    )
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


def _write(scenes: "Scenes", identity: Identity, folder: Path, step: ProgressCounter) -> None:
    """Write all files of the data set into a folder."""
    tables, location = identity.keep.tables, Folder(folder)
    location.prepare(tables)
    started = Manifest(
        identity=identity,
        import_report=write_report(location, scenes.import_findings),
        provenance=Provenance.of_this_run({}),
    )
    records = tuple(
        shards.write_shard(
            location,
            shard,
            _pieces(scenes, shard, tables),
            fingerprint=identity.fingerprint,
            on_piece=step,
            schemas={name: schema_of(name, scenes.unknown, recorded=True) for name in tables},
        )
        for shard in plan.shards(len(scenes))
    )
    complete(location, started, records)
    location.sweep()


def _pieces(scenes: "Scenes", shard: plan.Shard, tables: tuple[str, ...]) -> Iterator[shards.Piece]:
    """The tables of a shard, as many simulations at a time as memory is meant to hold."""
    for numbers in plan.chunks(shard, plan.RECORDED_CHUNK_SIZE):
        index = np.arange(numbers.start, numbers.stop, dtype=np.int64)
        run, sources = scenes.trajectories(numbers), scenes.sources(numbers)
        yield len(numbers), contents(run, index, tables, sources)
