"""Carries out a recipe: sample, simulate, write; whole shards only, and never one twice."""

import dataclasses
import platform
import shutil
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pyarrow as pa

from overtaking.core.errors import ConfigError, DatasetError
from overtaking.datasets import card, lock, manifest, plan, write
from overtaking.datasets.ahead import in_order
from overtaking.datasets.balance_scan import Chosen, Scan
from overtaking.datasets.contents import contents
from overtaking.datasets.interruption import Terminated, termination_raises
from overtaking.datasets.load import Dataset, load
from overtaking.datasets.manifest import Identity, Manifest, Provenance, ShardRecord
from overtaking.datasets.recipe import Recipe, Simulator
from overtaking.datasets.refusals import no_room
from overtaking.scenarios import sample
from overtaking.tables.unknown import schema_of

Progress = Callable[[int, int], None]
"""Called with the number of simulations that are done, and of all."""

MAX_SIMULATIONS = 10**12
"""More than anyone has disks for; a number beyond it is a slip."""

_MORE_ROOM = "make room or choose another folder; --resume goes on with what is finished"

_OWN = frozenset({lock.FILE_NAME, write.PARTIAL})
"""What may lie in a folder in which nothing was begun."""


def generate(
    recipe: Recipe,
    out: Path,
    simulator: Simulator,
    *,
    resume: bool = False,
    progress: Progress | None = None,
    on_candidates: Progress | None = None,
) -> Dataset:
    """Make a data set.

    Args:
        recipe: What to make.
        out: Folder for it; made if missing.
        simulator: What simulates.
        resume: Whether to complete what an earlier call has begun in this folder.
        progress: Told about every few hundred simulations.
        on_candidates: Told about every few hundred candidates of a balanced data set, and about how
            many there will be; this comes before all simulations.

    Returns:
        The complete data set.

    Raises:
        ConfigError: The recipe cannot be carried out.
        DatasetError: The folder holds something else, cannot be written, or another process
            writes it, or the process was asked to end; finished shards are kept.
        KeyboardInterrupt: Ctrl-C; finished shards are kept.
    """
    _check(recipe)
    identity = Identity.of(recipe, simulator)
    progresses = (on_candidates or _silent, progress or _silent)
    work = _Work(recipe, identity, simulator, out, progresses)
    try:
        _refuse_strangers(out)
        out.mkdir(parents=True, exist_ok=True)
        with termination_raises(), lock.locked(out):
            work.run(resume=resume)
    except OSError as error:
        raise no_room(out, error, _MORE_ROOM) from error
    except Terminated:
        raise DatasetError(work.interrupted("SIGTERM")) from None
    except KeyboardInterrupt:
        raise KeyboardInterrupt(work.interrupted("Ctrl-C")) from None
    return load(out, simulator)


class _Work:
    """One call of `generate`."""

    def __init__(
        self,
        recipe: Recipe,
        identity: Identity,
        simulator: Simulator,
        out: Path,
        progresses: tuple[Progress, Progress],
    ) -> None:
        self._recipe, self._identity, self._simulator = recipe, identity, simulator
        self._out, (self._on_candidates, self._progress) = out, progresses
        self._tables = recipe.keep.tables
        self._fingerprint = identity.fingerprint
        self._scan: Scan | None = None
        if identity.balance is not None:
            self._scan = Scan(recipe, identity, simulator, out, out / write.PARTIAL)
        self._chosen: Chosen | None = None
        self._num_simulations = recipe.num_simulations
        self._shards = plan.shards(recipe.num_simulations, recipe.shard_size)
        self._records: list[ShardRecord] = []
        self._done = 0

    def run(self, *, resume: bool) -> None:
        """Write what is missing, and the manifest."""
        begun = _begun(self._out, self._identity, resume=resume)
        _sweep(self._out)
        try:
            write.make_folders(self._out, [write.PARTIAL])
            current = begun or self._first_manifest()
            if self._scan and not current.complete:
                self._save(current)  # What was begun may now look at more candidates.
            # Whoever finds the folders of tables must also find what they belong to.
            write.make_folders(self._out, self._tables)
            self._choose()
            self._progress(0, self._num_simulations)
            for shard in self._shards:
                known = self._finished(shard, current) if resume else None
                self._records.append(known or self._write(shard))
            self._complete(current)
        finally:
            _sweep(self._out)

    def _choose(self) -> None:
        """Find the candidates that a balanced data set consists of."""
        if self._scan is None:
            return
        self._chosen = self._scan.run(self._on_candidates)
        self._num_simulations = len(self._chosen.index)
        self._shards = plan.shards(self._num_simulations, self._recipe.shard_size)

    def interrupted(self, by: str) -> str:
        """What to say when the work was ended."""
        expected, got = f"{len(self._shards)} shards", f"{len(self._records)}"
        if self._scan and not self._chosen:
            expected, got = "every quota filled", f"{self._scan.selection.candidates} candidates"
        message = DatasetError.of(
            what="data set",
            where=str(self._out),
            expected=expected,
            got=f"{got} before {by}; they are kept",
            next_step="run the same command with --resume to complete it",
        )
        return str(message)

    def _first_manifest(self) -> Manifest:
        first = Manifest(identity=self._identity, provenance=_provenance(self._simulator))
        self._save(first)
        return first

    def _finished(self, shard: plan.Shard, current: Manifest) -> ShardRecord | None:
        """What is known of a shard of an earlier call, if it is there and as it was written."""
        known = write.finished_shard(
            self._out, shard, tables=self._tables, fingerprint=self._fingerprint
        )
        if known is None or (current.complete and current.shards[shard.number] != known):
            return None
        self._count(shard.num_simulations)
        return known

    def _write(self, shard: plan.Shard) -> ShardRecord:
        return write.write_shard(
            self._out,
            shard,
            self._pieces(shard),
            tables=self._tables,
            fingerprint=self._fingerprint,
            on_piece=self._count,
            schemas={name: schema_of(name, self._simulator.unknown) for name in self._tables},
        )

    def _pieces(self, shard: plan.Shard) -> Iterator[Mapping[str, pa.Table]]:
        """The tables of a shard, as many simulations at a time as memory is meant to hold."""
        size = plan.batch_size(self._recipe.spec.resolved(), self._simulator.chunk_size)
        return in_order(self._piece, plan.chunks(shard, size), self._simulator.threads)

    def _piece(self, chunk: range) -> Mapping[str, pa.Table]:
        numbers = np.arange(chunk.start, chunk.stop)
        index = numbers.astype(np.uint64) if self._chosen is None else self._chosen.index[numbers]
        scenario = sample(self._recipe.spec, self._recipe.road, self._recipe.seed, index)
        run = self._simulator.simulate(scenario)
        weight = scenario.weight
        if self._chosen is not None:
            weight = weight * self._chosen.weight[numbers]
        return contents(run, numbers, self._tables, class_weight=weight)

    def _count(self, simulations: int) -> None:
        self._done += simulations
        self._progress(self._done, self._num_simulations)

    def _save(self, current: Manifest) -> None:
        manifest.write_manifest(self._out, current, self._out / write.PARTIAL)

    def _complete(self, current: Manifest) -> None:
        """Say what is there, in the data card and last of all in the manifest."""
        shards = tuple(self._records)
        balance = self._chosen.record if self._chosen else None
        content = manifest.content_hash(shards)
        partial = self._out / write.PARTIAL
        card.write_cards(self._out, partial, self._identity, shards, content, balance)
        if current.complete and current.shards == shards:
            return
        finished = current.provenance.model_copy(update={"finished": _now()})
        changes = {"complete": True, "content_hash": content, "shards": shards}
        changes |= {"balance": balance}
        self._save(current.model_copy(update={**changes, "provenance": finished}))


