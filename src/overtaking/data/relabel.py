"""Labels a data set anew: with rules that have changed, or for the first time."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

from overtaking.data import card, manifest, plan, write
from overtaking.data.interruption import Terminated, termination_raises
from overtaking.data.load import Dataset, load
from overtaking.data.place import Folder, Place
from overtaking.data.recipe import Simulator
from overtaking.data.refusals import asked_to_end, no_room
from overtaking.data.tables.encode import Numbers
from overtaking.data.tables.encode_labels import Weights, encode_labels
from overtaking.data.tables.files import FileFacts, TableWriter
from overtaking.data.tables.label_schemas import LABEL_TABLES
from overtaking.labels.label import label
from overtaking.model.trajectory import Trajectories

Progress = Callable[[int, int], None]


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
    data = load(path, simulator)
    try:
        with termination_raises(), Folder(path).locked():
            _Work(data, Folder(path), progress or _silent).run()
    except OSError as error:
        raise no_room(path, error, "make room and label it again; it is as it was") from error
    except Terminated:
        next_step = "label it again; it is as it was"
        raise asked_to_end(path, "time to label it", next_step) from None
    return load(path, simulator)


class _Work:
    """One call of `relabel`."""

    def __init__(self, data: Dataset, place: Place, progress: Progress) -> None:
        self._data, self._place, self._progress = data, place, progress
        self._done = 0
        self._shards = plan.shards(len(data), data.manifest.identity.shard_size)

    def run(self) -> None:
        self._place.prepare(LABEL_TABLES)
        try:
            with self._place.staging() as staging:
                self._progress(0, len(self._data))
                batches = self._data.batches()
                facts = [self._write(shard, batches, staging) for shard in self._shards]
                self._put_into_place(staging)
                self._complete(facts)
        finally:
            self._place.sweep()

    def _write(
        self, shard: plan.Shard, batches: Iterator[tuple[Numbers, Trajectories]], staging: Path
    ) -> dict[str, FileFacts]:
        """The unfinished files of a shard; `batches` stands at its first simulation."""
        with ExitStack() as stack:
            writers = {
                name: stack.enter_context(TableWriter(_unfinished(staging, name, shard), name))
                for name in LABEL_TABLES
            }
            written = 0
            while written < shard.num_simulations:
                numbers, run = next(batches)
                tables = encode_labels(label(run), numbers, self._weight(numbers))
                for name, writer in writers.items():
                    writer.write(tables[name])
                written += len(numbers)
                self._count(len(numbers))
            return {name: writer.finish() for name, writer in writers.items()}

    def _weight(self, numbers: Numbers) -> Weights | None:
        """The weights of a balanced data set: what was chosen stays chosen, whatever it is now."""
        if self._data.manifest.identity.balance is None:
            return None
        return self._data.class_weights(int(numbers[0]), int(numbers[-1]))

    def _put_into_place(self, staging: Path) -> None:
        for shard in self._shards:
            for name in LABEL_TABLES:
                self._place.put(_unfinished(staging, name, shard), write.name_of(name, shard))

    def _complete(self, facts: list[dict[str, FileFacts]]) -> None:
        """Say in the manifest and the data card what is there now."""
        before = self._data.manifest
        shards = tuple(
            record.model_copy(update={"tables": dict(sorted({**record.tables, **new}.items()))})
            for record, new in zip(before.shards, facts, strict=True)
        )
        content = manifest.content_hash(shards)
        after = before.model_copy(update={"shards": shards, "content_hash": content})
        card.write_cards(self._place, before.identity, shards, content, before.balance)
        manifest.write_manifest(self._place, after)

    def _count(self, simulations: int) -> None:
        self._done += simulations
        self._progress(self._done, len(self._data))


def _unfinished(staging: Path, table: str, shard: plan.Shard) -> Path:
    return staging / f"{table}-{shard.file_name}"


def _silent(done: int, total: int) -> None:
    """Tell nobody."""
