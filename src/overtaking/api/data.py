"""Data sets: made, completed, loaded, labelled anew, imported and exported."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking import scenarios
from overtaking.api.choices import BRANCHING, SIMULATORS, Profile, road_of, simulator_of
from overtaking.api.driving import driven_by, record_of
from overtaking.api.rules import load_pack
from overtaking.api.simulating import MOST_ERROR, errors_of, label
from overtaking.core.errors import ConfigError, DatasetError
from overtaking.core.steps import Progress
from overtaking.data import generate as writing
from overtaking.data import load as reading
from overtaking.data.balance import Balance
from overtaking.data.estimate import Allowed
from overtaking.data.executors import ENGINES, executor_of
from overtaking.data.load import Dataset
from overtaking.data.manifest import read_manifest
from overtaking.data.place import folder_of, place_of
from overtaking.data.recipe import Keep, Recipe
from overtaking.data.verdicts import written
from overtaking.labels.label import Labelled
from overtaking.labels.law import Pack
from overtaking.model.checks import argument, checked
from overtaking.model.road import Road
from overtaking.model.trajectory import Trajectories
from overtaking.model.values import Range
from overtaking.recordings import export as recording_export
from overtaking.sim.driving import Driver

EXPORTS = ("pinto2023", "commonroad", "highd", "asp", "prolog", "popper")
"""The formats that a data set can be written in."""

_OF_FACTS = ("every", "with_law")
_EXPORT_OPTIONS = {"asp": _OF_FACTS, "prolog": _OF_FACTS, "popper": ("about",)}
"""The options that some formats have."""

_READER_OPTIONS: dict[str, Any] = {
    "attempts_only": bool,
    "vehicles": int,
    "lanelet": int | None,
    "direction": int | None,
    "road": str | Path | Road | None,
    "columns": str | Path | Mapping[str, Any],
    "only": Mapping[str, str],
    "smooth": bool,
}
"""Types of the options of the readers of recordings."""


@checked
def generate(
    profile: Profile,
    simulations: int,
    seed: int,
    out: str | Path,
    *,
    keep: str = Keep.FRAMES,
    resume: bool = False,
    overrides: Mapping[str, Any] | None = None,
    road: str | Path | Road | None = None,
    simulator: str = "engine",
    driver: Driver | None = None,
    shard_size: int | None = None,
    balance: Balance | None = None,
    engine: str = ENGINES[0],
    address: str | None = None,
    workers: int | None = None,
    allow_large: Allowed = False,
    progress: Progress | None = None,
    on_candidates: Progress | None = None,
) -> Dataset:
    """Make a data set.

    Args:
        profile: What to sample.
        simulations: How many simulations.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        out: Folder for the data set, made if missing, or its URL in a store, such as
            `s3://bucket/data`.
        keep: `frames` writes everything; `features` leaves out what has a row per frame, which is
            simulated again when it is asked for.
        resume: Whether to complete what an earlier call has begun in this folder.
        overrides: Dotted keys of the specification with other values, as in `scenarios.spec`.
        road: A road in place of the profile's: a name, an OpenDRIVE file, or a `Road`.
        simulator: One of `SIMULATORS`.
        driver: A policy in the place of every ego's driver, with one of `BRANCHING`; asked by this
            process alone.
        shard_size: Simulations a file; what suits the simulator if left out.
        balance: Which classes get equal shares, and the treatment of a class that is too rare;
            None for natural shares.
        engine: Who makes it, one of `ENGINES`: the threads of this process, processes of this
            machine, or those of a Ray cluster; `auto` takes processes for a large data set in a
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
        ConfigError: The specification, a number, the engine or the cluster cannot be used, or the
            data set would be large and `allow_large` is not given.
        MissingExtraError: Ray, or what reaches the store, is not installed.
        DatasetError: It does not fit on the disk, the folder holds something else or cannot be
            written, another process writes it, or the process was asked to end. Finished shards are
            kept, and `resume` goes on.
        KeyboardInterrupt: Ctrl-C; the same holds.
    """
    spec = scenarios.spec(profile, overrides)
    chosen = simulator_of(simulator) if driver is None else driven_by(driver, simulator)
    recipe = Recipe(
        spec=spec,
        road=road_of(road or spec.road),
        seed=seed,
        num_simulations=simulations,
        keep=_keep(keep),
        shard_size=chosen.shard_size if shard_size is None else shard_size,
        balance=balance,
        policy=None if driver is None else record_of(driver),
    )
    place = place_of(out)
    return writing.generate(
        recipe,
        place,
        chosen,
        executor=executor_of(engine, recipe, chosen, place, address=address, workers=workers),
        resume=resume,
        allow_large=allow_large,
        progress=progress,
        on_candidates=on_candidates,
    )


@checked
def resume(
    out: str | Path,
    *,
    engine: str = ENGINES[0],
    address: str | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
    on_candidates: Progress | None = None,
) -> Dataset:
    """Complete a data set from what its manifest says, or check that it is complete.

    Args:
        out: Folder of the data set, or its URL.
        engine: As in `generate`; it may differ from that of the earlier calls.
        address: As in `generate`.
        workers: As in `generate`.
        progress: Called with the number of simulations that are done, and of all.
        on_candidates: As in `generate`.

    Returns:
        The complete data set; shards that were damaged are written again.

    Raises:
        DatasetError: Nothing was begun there, or as in `generate`.
        SchemaError: It was begun by a newer version.
    """
    begun = read_manifest(place_of(out)).identity
    if begun.seed is None:
        raise DatasetError.of(
            what="data set",
            where=str(out),
            expected="one that was generated",
            got=f"one that was imported from {begun.profile}",
            next_step="import it again into another folder",
        )
    if begun.branches:
        raise DatasetError.of(
            what="data set",
            where=str(out),
            expected="one that was generated",
            got="one of branches, which are written whole",
            next_step="branch again into another folder",
        )
    if begun.policy is not None:
        raise DatasetError.of(
            what="data set",
            where=str(out),
            expected="one without a policy",
            got=f"one that {begun.policy.name} drives",
            next_step="complete it with that policy: overtaking drive --resume",
        )
    return generate(
        begun.spec,
        begun.simulations,
        begun.seed,
        out,
        keep=begun.keep,
        resume=True,
        road=begun.road,
        simulator=begun.simulator,
        shard_size=begun.shard_size,
        balance=begun.balance,
        engine=engine,
        address=address,
        workers=workers,
        progress=progress,
        on_candidates=on_candidates,
    )


@checked
def load(path: str | Path | Dataset) -> Dataset:
    """A complete data set.

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
    place = place_of(path)
    by = read_manifest(place).identity.simulator
    is_foreign = by in SIMULATORS and by not in BRANCHING
    return reading.load(place, simulator_of(by if is_foreign else "engine"))


