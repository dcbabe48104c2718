"""Labels a data set anew: with rules that have changed, or for the first time."""

from collections.abc import Iterator
from pathlib import Path

from overtaking.core.progress import ProgressCallback, ProgressCounter
from overtaking.data import plan, shards
from overtaking.data.completion import complete
from overtaking.data.interruption import all_or_nothing
from overtaking.data.load import Dataset, load
from overtaking.data.location import Folder
from overtaking.data.recipe import Simulator
from overtaking.data.tables.encode import Numbers
from overtaking.data.tables.encode_labels import encode_labels
from overtaking.data.tables.schemas import LABEL_TABLES, schema_of
from overtaking.labels.labelling import label
from overtaking.labels.law.measurement_errors import MeasurementErrors
from overtaking.model.trajectories import Trajectories

Batches = Iterator[tuple[Numbers, Trajectories]]


def relabel(
    path: Path,
    simulator: Simulator,
    progress: ProgressCallback | None = None,
    errors: MeasurementErrors | None = None,
) -> Dataset:
    """Write the tables of labels of a data set anew, from what it recorded.

    New files wait in a folder of their own until all of them are there; only then they take the
    location of the old ones. Whatever ends the work before that changes nothing.

    Args:
        path: Its folder.
        simulator: Simulates omitted frames again.
        progress: Called with the number of simulations that are done, and of all.
        errors: Of the measurement of positions and speeds.

    Raises:
        DatasetError: There is none, it is not complete or damaged, another process writes it, or
            the process was asked to end.
        KeyboardInterrupt: Ctrl-C.
    """
    data, location = load(path, simulator), Folder(path)
    after = "label it again; it is as it was"
    with all_or_nothing(path, "time to label it", after), location.locked():
        try:
            _relabel(data, location, ProgressCounter(len(data), progress), errors)
        finally:
            location.sweep()
    return load(path, simulator)


def _relabel(
    data: Dataset, location: Folder, step: ProgressCounter, errors: MeasurementErrors | None
) -> None:
    """Write the files of all shards, then put them into place and complete the manifest."""
    planned = plan.shards(len(data), data.manifest.identity.shard_size)
    location.prepare(LABEL_TABLES)
    with location.staging() as staging:
        step(0)
        # As the import wrote them: recordings allow nulls where they lack a quantity.
        unknown = data.manifest.identity.unknown
        schemas = {name: schema_of(name, unknown) for name in LABEL_TABLES}
        batches = data.batches()
        written = [
            shards.write_files(staging, shard, _pieces(data, shard, batches, errors), schemas, step)
            for shard in planned
        ]
        for shard in planned:
            shards.put_into_place(location, staging, shard, LABEL_TABLES)
    records = tuple(
        record.model_copy(update={"tables": dict(sorted({**record.tables, **new}.items()))})
        for record, new in zip(data.manifest.shards, written, strict=True)
    )
    complete(location, data.manifest, records, data.manifest.balance)


def _pieces(
    data: Dataset, shard: plan.Shard, batches: Batches, errors: MeasurementErrors | None
) -> Iterator[shards.Piece]:
    """The tables of labels of a shard; `batches` stands at its first simulation."""
    is_balanced, count = data.manifest.identity.balance is not None, 0
    while count < shard.num_simulations:
        numbers, run = next(batches)
        # In a balanced data set the choice stays, whatever the new classes are.
        weight = data.balance_weights(*numbers[[0, -1]].tolist()) if is_balanced else None
        yield len(numbers), encode_labels(label(run, errors=errors), numbers, weight)
        count += len(numbers)
