"""Carries out a recipe: sample, simulate, write; whole shards only, and never one twice."""

import dataclasses
import platform
from collections.abc import Callable
from contextlib import closing
from datetime import UTC, datetime
from importlib.metadata import version

from overtaking.core.errors import ConfigError, DatasetError, InfeasibleError, MissingExtraError
from overtaking.data import card, lock, manifest, plan
from overtaking.data.balance_scan import Chosen, Scan
from overtaking.data.estimate import Allowed, refuse_too_large
from overtaking.data.interruption import Terminated, termination_raises
from overtaking.data.load import Dataset, load
from overtaking.data.manifest import Identity, Manifest, Provenance, ShardRecord
from overtaking.data.orders import Crew, Order, Task, here
from overtaking.data.place import PARTIAL, Place
from overtaking.data.recipe import Recipe, Simulator
from overtaking.data.refusals import no_room

Progress = Callable[[int, int], None]
"""Called with the number of simulations that are done, and of all."""

_MORE_ROOM = "make room or choose another folder; --resume goes on with what is finished"

_REFUSALS = (ConfigError, InfeasibleError, MissingExtraError)
"""What is wrong with what was asked for: the same call can never succeed."""

_OWN = frozenset({lock.FILE_NAME, PARTIAL})
"""What may lie in a folder in which nothing was begun."""


def generate(
    recipe: Recipe,
    place: Place,
    simulator: Simulator,
    *,
    crew: Crew = here,
    resume: bool = False,
    allow_large: Allowed = False,
    progress: Progress | None = None,
    on_candidates: Progress | None = None,
) -> Dataset:
    """Make a data set.

    Args:
        recipe: What to make.
        place: Where; made if missing.
        simulator: What simulates.
        crew: Who makes the shards.
        resume: Whether to complete what an earlier call has begun in this place.
        allow_large: Whether to make one that is large, or what is asked about the estimate of one
            that takes a while; what is resumed was allowed before.
        progress: Told about simulations that are done.
        on_candidates: Told about every few hundred candidates of a balanced data set, and about how
            many there will be; this comes before all simulations.

    Returns:
        The complete data set.

    Raises:
        ConfigError: The recipe cannot be carried out, or it is large and that is not allowed.
        DatasetError: The place holds something else, is too small or cannot be written, another
            process writes it, or the process was asked to end; finished shards are kept.
        KeyboardInterrupt: Ctrl-C; finished shards are kept.
    """
    _check(recipe)
    identity = Identity.of(recipe, simulator)
    progresses = (on_candidates or _silent, progress or _silent)
    order = Order(
        recipe=recipe, simulator=simulator, fingerprint=identity.fingerprint, is_resumed=resume
    )
    work = _Work(order, identity, place, progresses)
    try:
        _refuse_strangers(place)
        if not place.has(manifest.FILE_NAME):
            refuse_too_large(recipe, place, simulator, allow_large)
        with termination_raises(), place.locked():
            work.run(crew)
    except OSError as error:
        raise no_room(place, error, _MORE_ROOM) from error
    except Terminated:
        raise DatasetError(work.interrupted("SIGTERM")) from None
    except KeyboardInterrupt:
        raise KeyboardInterrupt(work.interrupted("Ctrl-C")) from None
    return load(place, simulator)