@checked
def relabel(
    data: str | Path,
    *,
    position_error: Annotated[float, Range(0.0, MOST_ERROR)] = 0.0,
    speed_error: Annotated[float, Range(0.0, MOST_ERROR)] = 0.0,
    progress: Progress | None = None,
) -> Dataset:
    """Write the labels of a data set anew, by the rules of this version.

    Args:
        data: Folder of the data set.
        position_error: Standard deviation of recorded positions, as in `label` [m]. The column
            `rule_set` names it.
        speed_error: Of recorded speeds [m/s].
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        DatasetError: There is none, it is not complete or damaged, or another process writes it.
        SchemaError: It is of a newer version.
    """
    from overtaking.data.relabel import relabel as written_anew

    errors = errors_of(position_error, speed_error)
    return written_anew(folder_of(data, "label anew"), simulator_of("engine"), progress, errors)


@checked
def judged(
    data: Dataset | str | Path,
    law: str | Pack,
    *,
    policies: Sequence[str] | None = None,
    out: str | Path | None = None,
    position_error: Annotated[float, Range(0.0, MOST_ERROR)] = 0.0,
    speed_error: Annotated[float, Range(0.0, MOST_ERROR)] = 0.0,
    progress: Progress | None = None,
) -> Iterator[tuple[NDArray[np.int64], Labelled]]:
    """A data set under another law or other policies; it stays as it is.

    Args:
        data: The data set, or its folder.
        law: A pack of rules, or the text that `rules.load_pack` takes.
        policies: As in `label`.
        out: A Parquet file of the verdicts, written as the batches are taken; None for none.
        position_error: As in `label` [m].
        speed_error: As in `label` [m/s].
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        Numbers of simulations and their labels, batch by batch.

    Raises:
        ConfigError: There is no such law or policy.
        DatasetError: The data set is not complete, or damaged.
    """
    source, pack = load(data), load_pack(law)
    errors = {"position_error": position_error, "speed_error": speed_error}

    def batches() -> Iterator[tuple[NDArray[np.int64], Labelled]]:
        done = 0
        for numbers, run in source.batches():
            yield numbers, label(run, law=pack, policies=policies, **errors)
            done += len(numbers)
            if progress is not None:
                progress(done, len(source))

    return batches() if out is None else written(batches(), pack.name, Path(out))


