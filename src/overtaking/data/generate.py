"""Carries out a recipe: sample, simulate, label, write; whole shards only, and none of them twice.

recipe, shards (`plan`), tasks (`work`), executor (`executors`), files (`shards`), manifest.
"""

import dataclasses
from contextlib import closing
from pathlib import Path

from overtaking.core.errors import ConfigError, DatasetError, InfeasibleError, MissingExtraError
from overtaking.core.process_limits import MORE_MEMORY, check_memory
from overtaking.core.progress import ProgressCallback, ProgressCounter
from overtaking.data import lock, manifest, plan
from overtaking.data.balance_scan import Chosen, Scan
from overtaking.data.completion import complete
from overtaking.data.estimate import Allowed, refuse_too_large
from overtaking.data.interruption import Terminated, cannot_write, termination_raises
from overtaking.data.load import Dataset, load
from overtaking.data.location import PARTIAL, Location
from overtaking.data.manifest import Identity, Manifest, Provenance, ShardRecord
from overtaking.data.recipe import Keep, Recipe, Simulator
from overtaking.data.work import Executor, Job, Task, in_this_process

_MORE_ROOM = "make room or choose another folder; --resume goes on with what is finished"

_REFUSALS = (ConfigError, InfeasibleError, MissingExtraError)
"""Errors of a call that can never succeed."""

_OWN = frozenset({lock.FILE_NAME, PARTIAL})
"""Files that an unused folder may hold."""


def generate(
    recipe: Recipe,
    location: Location,
    simulator: Simulator,
    *,
    executor: Executor = in_this_process,
    resume: bool = False,
    allow_large: Allowed = False,
    progress: ProgressCallback | None = None,
    on_candidates: ProgressCallback | None = None,
) -> Dataset:
    """Make a data set.

    Args:
        recipe: The data set to make.
        location: Where; made if missing.
        simulator: What simulates.
        executor: Makes the shards.
        resume: Whether to complete what an earlier call has begun in this location.
        allow_large: Whether to make a large one; or a function that decides, given the estimate of
            one that takes a while. What is resumed was allowed before.
        progress: Called with the number of simulations that are done, and of all.
        on_candidates: Called every few hundred candidates of a balanced data set, with their number
            and an estimate of how many there will be; all that comes before the simulations.

    Returns:
        The complete data set.

    Raises:
        ConfigError: The recipe cannot be carried out, or it is large and that is not allowed.
        DatasetError: The location holds something else, is too small or cannot be written, another
            process writes it, or the process was asked to end; finished shards are kept.
        KeyboardInterrupt: Ctrl-C; finished shards are kept.
        SystemLimitError: The system grants too little memory, or too few threads or processes.
    """
    _check(recipe)
    identity = Identity.of(recipe, simulator)
    job = Job(
        recipe=recipe, simulator=simulator, fingerprint=identity.fingerprint, is_resumed=resume
    )
    run = _Run(job, identity, location)
    try:
        _refuse_strangers(location)
        if not location.has(manifest.FILE_NAME):
            refuse_too_large(recipe, location, simulator, allow_large)
        if executor is in_this_process:  # Workers have limits of their own.
            _check_memory(recipe, simulator)
        with termination_raises(), location.locked():
            run.run(executor, progress, on_candidates)
    except OSError as error:
        raise cannot_write(location, error, _MORE_ROOM) from error
    except Terminated:
        raise DatasetError(run.interrupted("SIGTERM")) from None
    except KeyboardInterrupt:
        raise KeyboardInterrupt(run.interrupted("Ctrl-C")) from None
    return load(location, simulator)


