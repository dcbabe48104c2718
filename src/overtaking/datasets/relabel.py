"""Labels a data set anew: with rules that have changed, or for the first time."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

from overtaking.datasets import card, lock, manifest, plan, write
from overtaking.datasets.interruption import Terminated, termination_raises
from overtaking.datasets.load import Dataset, load
from overtaking.datasets.recipe import Simulator
from overtaking.datasets.refusals import asked_to_end, no_room
from overtaking.labelling import label
from overtaking.model.trajectory import Trajectories
from overtaking.tables.encode import Numbers
from overtaking.tables.encode_labels import Weights, encode_labels
from overtaking.tables.files import FileFacts, TableWriter, sync_folder
from overtaking.tables.label_schemas import LABEL_TABLES

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
        with termination_raises(), lock.locked(path):
            return _Work(data, path, simulator, progress or _silent).run()
    except OSError as error:
        raise no_room(path, error, "make room and label it again; it is as it was") from error
    except Terminated:
        next_step = "label it again; it is as it was"
        raise asked_to_end(path, "time to label it", next_step) from None


class _Work:
    """One call of `relabel`."""

    def __init__(self, data: Dataset, path: Path, simulator: Simulator, progress: Progress) -> None:
        self._data, self._path, self._simulator = data, path, simulator
        self._progress = progress
        self._done = 0
        self._shards = plan.shards(len(data), data.manifest.identity.shard_size)

    def run(self) -> Dataset:
        write.make_folders(self._path, [write.PARTIAL, *LABEL_TABLES])
        try:
            self._progress(0, len(self._data))
            batches = self._data.batches()
            facts = [self._write(shard, batches) for shard in self._shards]
            self._put_into_place()
            self._complete(facts)
        finally:
            self._sweep()
        return load(self._path, self._simulator)

    def _write(
        self, shard: plan.Shard, batches: Iterator[tuple[Numbers, Trajectories]]
    ) -> dict[str, FileFacts]:
        """The unfinished files of a shard; `batches` stands at its first simulation."""
        with ExitStack() as stack:
            writers = {
                name: stack.enter_context(TableWriter(self._unfinished(name, shard), name))
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

    def _unfinished(self, table: str, shard: plan.Shard) -> Path:
        return self._path / write.PARTIAL / f"{table}-{shard.file_name}"

    def _put_into_place(self) -> None:
        for shard in self._shards:
            for name in LABEL_TABLES:
                self._unfinished(name, shard).replace(write.path_of(self._path, name, shard))
        for name in LABEL_TABLES:
            sync_folder(self._path / name)

    def _complete(self, facts: list[dict[str, FileFacts]]) -> None:
        """Say in the manifest and the data card what is there now."""
        before = self._data.manifest
        shards = tuple(
            record.model_copy(update={"tables": dict(sorted({**record.tables, **new}.items()))})
            for record, new in zip(before.shards, facts, strict=True)
        )
        content = manifest.content_hash(shards)
        after = before.model_copy(update={"shards": shards, "content_hash": content})
        partial = self._path / write.PARTIAL
        card.write_cards(self._path, partial, before.identity, shards, content, before.balance)
        manifest.write_manifest(self._path, after, partial)

    def _count(self, simulations: int) -> None:
        self._done += simulations
        self._progress(self._done, len(self._data))

    def _sweep(self) -> None:
        for path in (self._path / write.PARTIAL).iterdir():
            path.unlink()
        (self._path / write.PARTIAL).rmdir()


def _silent(done: int, total: int) -> None:
    """Tell nobody."""
