"""Labels a data set anew: with rules that have changed, or for the first time."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

from overtaking.data import plan, shards
from overtaking.data.completion import complete
from overtaking.data.interruption import all_or_nothing
from overtaking.data.load import Dataset, load
from overtaking.data.place import Folder
from overtaking.data.progress import Counter, Progress
from overtaking.data.recipe import Simulator
from overtaking.data.tables.encode import Numbers
from overtaking.data.tables.encode_labels import encode_labels
from overtaking.data.tables.files import FileFacts, TableWriter
from overtaking.data.tables.schemas import LABEL_TABLES
from overtaking.labels.label import label
from overtaking.model.trajectory import Trajectories

Batches = Iterator[tuple[Numbers, Trajectories]]


def relabel(path: Path, simulator: Simulator, progress: Progress | None = None) -> Dataset:
    """Write the tables of labels of a data set anew, from what it recorded.

    New files wait in a folder of their own until all of them are there; only then they take the
    place of the old ones. Whatever ends the work before that changes nothing.

    Args:
        path: Its folder.
        simulator: Simulates again what was not kept.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        DatasetError: There is none, it is not complete or damaged, another process writes it, or
            the process was asked to end.
        KeyboardInterrupt: Ctrl-C.
    """
    data, place = load(path, simulator), Folder(path)
    after = "label it again; it is as it was"
    with all_or_nothing(path, "time to label it", after), place.locked():
        try:
            _relabel(data, place, Counter(len(data), progress))
        finally:
            place.sweep()
    return load(path, simulator)


def _relabel(data: Dataset, place: Folder, counter: Counter) -> None:
    """Write the files of all shards, then put them into place and complete the manifest."""
    planned = plan.shards(len(data), data.manifest.identity.shard_size)
    place.prepare(LABEL_TABLES)
    with place.staging() as staging:
        counter.add(0)
        batches = data.batches()
        written = [_write(data, shard, batches, staging, counter) for shard in planned]
        for shard in planned:
            shards.put_into_place(place, staging, shard, LABEL_TABLES)
    records = tuple(
        record.model_copy(update={"tables": dict(sorted({**record.tables, **new}.items()))})
        for record, new in zip(data.manifest.shards, written, strict=True)
    )
    complete(place, data.manifest, records, data.manifest.balance)


def _write(
    data: Dataset, shard: plan.Shard, batches: Batches, staging: Path, counter: Counter
) -> dict[str, FileFacts]:
    """The unfinished files of a shard; `batches` stands at its first simulation."""
    with ExitStack() as stack:
        writers = {
            name: stack.enter_context(TableWriter(shards.unfinished(staging, name, shard), name))
            for name in LABEL_TABLES
        }
        count = 0
        while count < shard.num_simulations:
            numbers, run = next(batches)
            # In a balanced data set the choice stays, whatever the new classes are.
            is_balanced = data.manifest.identity.balance is not None
            weight = data.class_weights(*numbers[[0, -1]].tolist()) if is_balanced else None
            tables = encode_labels(label(run), numbers, weight)
            for name, writer in writers.items():
                writer.write(tables[name])
            count += len(numbers)
            counter.add(len(numbers))
        return {name: writer.finish() for name, writer in writers.items()}