@checked
def export(
    data: Dataset | str | Path,
    out: str | Path,
    *,
    file_format: str = EXPORTS[0],
    simulations: Iterable[int] | None = None,
    label: str | None = None,
    policy: str = "paper",
    progress: Progress | None = None,
    **options: Any,
) -> int:
    """Write simulations of a data set in the format of another program or paper.

    Args:
        data: The data set, or its folder.
        out: The paper's table is a file that ends in `.csv` or `.parquet`, replaced as a whole;
            the other formats are a folder, which must not exist or be empty, with one scenario or
            recording for each simulation; of `asp` and `prolog` with files of facts and a theory,
            of `popper` with its three files.
        file_format: One of `EXPORTS`.
        simulations: Numbers of the simulations to write, all by default.
        label: A class that they must have, such as `Success_L`.
        policy: The policy that decides about the class: `paper`, `default` or `strict`.
        progress: Called with the number of simulations that are done, and of all.
        options: Of `asp` and `prolog`: `every` is every how many frames positions are written;
            `with_law=True` writes what only the law reads, too. Of `popper`: `about` is `legal`,
            `collision` or `start`.

    Returns:
        Number of rows, states or facts written.

    Raises:
        ConfigError: There is no such format, simulation, class or policy, no simulation is left,
            the name does not fit the format, or the folder is taken.
        DatasetError: The data set is not complete, or damaged.
        OSError: The file cannot be written.
    """
    target = folder_of(out, "export to")
    _refuse_options(file_format, options)
    source = load(data)
    numbers = _chosen(source, simulations, label, policy)
    if file_format in ("asp", "prolog"):
        return _export_facts(source, target, file_format, numbers, progress, **options)
    if file_format == "popper":
        return _export_popper(source, target, numbers, policy, **options)
    total = len(source) if numbers is None else len(numbers)
    if file_format in recording_export.FORMATS:
        return recording_export.write_folder(
            source.batches(numbers),
            target,
            file_format=file_format,
            total=total,
            road=source.road,
            progress=progress,
        )
    from overtaking.recordings import pinto2023  # It loads pandas, which nothing else here needs.

    def tables() -> Iterator[pa.Table]:
        done = 0
        for some, trajectories in source.batches(numbers):
            yield pinto2023.to_table(trajectories, some)
            done += len(some)
            if progress is not None:
                progress(done, total)

    return pinto2023.write_table(tables(), target)


def _chosen(
    data: Dataset, simulations: Iterable[int] | None, label: str | None, policy: str
) -> NDArray[np.int64] | None:
    """The simulations to write, None for all.

    Raises:
        ConfigError: There is no such simulation, class or policy, or none is left.
    """
    from overtaking.data.choice import chosen

    found = chosen(data, simulations, label, policy)
    if found is not None and not found.size:
        raise ConfigError.of(
            what="simulations",
            where="export",
            expected="at least one",
            got=f"none of class {label}" if label else "none",
            next_step="choose others; overtaking stats counts the classes",
        )
    return found


def _refuse_options(file_format: str, options: Mapping[str, Any]) -> None:
    """Refuse an unknown format, and an option that the format does not have."""
    if file_format not in EXPORTS:
        raise ConfigError.not_among("format", "export", EXPORTS, file_format)
    known = _EXPORT_OPTIONS.get(file_format, ())
    for name in sorted(set(options) - set(known)):
        raise ConfigError.of(
            what=f"option {name}",
            where=f"export to {file_format}",
            expected=", ".join(known) or "none of those that some formats have",
            got=options[name],
            next_step="leave it out",
        )


@checked
def _export_facts(
    data: Dataset,
    out: Path,
    language: str,
    numbers: Any,
    progress: Progress | None,
    *,
    every: int = 10,
    with_law: bool = False,
) -> int:
    """Write chosen simulations as facts; see `export`."""
    from overtaking.analysis.logic.export import write_facts

    return write_facts(
        data,
        out,
        language=language,
        chosen=numbers,
        every=every,
        with_law=with_law,
        progress=progress,
    )