def _check(recipe: Recipe) -> None:
    """Refuse numbers that no data set can have."""
    limits = (
        ("simulations", recipe.num_simulations, 1, MAX_SIMULATIONS),
        ("seed", recipe.seed, 0, 2**64 - 1),
        ("shard_size", recipe.shard_size, 1, MAX_SIMULATIONS),
    )
    for what, value, low, high in limits:
        if not low <= value <= high:
            raise ConfigError.of(
                what=what,
                where="generate",
                expected=f"{low} to {high}",
                got=value,
                next_step="choose a number in that range",
            )


def _refuse_strangers(out: Path) -> None:
    """Refuse a path that holds something other than a data set, before anything is touched."""
    if out.is_dir():
        names = {path.name for path in out.iterdir()}
        if manifest.FILE_NAME in names or names <= _OWN:
            return
        got = f"a folder with {min(names - _OWN)}"
    elif out.exists():
        got = "a file"
    else:
        return
    raise DatasetError.of(
        what="folder",
        where=str(out),
        expected="an empty folder or a data set",
        got=got,
        next_step="choose another folder",
    )


def _begun(out: Path, identity: Identity, *, resume: bool) -> Manifest | None:
    """The manifest of what an earlier call has begun here, if this call may go on with it."""
    if not (out / manifest.FILE_NAME).exists():
        return None
    begun = manifest.read_manifest(out)
    if not begun.complete and _looks_further(begun.identity, identity):
        begun = begun.model_copy(update={"identity": identity})
    if different := begun.identity.differences(identity):
        name = different[0]
        ours, theirs = (_shown(one, name) for one in (identity, begun.identity))
        raise DatasetError.of(
            what=f"{name} of the data set",
            where=str(out),
            expected=ours,
            got=theirs,
            next_step="choose another folder, or ask for what it was begun with",
        )
    if not resume:
        raise DatasetError.of(
            what="data set",
            where=str(out),
            expected="an empty folder",
            got="one that is complete" if begun.complete else "one that is not finished",
            next_step="choose another folder" if begun.complete else "complete it with --resume",
        )
    return begun


def _looks_further(begun: Identity, now: Identity) -> bool:
    """Whether the same balanced data set is asked for, with at least as many candidates."""
    if not (begun.balance and now.balance):
        return False
    before, after = begun.balance, now.balance
    end = {"candidates": after.candidates, "allows_missing": after.allows_missing}
    same = begun.model_copy(update={"balance": dataclasses.replace(before, **end)}) == now
    return same and (after.candidates or 0) >= (before.candidates or 0)


def _shown(identity: Identity, name: str) -> object:
    """A part of an identity, short enough for a message."""
    if name == "spec":
        return identity.spec_hash[:12]
    return identity.road.name if name == "road" else str(getattr(identity, name))


def _sweep(out: Path) -> None:
    """Remove what is not finished; it cannot be used by anyone."""
    shutil.rmtree(out / write.PARTIAL, ignore_errors=True)


def _provenance(simulator: Simulator) -> Provenance:
    return Provenance(
        started=_now(),
        package=version("overtaking"),
        packages={name: version(name) for name in ("numpy", "pyarrow")},
        python=platform.python_version(),
        machine=f"{platform.system()} {platform.machine()}",
        details=dict(simulator.details),
    )


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _silent(done: int, total: int) -> None:
    """Tell nobody."""
