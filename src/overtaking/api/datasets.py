"""Public functions that make, complete, load, relabel and query data sets.

A *data set* is a folder (or a URL in a cloud store) of Parquet tables with many simulations of one
ego, the vehicle whose overtaking is studied, in traffic. Simulations are numbered from 0.
*Manifest*: the file `dataset.json` in it, which records how the data set was made.
*Profile*: a named setting of road, traffic, weather and drivers that comes with the package, such
as `motorway`; *specification*: the same content as an object, or as a TOML file of the user.
*Shard*: a block of consecutive simulations, written as one file per table.
*Class*: the result of a simulation, such as `Success_L` (completed, legal); a *policy* is the set
of rules of law that decides between legal and illegal: `paper`, `default` or `strict`.

`check_arguments` raises a `ConfigError` for an argument of another type than its annotation.
Functions import the modules that few users need, so that importing the package is fast.
"""

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
from overtaking.data.balance import ClassBalance
from overtaking.data.estimate import Allowed
from overtaking.data.executors import EXECUTORS, executor_for_recipe
from overtaking.data.generate import generate as carry_out_recipe
from overtaking.data.load import Dataset
from overtaking.data.load import load as open_dataset
from overtaking.data.location import folder_of, location_of
from overtaking.data.manifest import read_manifest
from overtaking.data.recipe import Keep, Recipe
from overtaking.labels.law.measurement_errors import MeasurementErrors
from overtaking.model.checks import check_arguments
from overtaking.model.road import Road
from overtaking.recordings.roads import resolve_road
from overtaking.scenarios import profiles, sampler
from overtaking.sim.external_driver import Driver

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
    """Generate a data set: draw scenarios, simulate and label them, and write the tables.

    The same arguments give the same bytes, whatever `executor` and `workers` are.

    Args:
        profile: Name of a profile, path of a TOML file, or a specification.
        num_simulations: Number of simulations, 1 or more.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        out: Folder for the data set, made if missing, or its URL in a store, such as
            `s3://bucket/data`.
        keep: `frames` writes all tables; `features` omits the tables with a row per recorded
            instant (positions and speeds), which are most of the size. Where they are needed later,
            the simulation is computed again.
        resume: Whether to complete a data set that an interrupted call began in this folder.
        overrides: New values of keys of the specification, such as
            `{"traffic.vehicles": "2..6"}`.
        road: A road instead of the profile's: a name, an OpenDRIVE file, or a `Road`.
        simulator: A name in `SIMULATORS`: `engine` is this package's own model.
        driver: A driver of the user that controls every ego instead of the model's driver. It needs
            the simulator `engine` or `reference`, and is called in this process only.
        shard_size: Number of simulations in a shard, 1 or more; None for the simulator's own, 4096
            for `engine`, a choice. After an interruption at most one shard per process is computed
            again.
        balance: Classes that get equal numbers of simulations, and whether a class that is too rare
            is an error; None for the classes as they come.
        executor: A name in `EXECUTORS`: `threads` of this process, `processes` of this machine,
            `ray` for a Ray cluster; `auto`, the first name and the default, takes processes for a
            data set in a folder with enough shards to gain by them, else threads: the access to a
            store may have been set up in this process alone.
        address: Only for `ray`. Address `HOST:PORT` of a Ray cluster; None starts one on this
            machine for the duration of the call.
        workers: Number of processes, not for `threads` or with `address`; None for one per core.
            `auto` with a number means `processes`.
        allow_large: Whether the data set may exceed 10 GB or 1,000,000 simulations; the limits are
            choices. Instead of True or False a function may decide: before anything is written, it
            gets the `Estimate` of size and time, and returns whether to go on. The estimate comes
            from a sample of 64 simulations, with slow simulators fewer. A data set smaller than 64
            such samples is begun without an estimate, which would take a good part of its time.
        progress: Called with the number of simulations that are done, and of all.
        on_candidates: Only with `balance`. Called with the number of candidates that were simulated
            to find the rare classes, and the expected number of candidates; this search precedes
            the simulations that `progress` counts.

    Returns:
        The complete data set.

    Raises:
        ConfigError: An argument cannot be used, there is no such cluster, or the data set would be
            large and `allow_large` does not permit it.
        MissingExtraError: Ray, or the package for this kind of store, is not installed.
        DatasetError: The disk is too small, the folder holds other files or is not writable,
            another process writes the data set, or this process received SIGTERM. Finished shards
            stay, and `resume` continues after them.
        KeyboardInterrupt: The user pressed Ctrl-C; finished shards stay as well.
    """
    spec = profiles.load_specification(profile, overrides)
    used_simulator = (
        get_simulator(simulator) if driver is None else simulator_with_driver(driver, simulator)
    )
    recipe = Recipe(
        spec=spec,
        # A two-way road becomes as long as oncoming vehicles need during the simulated time.
        road=sampler.extend_road(spec, resolve_road(road or spec.road)),
        seed=seed,
        num_simulations=num_simulations,
        keep=_parse_keep(keep),
        shard_size=used_simulator.shard_size if shard_size is None else shard_size,
        balance=balance,
        # The field is stored in manifests: there `policy` means the driver of the egos, as in
        # reinforcement learning, not a set of rules.
        policy=None if driver is None else driver_record(driver),
    )
    location = location_of(out)
    return carry_out_recipe(
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
    """Complete a data set whose generation was interrupted, with the settings in its manifest.

    A complete data set is checked; shards with damaged files are written again.

    Args:
        out: Folder of the data set, or its URL.
        executor: As in `generate_dataset`; the interrupted call may have used another one.
        address: As in `generate_dataset`.
        workers: As in `generate_dataset`.
        progress: Called with the number of simulations that are done, and of all.
        on_candidates: As in `generate_dataset`.

    Returns:
        The complete data set.

    Raises:
        DatasetError: There is no manifest, or the data set is one that this function cannot
            continue: imported, of branches, or with a driver of the user. Also in all cases in
            which `generate_dataset` raises it.
        SchemaError: A newer version of the package began the data set.
    """
    identity = read_manifest(location_of(out)).identity
    if identity.seed is None:  # Recorded traffic has no random numbers.
        raise DatasetError(
            what="data set",
            where=str(out),
            expected="one that was generated",
            got=f"one that was imported from {identity.profile}",
            next_step="import it again into another folder",
        )
    if identity.branches:  # Simulations with a change, made by `whatif.save_branches`.
        raise DatasetError(
            what="data set",
            where=str(out),
            expected="one that was generated",
            got="one of branches, which are written whole",
            next_step="branch again into another folder",
        )
    if identity.policy is not None:  # A driver of the user, whose function is not stored.
        raise DatasetError(
            what="data set",
            where=str(out),
            expected="one whose egos the model drives",
            got=f"one that {identity.policy.name} drives",
            next_step="complete it with that driver: overtaking drive --resume",
        )
    # `allow_large` is left out: with `resume=True` the size is not checked again.
    return generate_dataset(
        identity.spec,
        num_simulations=identity.simulations,
        seed=identity.seed,
        out=out,
        keep=identity.keep,
        resume=True,
        road=identity.road,  # The interrupted call has extended it, so it is long enough.
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
        path: Its folder, or its URL in a store. Files of a store are copied to this machine when
            they are first read, and removed when the data set is no longer in use. A `Dataset` is
            returned unchanged, so callers may accept both.

    Raises:
        DatasetError: The folder holds no data set, or the data set is not complete.
        MissingExtraError: The data set was made by a simulator that is not installed.
        SchemaError: A newer version of the package wrote the data set.
    """
    if isinstance(path, Dataset):
        return path
    location = location_of(path)
    # A data set needs a simulator to compute again the tables that it did not keep: the simulator
    # that made them, or the engine for `reference`, because both give the same bits. A driver of
    # the user is not asked again: its actions were kept. Imported recordings (`recording`) keep all
    # tables, so the engine is passed but never used.
    name = read_manifest(location).identity.simulator
    is_other_simulator = name in SIMULATORS and name not in MODEL_SIMULATORS
    return open_dataset(location, get_simulator(name if is_other_simulator else "engine"))


@check_arguments
def relabel_dataset(
    dataset: str | Path,
    *,
    errors: MeasurementErrors | None = None,
    progress: ProgressCallback | None = None,
) -> Dataset:
    """Replace the labels of a data set by those that this version of the package computes.

    Labels are the tables with events, verdicts of the law, classes and features. Positions and
    speeds do not change. If the call fails, the old labels stay.

    Args:
        dataset: Folder of the data set; one in a store cannot be relabelled.
        errors: Standard deviations of the positions [m] and speeds [m/s] that the recording states;
            None for exact ones. The column `rule_set` records them. Each rule computes from them
            the standard error of its margin, the distance to its limit. Where the margin is smaller
            than two standard errors (95 % confidence), the rule is undecidable.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        The data set with its new labels.

    Raises:
        ConfigError: The data set is in a store, or another simulator made it and its positions and
            speeds were not kept.
        DatasetError: The folder holds no data set, the data set is not complete or damaged, or
            another process writes it.
        SchemaError: A newer version of the package wrote the data set.
    """
    from overtaking.data.relabel import relabel

    # `folder_of` refuses a URL; its second argument completes the message "a folder to ...".
    folder = folder_of(dataset, "label anew")
    identity = read_manifest(location_of(folder)).identity
    # The engine computes positions that were not kept; it cannot do so for another simulator.
    if identity.keep != Keep.FRAMES and identity.simulator not in MODEL_SIMULATORS:
        raise ConfigError(
            what="data set",
            where=str(folder),
            expected="one that keeps frames, or one of the engine",
            got=f"one of {identity.simulator} that keeps {identity.keep}",
            next_step="generate it again with --keep frames",
        )
    return relabel(folder, get_simulator("engine"), progress, errors)


def _parse_keep(name: str) -> Keep:
    """The member of `Keep` for the argument `keep` of `generate_dataset`.

    Raises:
        ConfigError: There is no such member.
    """
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
    """Answer an SQL query (DuckDB's dialect) about a data set.

    The query can read the tables of the data set and nothing else; it changes nothing.

    Args:
        dataset: The data set, or its folder or URL.
        query: One SELECT, DESCRIBE, SUMMARIZE or SHOW. Tables have their names in the data set,
            such as `simulations` or `labels`. The entities of the paper that the package reproduces
            (Pinto, Dutra and Fonseca 2023) are views, such as `paper.EgoVehicle`.
        max_rows: Largest number of rows of the answer, 1 to 1e9.
        timeout_s: Longest time of the query [s], 0.001 to 1e9.
        memory_mib: Memory limit of the database [MiB], 16 to 1e9. An answer larger than an eighth
            of it is an error (a choice: this process holds an answer several times).

    Returns:
        `columns`, the names of the columns; `rows`, a list of tuples; and `is_cut`, whether the
        answer has more rows than `max_rows`.

    Raises:
        ConfigError: The text is not a query of these kinds, is wrong, or exceeds a limit.
        DatasetError: The data set is not complete or damaged.
        MissingExtraError: The extra `sql` is not installed.
    """
    from overtaking.analysis.database.query import query as run_query

    source = load_dataset(dataset)
    return run_query(source, query, max_rows=max_rows, timeout_s=timeout_s, memory_mib=memory_mib)