@checked
def _export_popper(
    data: Dataset,
    out: Path,
    numbers: Any,
    policy: str,
    *,
    about: str = "legal",
) -> int:
    """Write what a data set holds about a target for the learner Popper; see `export`."""
    from overtaking.analysis.learning.examples import examples_of
    from overtaking.analysis.learning.popper import write_popper
    from overtaking.analysis.learning.targets import target_of

    target, examples = target_of(about), examples_of(data, policy)
    if numbers is not None:
        examples = examples.where(np.isin(examples.simulations, numbers))
    return write_popper(examples, target, out)


@checked
def import_recording(
    file_format: str,
    path: str | Path,
    out: str | Path,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> Dataset:
    """Make a data set of a recording of others: every overtake in it becomes a simulation.

    Args:
        file_format: `commonroad` (XML 2018b or 2020a), `exid`, `highd`, `ngsim`, `pinto2023` (the
            paper's table) or `table` (any columns).
        path: The file; of exiD and highD its `_tracks.csv`.
        out: Folder for the data set; it must not exist, or be empty.
        progress: Called with the number of simulations that are done, and of all.
        options: `attempts_only=True` leaves out vehicles that follow and never move left, and
            `vehicles` is how many a simulation has at most (both not for `pinto2023`); `lanelet`
            chooses a road of a CommonRoad file, `direction` (1, 2) one of highD, `road` (a `Road`)
            is where a table was recorded. `columns` is the map of a table: a name, a TOML file, or
            its content; `only` maps columns to the value that they must have.
            `smooth=True` smooths tracks as Thiemann et al. (2008) do those of NGSIM.

    Returns:
        The complete, labelled data set; its manifest counts what was found and measured.

    Raises:
        ConfigError: There is no such format, an option is not for it, or the folder is taken.
        ImportFormatError: The file cannot be used; the message names line and element or column.
        DatasetError: The folder cannot be written. Nothing is left behind.
    """
    from overtaking.data.importing import write_scenes
    from overtaking.recordings.formats import read_recording

    for name, value in options.items():
        argument(value, _READER_OPTIONS.get(name, Any), "import_recording", name)
    target = folder_of(out, "import to")
    read = read_recording(file_format, path, options)
    write_scenes(read, target, file_format, progress)
    return load(target)


@checked
def from_frame(
    table: Any,
    *,
    columns: str | Path | Mapping[str, Any],
    road: str | Path | Road | None = None,
    attempts_only: bool = False,
    vehicles: int = 16,
) -> Trajectories:
    """The overtakes in a table of states; called as `Trajectories.from_frame`.

    Args:
        table: A row per vehicle and instant: a pandas or Arrow table, or a mapping of columns.
        columns: Which column holds what, with units: the name of a map, a TOML file, its content,
            or its section `columns` such as `{"vehicle": "id", "time": "t [s]", "x": "x [m]"}`.
        road: The road in the axes of the table: a name, an OpenDRIVE file, or a `Road`. If left
            out, what the map says of it; what that leaves open is inferred from the traffic.
        attempts_only: Whether vehicles that follow and never move left are left out.
        vehicles: Vehicles of a simulation at most.

    Returns:
        A simulation for each overtake, and for each vehicle that follows another; `unknown` says
        what the table does not tell.

    Raises:
        ConfigError: The map or the road cannot be used.
        ImportFormatError: The table cannot be used; the message names row and column.
    """
    from overtaking.recordings.column_map import column_map
    from overtaking.recordings.row_tables import rows_of
    from overtaking.recordings.scenes import scenes
    from overtaking.recordings.tables import recording_of

    chosen = column_map(columns)
    place = None if road is None else road_of(road)
    recording = recording_of(rows_of(table, chosen), chosen, "table", road=place)
    found = scenes(recording, attempts_only=attempts_only, num_slots=vehicles)
    return found.trajectories(range(len(found)))


@checked
def write_column_map(table: str | Path, out: str | Path) -> None:
    """Write a map of columns to fill in.

    Args:
        table: The CSV or Parquet file that it is for; its columns are listed.
        out: The file to write; it must not exist.

    Raises:
        ConfigError: There is such a file.
        ImportFormatError: The table cannot be read.
        OSError: The file cannot be written.
    """
    from overtaking.core.folders import put_file
    from overtaking.recordings.column_map import template
    from overtaking.recordings.table_files import column_names

    target = Path(out)
    if target.exists():
        raise ConfigError.of(
            what="map of columns",
            where=str(target),
            expected="a new file",
            got="one that exists",
            next_step="choose another name",
        )
    put_file(target, template(column_names(Path(table))))


def _keep(name: str) -> Keep:
    try:
        return Keep(name)
    except ValueError:
        raise ConfigError.not_among("keep", "generate", Keep, name) from None
