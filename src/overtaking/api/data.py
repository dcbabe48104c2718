"""Data sets: generate, resume, load and label them again."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.api.choices import BRANCHING, SIMULATORS, Profile, road_of, simulator_of
from overtaking.api.driving import driver_record, simulator_with_driver
from overtaking.api.rules import load_pack
from overtaking.api.simulating import label
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
from overtaking.data.verdicts import written
from overtaking.labels.label import LabelledTrajectories
from overtaking.labels.law import MeasurementErrors, Pack
from overtaking.model.checks import check_arguments
from overtaking.model.road import Road
from overtaking.scenarios import profiles, sampler
from overtaking.sim.driving import Driver


@check_arguments
def generate_dataset(
    profile: Profile,
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
            simulated again when it is asked for.
        resume: Whether to complete what an earlier call has begun in this folder.
        overrides: Dotted keys of the specification with other values, as in `reading.spec`.
        road: A road instead of the profile's: a name, an OpenDRIVE file, or a `Road`.
        simulator: One of `SIMULATORS`.
        driver: A driver of one's own for every ego, with one of `BRANCHING`; this process alone
            calls it.
        shard_size: Simulations a file; what suits the simulator if left out.
        balance: Which classes get equal shares, and the treatment of a class that is too rare;
            None for natural shares.
        executor: One of `EXECUTORS`: the threads of this process, processes of this machine, or
            those of a Ray cluster; `auto` takes processes for a large data set in a
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
            written, another process writes it, or the process was asked to end. Finished shards are
            kept, and `resume` goes on.
        KeyboardInterrupt: Ctrl-C; the same holds.
    """
    spec = profiles.load_specification(profile, overrides)
    chosen = simulator_of(simulator) if driver is None else simulator_with_driver(driver, simulator)
    recipe = Recipe(
        spec=spec,
        road=sampler.extend_road(spec, road_of(road or spec.road)),
        seed=seed,
        num_simulations=num_simulations,
        keep=_keep(keep),
        shard_size=chosen.shard_size if shard_size is None else shard_size,
        balance=balance,
        policy=None if driver is None else driver_record(driver),
    )
    location = location_of(out)
    return writing.generate(
        recipe,
        location,
        chosen,
        executor=executor_for_recipe(
            executor, recipe, chosen, location, address=address, workers=workers
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
        executor: As in `generate_dataset`; it may differ from that of the earlier calls.
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
    begun = read_manifest(location_of(out)).identity
    if begun.seed is None:
        raise DatasetError(
            what="data set",
            where=str(out),
            expected="one that was generated",
            got=f"one that was imported from {begun.profile}",
            next_step="import it again into another folder",
        )
    if begun.branches:
        raise DatasetError(
            what="data set",
            where=str(out),
            expected="one that was generated",
            got="one of branches, which are written whole",
            next_step="branch again into another folder",
        )
    if begun.policy is not None:
        raise DatasetError(
            what="data set",
            where=str(out),
            expected="one whose egos the model drives",
            got=f"one that {begun.policy.name} drives",
            next_step="complete it with that driver: overtaking drive --resume",
        )
    return generate_dataset(
        begun.spec,
        num_simulations=begun.simulations,
        seed=begun.seed,
        out=out,
        keep=begun.keep,
        resume=True,
        road=begun.road,
        simulator=begun.simulator,
        shard_size=begun.shard_size,
        balance=begun.balance,
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
        DatasetError: There is none, or it is not complete.
        SchemaError: It is of a newer version.
    """
    if isinstance(path, Dataset):
        return path
    location = location_of(path)
    by = read_manifest(location).identity.simulator
    is_foreign = by in SIMULATORS and by not in BRANCHING
    return reading.load(location, simulator_of(by if is_foreign else "engine"))


@check_arguments
def relabel_dataset(
    data: str | Path,
    *,
    errors: MeasurementErrors | None = None,
    progress: ProgressCallback | None = None,
) -> Dataset:
    """Write the labels of a data set again, by the rules of this version.

    Args:
        data: Folder of the data set.
        errors: As in `label`. The column `rule_set` names the standard deviations.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        DatasetError: There is none, it is not complete or damaged, or another process writes it.
        SchemaError: It is of a newer version.
    """
    from overtaking.data.relabel import relabel as written_anew

    return written_anew(folder_of(data, "label anew"), simulator_of("engine"), progress, errors)


@check_arguments
def judged(
    data: Dataset | str | Path,
    law: str | Pack,
    *,
    policies: Sequence[str] | None = None,
    out: str | Path | None = None,
    errors: MeasurementErrors | None = None,
    progress: ProgressCallback | None = None,
) -> Iterator[tuple[NDArray[np.int64], LabelledTrajectories]]:
    """Judge a data set by another law or other policies; nothing in it changes.

    Args:
        data: The data set, or its folder.
        law: A pack of rules, or the text that `rules.load_pack` takes.
        policies: As in `label`.
        out: A Parquet file of the verdicts, written as the batches are taken; None for none.
        errors: As in `label`.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        Numbers of simulations and their labels, batch by batch.

    Raises:
        ConfigError: There is no such law or policy.
        DatasetError: The data set is not complete, or damaged.
    """
    source, pack = load_dataset(data), load_pack(law)

    def batches() -> Iterator[tuple[NDArray[np.int64], LabelledTrajectories]]:
        done = 0
        for numbers, run in source.batches():
            yield numbers, label(run, law=pack, policies=policies, errors=errors)
            done += len(numbers)
            if progress is not None:
                progress(done, len(source))

    return batches() if out is None else written(batches(), pack.name, Path(out))


def _keep(name: str) -> Keep:
    try:
        return Keep(name)
    except ValueError:
        raise ConfigError.unknown_choice(
            what="keep", where="generate", choices=Keep, got=name
        ) from None
