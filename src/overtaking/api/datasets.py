"""Data sets: generate, resume, load and label them again, and query them in SQL."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from overtaking.api.simulating import driver_record, simulator_with_driver
from overtaking.api.simulator_registry import (
    MODEL_SIMULATORS,
    SIMULATORS,
    ProfileSource,
    get_simulator,
)
from overtaking.core.errors import ConfigError, DatasetError
from overtaking.core.progress import ProgressCallback
from overtaking.data import generate as writing
from overtaking.data import load as reading
from overtaking.data.balance import ClassBalance
from overtaking.data.estimate import Allowed
from overtaking.data.executors import EXECUTORS, executor_for_recipe
from overtaking.data.load import Dataset
from overtaking.data.location import folder_of, location_of
from overtaking.data.manifest import read_manifest
from overtaking.data.recipe import Keep, Recipe
from overtaking.labels.law import MeasurementErrors
from overtaking.model.checks import check_arguments
from overtaking.model.road import Road
from overtaking.recordings.roads import resolve_road
from overtaking.scenarios import profiles, sampler
from overtaking.sim.driving import Driver

if TYPE_CHECKING:
    from overtaking.analysis.database.query import Answer


@check_arguments
def generate_dataset(
    profile: ProfileSource,
    *,
    num_simulations: int,
    seed: int,
    out: str | Path,
    keep: str = Keep.FRAMES,
    resume: bool = False,
    overrides: Mapping[str, Any] | None = None,
    road: str | Path | Road | None = None,
    simulator: str = "engine",
    driver: Driver | None = None,
    shard_size: int | None = None,
    balance: ClassBalance | None = None,
    executor: str = EXECUTORS[0],
    address: str | None = None,
    workers: int | None = None,
    allow_large: Allowed = False,
    progress: ProgressCallback | None = None,
    on_candidates: ProgressCallback | None = None,
) -> Dataset:
    """Make a data set.

    Args:
        profile: Name of a profile of the package, path of a TOML file, or a specification.
        num_simulations: Number of simulations.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        out: Folder for the data set, made if missing, or its URL in a store, such as
            `s3://bucket/data`.
        keep: `frames` writes everything; `features` leaves out what has a row per frame, which is
            simulated again on demand.
        resume: Whether to complete what an earlier call has begun in this folder.
        overrides: Dotted keys of the specification with other values, as in `reading.spec`.
        road: A road instead of the profile's: a name, an OpenDRIVE file, or a `Road`.
        simulator: One of `SIMULATORS`.
        driver: A driver of one's own for every ego, with one of `MODEL_SIMULATORS`; only this
            process calls it.
        shard_size: Number of simulations in a file; a size that suits the simulator if left out.
        balance: Which classes get equal shares, and the treatment of a class that is too rare;
            None for natural shares.
        executor: One of `EXECUTORS`: the threads of this process, processes of this machine, or
            processes of a Ray cluster; `auto` takes processes for a large data set in a
            folder. The files are the same.
        address: Of a Ray cluster; None for one on this machine, as long as the work lasts.
        workers: Processes on this machine; one on each core if left out.
        allow_large: Whether more than 10 GB or 1,000,000 simulations may be made. Or a function
            that is given the `Estimate` of every data set that takes a while, before anything is
            written, and says so.
        progress: Called with the number of simulations that are done, and of all.
        on_candidates: Called with the number of candidates of a balanced data set that have been
            looked at, and about how many there will be; all that comes before the simulations.

    Returns:
        The complete data set.

    Raises:
        ConfigError: The specification, a number, the executor or the cluster cannot be used, or the
            data set would be large and `allow_large` is not given.
        MissingExtraError: Ray, or what reaches the store, is not installed.
        DatasetError: It does not fit on the disk, the folder holds something else or cannot be
            written, another process writes it, or the process received a signal to end. Finished
            shards are kept, and `resume` goes on.
        KeyboardInterrupt: Ctrl-C; the same holds.
    """
    spec = profiles.load_specification(profile, overrides)
    used_simulator = (
        get_simulator(simulator) if driver is None else simulator_with_driver(driver, simulator)
    )
    recipe = Recipe(
        spec=spec,
        road=sampler.extend_road(spec, resolve_road(road or spec.road)),
        seed=seed,
        num_simulations=num_simulations,
        keep=_keep(keep),
        shard_size=used_simulator.shard_size if shard_size is None else shard_size,
        balance=balance,
        policy=None if driver is None else driver_record(driver),
    )
    location = location_of(out)
    return writing.generate(
        recipe,
        location,
        used_simulator,
        executor=executor_for_recipe(
            executor, recipe, used_simulator, location, address=address, workers=workers
        ),
        resume=resume,
        allow_large=allow_large,
        progress=progress,
        on_candidates=on_candidates,
    )


@check_arguments
def resume_dataset(
    out: str | Path,
    *,
    executor: str = EXECUTORS[0],
    address: str | None = None,
    workers: int | None = None,
    progress: ProgressCallback | None = None,
    on_candidates: ProgressCallback | None = None,
) -> Dataset:
    """Complete a data set from what its manifest says, or check that it is complete.

    Args:
        out: Folder of the data set, or its URL.
        executor: As in `generate_dataset`; each call may choose another.
        address: As in `generate_dataset`.
        workers: As in `generate_dataset`.
        progress: Called with the number of simulations that are done, and of all.
        on_candidates: As in `generate_dataset`.

    Returns:
        The complete data set; shards that were damaged are written again.

    Raises:
        DatasetError: Nothing was begun there, or as in `generate`.
        SchemaError: It was begun by a newer version.
    """
    identity = read_manifest(location_of(out)).identity
    if identity.seed is None:
        raise DatasetError(
            what="data set",
            where=str(out),
            expected="one that was generated",
            got=f"one that was imported from {identity.profile}",
            next_step="import it again into another folder",
        )
    if identity.branches:
        raise DatasetError(
            what="data set",
            where=str(out),
            expected="one that was generated",
            got="one of branches, which are written whole",
            next_step="branch again into another folder",
        )
    if identity.policy is not None:
        raise DatasetError(
            what="data set",
            where=str(out),
            expected="one whose egos the model drives",
            got=f"one that {identity.policy.name} drives",
            next_step="complete it with that driver: overtaking drive --resume",
        )
    return generate_dataset(
        identity.spec,
        num_simulations=identity.simulations,
        seed=identity.seed,
        out=out,
        keep=identity.keep,
        resume=True,
        road=identity.road,
        simulator=identity.simulator,
        shard_size=identity.shard_size,
        balance=identity.balance,
        executor=executor,
        address=address,
        workers=workers,
        progress=progress,
        on_candidates=on_candidates,
    )


@check_arguments
def load_dataset(path: str | Path | Dataset) -> Dataset:
    """Load a complete data set.

    Args:
        path: Its folder, or its URL in a store; of that, files are copied to this machine when
            they are first read, and for as long as the data set is in use. A data set is returned
            as it is.

    Raises:
        DatasetError: The folder holds no data set, or the data set is not complete.
        SchemaError: It is of a newer version.
    """
    if isinstance(path, Dataset):
        return path
    location = location_of(path)
    name = read_manifest(location).identity.simulator
    is_foreign = name in SIMULATORS and name not in MODEL_SIMULATORS
    return reading.load(location, get_simulator(name if is_foreign else "engine"))


@check_arguments
def relabel_dataset(
    dataset: str | Path,
    *,
    errors: MeasurementErrors | None = None,
    progress: ProgressCallback | None = None,
) -> Dataset:
    """Write the labels of a data set again, by the rules of this version.

    Args:
        dataset: Folder of the data set.
        errors: As in `label`. The column `rule_set` names the standard deviations.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        DatasetError: The folder holds no data set, the data set is not complete or damaged, or
            another process writes it.
        SchemaError: It is of a newer version.
    """
    from overtaking.data.relabel import relabel as written_anew

    return written_anew(folder_of(dataset, "label anew"), get_simulator("engine"), progress, errors)


def _keep(name: str) -> Keep:
    try:
        return Keep(name)
    except ValueError:
        raise ConfigError.unknown_choice(
            what="keep", where="generate", choices=Keep, got=name
        ) from None


@check_arguments
def sql(
    dataset: str | Path | Dataset,
    query: str,
    *,
    max_rows: int = 10_000,
    timeout_s: float = 60.0,
    memory_mib: int = 1024,
) -> "Answer":
    """Ask a data set a question in SQL (DuckDB's), which reads its tables and nothing else.

    Args:
        dataset: The data set, or its folder.
        query: One SELECT, DESCRIBE, SUMMARIZE or SHOW. The tables have their own names; the source
            paper's entities are views, such as `paper.EgoVehicle`.
        max_rows: How many rows to give at most.
        timeout_s: How long it may take [s].
        memory_mib: How much memory the database may use [MiB]; the answer may take an eighth of it.

    Returns:
        Names of the columns, the rows, and whether there are more.

    Raises:
        ConfigError: It is no query, is wrong, or needs more time or memory than it may.
        DatasetError: The data set is not complete or damaged.
        MissingExtraError: The extra `sql` is not installed.
    """
    from overtaking.analysis.database import query as asking

    source = load_dataset(dataset)
    return asking.query(
        source, query, max_rows=max_rows, timeout_s=timeout_s, memory_mib=memory_mib
    )