def _check_memory(recipe: Recipe, simulator: Simulator) -> None:
    """Refuse a data set of which this process cannot hold the chunks that are made at a time.

    Raises:
        SystemLimitError: The system grants less memory.
    """
    spec, keeps_frames = recipe.spec.to_dict(), recipe.keep is Keep.FRAMES
    size = plan.batch_size(spec, simulator.chunk_size, keeps_frames=keeps_frames)
    chunk = min(size, recipe.num_simulations, recipe.shard_size)
    threads = min(simulator.threads, -(-recipe.num_simulations // chunk))
    check_memory(plan.working_bytes(spec, chunk, threads), "generate", MORE_MEMORY)


class _Run:
    """One call of `generate`."""

    def __init__(self, job: Job, identity: Identity, location: Location) -> None:
        self._job, self._identity, self._location = job, identity, location
        self._scan = (
            Scan(job.recipe, identity, job.simulator, location) if identity.balance else None
        )
        self._chosen: Chosen | None = None
        self._count = job.recipe.num_simulations
        self._records: dict[int, ShardRecord] = {}

    @property
    def _shards(self) -> tuple[plan.Shard, ...]:
        return plan.shards(self._count, self._job.recipe.shard_size)

    def run(
        self,
        executor: Executor,
        progress: ProgressCallback | None,
        on_candidates: ProgressCallback | None,
    ) -> None:
        """Write the missing shards, and the manifest."""
        begun = _begun(self._location, self._identity, resume=self._job.is_resumed)
        self._location.sweep()
        try:
            current = begun or self._first_manifest()
            if self._scan and not current.complete:
                # A resumed data set may now try more candidates.
                manifest.write_manifest(self._location, current)
            # The manifest comes first: tables without a manifest are not resumed.
            self._location.prepare(self._job.recipe.tables)
            if self._scan:
                self._chosen = self._scan.run(on_candidates)
                self._count = len(self._chosen.index)
            self._make_shards(executor, current, ProgressCounter(self._count, progress))
            balance = self._chosen.record if self._chosen else None
            records = tuple(self._records[shard.number] for shard in self._shards)
            complete(self._location, current, records, balance)
        except _REFUSALS:
            if begun is None and not self._records:
                # The manifest of a call that cannot succeed would keep the right call out.
                self._location.remove(manifest.FILE_NAME)
            raise
        finally:
            self._location.sweep()

    def _make_shards(self, executor: Executor, current: Manifest, step: ProgressCounter) -> None:
        step(0)
        tasks = (self._task(shard, current) for shard in self._shards)
        with closing(executor(self._job, tasks, self._location, step)) as records:
            for record in records:
                self._records[record.number] = record

    def _task(self, shard: plan.Shard, current: Manifest) -> Task:
        known = current.shards[shard.number] if current.complete else None
        if self._chosen is None:
            return Task(shard=shard, known=known)
        part = slice(shard.first, shard.stop)
        index, weight = self._chosen.index[part], self._chosen.weight[part]
        return Task(shard=shard, known=known, index=index, weight=weight)

    def interrupted(self, by: str) -> str:
        """The message after the work was ended."""
        expected, got = f"{len(self._shards)} shards", f"{len(self._records)}"
        if self._scan and not self._chosen:
            expected, got = "every quota filled", f"{self._scan.selection.candidates} candidates"
        message = DatasetError(
            what="data set",
            where=str(self._location),
            expected=expected,
            got=f"{got} before {by}; they are kept",
            next_step="run the same command with --resume to complete it",
        )
        return str(message)

    def _first_manifest(self) -> Manifest:
        """The manifest of a data set that begins now, written.

        Raises:
            DatasetError: Another process has begun one here in the meantime.
        """
        provenance = Provenance.of_this_run(self._job.simulator.details)
        first = Manifest(identity=self._identity, provenance=provenance)
        try:
            manifest.write_manifest(self._location, first, is_first=True)
        except FileExistsError:
            raise DatasetError(
                what="data set",
                where=str(self._location),
                expected="no other process that begins one",
                got="one that was faster",
                next_step="choose another location, or complete the same data set with --resume",
            ) from None
        return first


def _check(recipe: Recipe) -> None:
    """Refuse numbers that no data set can have."""
    most = min(plan.MAX_SHARDS * max(recipe.shard_size, 1), plan.MAX_SIMULATIONS)
    several = "make several data sets, each with a seed of its own"
    limits = (
        ("shard_size", recipe.shard_size, 1, plan.MAX_SIMULATIONS, ""),
        ("simulations", recipe.num_simulations, 1, most, several),
        ("seed", recipe.seed, 0, 2**64 - 1, ""),
    )
    for what, value, low, high, remedy in limits:
        if not low <= value <= high:
            next_step = remedy if value > high else ""
            raise ConfigError.out_of_range(
                what=what, where="generate", low=low, high=high, got=value, next_step=next_step
            )


def _refuse_strangers(location: Location) -> None:
    """Refuse a location that holds something other than a data set, before anything is touched."""
    try:
        names = location.names()
    except NotADirectoryError as error:
        got = "a file" if Path(str(location)).is_file() else error.strerror
    else:
        if manifest.FILE_NAME in names or names <= _OWN:
            return
        got = f"a folder with {min(names - _OWN)}"
    raise DatasetError(
        what="folder",
        where=str(location),
        expected="an empty folder or a data set",
        got=got,
        next_step="choose another folder",
    )


def _begun(location: Location, identity: Identity, *, resume: bool) -> Manifest | None:
    """The manifest of an earlier call in this location, if this call may continue it."""
    if not location.has(manifest.FILE_NAME):
        return None
    begun = manifest.read_manifest(location)
    if not begun.complete and _looks_further(begun.identity, identity):
        begun = begun.model_copy(update={"identity": identity})
    if different := begun.identity.differences(identity):
        # Another model explains all other differences.
        name = "simulator_version" if "simulator_version" in different else different[0]
        ours, theirs = (_shown(one, name) for one in (identity, begun.identity))
        raise DatasetError(
            what=f"{name} of the data set",
            where=str(location),
            expected=ours,
            got=theirs,
            next_step=begun.how_to_simulate
            if name == "simulator_version"
            else "choose another folder, or ask for what it was begun with",
        )
    if not resume:
        raise DatasetError(
            what="data set",
            where=str(location),
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