class _Work:
    """One call of `generate`."""

    def __init__(
        self, order: Order, identity: Identity, place: Place, progresses: tuple[Progress, Progress]
    ) -> None:
        self._order, self._identity, self._place = order, identity, place
        self._on_candidates, self._progress = progresses
        self._scan: Scan | None = None
        if identity.balance is not None:
            self._scan = Scan(order.recipe, identity, order.simulator, place)
        self._chosen: Chosen | None = None
        self._plan(order.recipe.num_simulations)
        self._records: dict[int, ShardRecord] = {}
        self._done = 0

    def run(self, crew: Crew) -> None:
        """Write what is missing, and the manifest."""
        begun = _begun(self._place, self._identity, resume=self._order.is_resumed)
        self._place.sweep()
        try:
            current = begun or self._first_manifest()
            if self._scan and not current.complete:
                self._save(current)  # What was begun may now look at more candidates.
            # Whoever finds the folders of tables must also find what they belong to.
            self._place.prepare(self._order.recipe.keep.tables)
            self._choose()
            self._progress(0, self._num_simulations)
            tasks = (self._task(shard, current) for shard in self._shards)
            with closing(crew(self._order, tasks, self._place, self._count)) as records:
                for record in records:
                    self._records[record.number] = record
            self._complete(current)
        except _REFUSALS:
            if begun is None and not self._records:
                self._place.remove(manifest.FILE_NAME)  # It would keep the right call out.
            raise
        finally:
            self._place.sweep()

    def _plan(self, num_simulations: int) -> None:
        self._num_simulations = num_simulations
        self._shards = plan.shards(num_simulations, self._order.recipe.shard_size)

    def _choose(self) -> None:
        """Find the candidates that a balanced data set consists of."""
        if self._scan is None:
            return
        self._chosen = self._scan.run(self._on_candidates)
        self._plan(len(self._chosen.index))

    def _task(self, shard: plan.Shard, current: Manifest) -> Task:
        """What is to be done about a shard."""
        known = current.shards[shard.number] if current.complete else None
        if self._chosen is None:
            return Task(shard=shard, known=known)
        part = slice(shard.first, shard.stop)
        index, weight = self._chosen.index[part], self._chosen.weight[part]
        return Task(shard=shard, known=known, index=index, weight=weight)

    def interrupted(self, by: str) -> str:
        """What to say when the work was ended."""
        expected, got = f"{len(self._shards)} shards", f"{len(self._records)}"
        if self._scan and not self._chosen:
            expected, got = "every quota filled", f"{self._scan.selection.candidates} candidates"
        message = DatasetError.of(
            what="data set",
            where=str(self._place),
            expected=expected,
            got=f"{got} before {by}; they are kept",
            next_step="run the same command with --resume to complete it",
        )
        return str(message)

    def _first_manifest(self) -> Manifest:
        provenance = _provenance(self._order.simulator)
        first = Manifest(identity=self._identity, provenance=provenance)
        try:
            manifest.write_manifest(self._place, first, is_first=True)
        except FileExistsError:
            raise _not_first(self._place) from None
        return first

    def _count(self, simulations: int) -> None:
        self._done += simulations
        self._progress(self._done, self._num_simulations)

    def _save(self, current: Manifest) -> None:
        manifest.write_manifest(self._place, current)

    def _complete(self, current: Manifest) -> None:
        """Say what is there, in the data card and last of all in the manifest."""
        shards = tuple(self._records[shard.number] for shard in self._shards)
        balance = self._chosen.record if self._chosen else None
        content = manifest.content_hash(shards)
        card.write_cards(self._place, self._identity, shards, content, balance)
        if current.complete and current.shards == shards:
            return
        finished = current.provenance.model_copy(update={"finished": _now()})
        changes = {"complete": True, "content_hash": content, "shards": shards}
        changes |= {"balance": balance}
        self._save(current.model_copy(update={**changes, "provenance": finished}))


def _check(recipe: Recipe) -> None:
    """Refuse numbers that no data set can have."""
    most = min(plan.MAX_SHARDS * max(recipe.shard_size, 1), plan.MAX_SIMULATIONS)
    several = "make several data sets, each with a seed of its own"
    limits = (
        ("shard_size", recipe.shard_size, 1, plan.MAX_SIMULATIONS, None),
        ("simulations", recipe.num_simulations, 1, most, several),
        ("seed", recipe.seed, 0, 2**64 - 1, None),
    )
    for what, value, low, high, remedy in limits:
        if not low <= value <= high:
            raise ConfigError.of(
                what=what,
                where="generate",
                expected=f"{low} to {high}",
                got=value,
                next_step=remedy if remedy and value > high else "choose a number in that range",
            )


def _refuse_strangers(place: Place) -> None:
    """Refuse a place that holds something other than a data set, before anything is touched."""
    try:
        names = place.names()
    except NotADirectoryError:
        got = "a file"
    else:
        if manifest.FILE_NAME in names or names <= _OWN:
            return
        got = f"a folder with {min(names - _OWN)}"
    raise DatasetError.of(
        what="folder",
        where=str(place),
        expected="an empty folder or a data set",
        got=got,
        next_step="choose another folder",
    )


def _not_first(place: Place) -> DatasetError:
    """What to say where another process has begun a data set in the meantime."""
    return DatasetError.of(
        what="data set",
        where=str(place),
        expected="no other process that begins one",
        got="one that was faster",
        next_step="choose another place, or complete the same data set with --resume",
    )


def _begun(place: Place, identity: Identity, *, resume: bool) -> Manifest | None:
    """The manifest of what an earlier call has begun here, if this call may go on with it."""
    if not place.has(manifest.FILE_NAME):
        return None
    begun = manifest.read_manifest(place)
    if not begun.complete and _looks_further(begun.identity, identity):
        begun = begun.model_copy(update={"identity": identity})
    if different := begun.identity.differences(identity):
        name = different[0]
        ours, theirs = (_shown(one, name) for one in (identity, begun.identity))
        raise DatasetError.of(
            what=f"{name} of the data set",
            where=str(place),
            expected=ours,
            got=theirs,
            next_step=begun.how_to_simulate
            if name == "simulator_version"
            else "choose another folder, or ask for what it was begun with",
        )
    if not resume:
        raise DatasetError.of(
            what="data set",
            where=str(place),
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
