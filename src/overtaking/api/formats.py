"""Formats of others: export data sets to them, import recordings from them."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.api.choices import road_of
from overtaking.api.data import load_dataset
from overtaking.core.errors import ConfigError
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.data.location import folder_of
from overtaking.model.checks import check_argument, check_arguments
from overtaking.model.import_report import ImportFinding
from overtaking.model.road import Road
from overtaking.model.trajectories import Trajectories
from overtaking.recordings import export as recording_export

EXPORTS = ("pinto2023", "commonroad", "highd", "openscenario", "asp", "prolog", "popper")
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
    "driving_side": str,
    "speed_limit": float,
}
"""Types of the options of the readers of recordings."""


@check_arguments
def export_dataset(
    data: Dataset | str | Path,
    out: str | Path,
    *,
    file_format: str = EXPORTS[0],
    simulations: Iterable[int] | None = None,
    label: str | None = None,
    policy: str | None = None,
    progress: ProgressCallback | None = None,
    **options: Any,
) -> int:
    """Write simulations of a data set in the format of another program or paper.

    Args:
        data: The data set, or its folder.
        out: The paper's table is a file that ends in `.csv` or `.parquet`, replaced as a whole;
            the other formats are a folder, which must not exist or be empty, with one scenario or
            recording for each simulation, of `openscenario` with its road; of `asp` and `prolog`
            with files of facts and a theory, of `popper` with its three files.
        file_format: One of `EXPORTS`.
        simulations: Numbers of the simulations to write, all by default.
        label: A class that they must have, such as `Success_L`.
        policy: The policy that decides about the class: `paper`, `default` or `strict`; None for
            the default of the profile.
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
    source = load_dataset(data)
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
            events=_events(source) if file_format == "openscenario" else None,
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


def _events(data: Dataset) -> dict[int, dict[str, float]]:
    """Instants of the events of each simulation [s]."""
    found = defaultdict[int, dict[str, float]](dict)
    rows = data.table("events").select(["simulation", "event", "time_ms"])
    for number, name, time in zip(*rows.to_pydict().values(), strict=True):
        found[number][name] = time / 1000.0
    return found


def _chosen(
    data: Dataset, simulations: Iterable[int] | None, label: str | None, policy: str | None
) -> NDArray[np.int64] | None:
    """The simulations to write, None for all.

    Raises:
        ConfigError: There is no such simulation, class or policy, or none is left.
    """
    from overtaking.data.choice import chosen

    found = chosen(data, simulations, label, policy)
    if found is not None and not found.size:
        raise ConfigError(
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
        raise ConfigError.unknown_choice(
            what="format", where="export", choices=EXPORTS, got=file_format
        )
    known = _EXPORT_OPTIONS.get(file_format, ())
    for name in sorted(set(options) - set(known)):
        raise ConfigError(
            what=f"option {name}",
            where=f"export to {file_format}",
            expected=", ".join(known) or "none of those that some formats have",
            got=options[name],
            next_step="leave it out",
        )


@check_arguments
def _export_facts(
    data: Dataset,
    out: Path,
    language: str,
    numbers: Any,
    progress: ProgressCallback | None,
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


@check_arguments
def _export_popper(
    data: Dataset,
    out: Path,
    numbers: Any,
    policy: str | None,
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


@check_arguments
def import_recording(
    file_format: str,
    path: str | Path,
    out: str | Path,
    *,
    strict: bool = False,
    progress: ProgressCallback | None = None,
    on_read: ProgressCallback | None = None,
    **options: Any,
) -> Dataset:
    """Make a data set of a recording of others: every overtake in it becomes a simulation.

    Args:
        file_format: `commonroad` (XML 2018b or 2020a), `exid`, `highd`, `ngsim`, `pinto2023` (the
            paper's table) or `table` (any columns).
        path: The file; of exiD and highD its `_tracks.csv`.
        out: Folder for the data set; it must not exist, or be empty.
        strict: Whether a recording with findings is refused before anything is written. (It is not
            the policy of that name.)
        progress: Called with the number of simulations that are done, and of all.
        on_read: Called with the number of bytes that are read, and of all, before the first
            simulation is made; `progress` if left out. Each byte counts twice, because the hash of
            the file is computed first. The thread that calls it may be another one.
        options: `attempts_only=True` leaves out vehicles that follow and never move left, and
            `vehicles` is how many a simulation has at most (both not for `pinto2023`); `lanelet`
            chooses a road of a CommonRoad file, `direction` (1, 2) one of highD, `road` (a `Road`)
            is where a table was recorded. `columns` is the map of a table: a name, a TOML file, or
            its content; `only` maps columns to the value that they must have.
            `driving_side` ("right", "left") and `speed_limit` (in m/s, infinite for no limit)
            replace the values of the file.
            `smooth=True` smooths tracks as Thiemann et al. (2008) do those of NGSIM.

    Returns:
        The complete, labelled data set; its manifest counts what was found and measured, and its
        `import_report` lists the findings of the examination. A `RecordingWarning` names the first.

    Raises:
        ConfigError: There is no such format, an option is not for it, or the folder is taken.
        ImportFormatError: The file cannot be used; the message names line and element or column. Or
            `strict` refuses a finding.
        DatasetError: The folder cannot be written. Nothing is left behind.
    """
    from overtaking.data.import_report import refuse_findings, warn_about
    from overtaking.data.importing import write_scenes
    from overtaking.recordings.formats import read_recording
    from overtaking.recordings.reading_progress import report_reading

    for name, value in options.items():
        check_argument(value, _READER_OPTIONS.get(name, Any), "import_recording", name)
    target = folder_of(out, "import to")
    with report_reading(on_read or progress):
        read = read_recording(file_format, path, _with_road(options))
    if strict:
        refuse_findings(read.scenes.import_findings)
    write_scenes(read, target, file_format, progress)
    data = load_dataset(target)
    warn_about(data.import_findings)
    return data


@check_arguments
def label_recordings(
    file_format: str,
    folder: str | Path,
    out: str | Path,
    *,
    engine: str = "auto",
    workers: int | None = None,
    address: str | None = None,
    resume: bool = False,
    strict: bool = False,
    progress: ProgressCallback | None = None,
    on_read: ProgressCallback | None = None,
    **options: Any,
) -> dict[str, Any]:
    """Label every recording of a folder, however many, each on its own road.

    A recording that cannot be read and labelled to its end has no simulations in the result; the
    others go on.

    Args:
        file_format: As in `import_recording`.
        folder: Where the recordings lie; files with other endings are left alone.
        out: Folder for the tables of labels, `simulations` among them, and `recordings.json`.
            A simulation has the number of its recording, counted by name, times a million plus its
            own. `fault-*.txt` has the traceback of a fault of this package, with the number of the
            recording.
        engine: `auto`, `threads`, `processes` or `ray`; the choice changes no byte.
        workers: How many processes; one on each core by default.
        address: Of a Ray cluster that runs.
        resume: Whether to complete what an earlier call has begun; failed recordings are tried
            again.
        strict: Whether all recordings are examined first, which reads them twice, and a finding is
            an error before anything is written. (It is not the policy of that name.)
        progress: Called with the number of recordings that are done, and of all.
        on_read: Called as in `import_recording` for each recording that this process reads itself.
        options: As in `import_recording`.

    Returns:
        The content of `recordings.json`: counts, the hash over all tables, and the options that
        decided them; `failed`, the reason for each recording without simulations, of which `faults`
        are faults of this package and `refused` the others; `import_report`, the findings of the
        examination, as rows. A `RecordingWarning` names the first of a recording, for ten
        recordings at most.

    Raises:
        ConfigError: There is no recording, an option is not for the format or out of its range, or
            the engine cannot be used.
        ImportFormatError: `strict` refuses a finding.
        DatasetError: The folder holds something else or cannot be written; finished shards are
            kept.
    """
    from overtaking.data.collection import label_folder
    from overtaking.data.executors import executor_for
    from overtaking.data.import_report import warn_about
    from overtaking.recordings.reading_progress import report_reading

    for name, value in options.items():
        check_argument(value, _READER_OPTIONS.get(name, Any), "label_recordings", name)
    with report_reading(on_read):
        result = label_folder(
            file_format,
            folder_of(folder, "read"),
            folder_of(out, "label to"),
            _with_road(options),
            executor=lambda shards: executor_for(engine, shards, address=address, workers=workers),
            resume=resume,
            strict=strict,
            progress=progress,
        )
    warn_about([ImportFinding(**row) for row in result["import_report"]])
    return result


def _with_road(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options of a reader with the road itself in place of its name or file."""
    road = options.get("road")
    return {**options} if road is None else {**options, "road": road_of(road)}


@check_arguments
def from_table(
    table: Any,
    *,
    columns: str | Path | Mapping[str, Any],
    road: str | Path | Road | None = None,
    driving_side: str | None = None,
    speed_limit: float | None = None,
    attempts_only: bool = False,
    vehicles: int = 16,
    strict: bool = False,
) -> Trajectories:
    """The overtakes in a table of states; called as `Trajectories.from_table`.

    Args:
        table: A row per vehicle and instant: a pandas or Arrow table, or a mapping of columns.
        columns: Which column holds what, with units: the name of a map, a TOML file, its content,
            or its section `columns` such as `{"vehicle": "id", "time": "t [s]", "x": "x [m]"}`.
        road: The road in the axes of the table: a name, an OpenDRIVE file, or a `Road`. If left
            out, what the map says of it; what that leaves open is inferred from the traffic.
        driving_side: Side that traffic keeps to, "right" or "left"; replaces the side that the map
            states.
        speed_limit: Speed limit of the road [m/s], infinite for no limit; replaces the limit that
            the map or the road states.
        attempts_only: Whether vehicles that follow and never move left are left out.
        vehicles: Vehicles of a simulation at most.
        strict: Whether a table with findings is refused. (It is not the policy of that name.)

    Returns:
        A simulation for each overtake, and for each vehicle that follows another; `unknown` says
        what the table does not tell, `import_report` what was found in its examination. A
        `RecordingWarning` names the first finding.

    Raises:
        ConfigError: The map or the road cannot be used.
        ImportFormatError: The table cannot be used; the message names row and column. Or `strict`
            refuses a finding.
    """
    from overtaking.data.import_report import refuse_findings, warn_about
    from overtaking.recordings.column_map import column_map
    from overtaking.recordings.scenes import scenes
    from overtaking.recordings.tables import recording_of, with_driving_side
    from overtaking.recordings.track_table import track_rows_from_table

    map_road = None if road is None else road_of(road)
    declared = with_driving_side(column_map(columns), driving_side, map_road)
    recording = recording_of(
        track_rows_from_table(table, declared), declared, "table", road=map_road
    )
    if speed_limit is not None:
        recording = recording.with_speed_limit(speed_limit)
    recorded_scenes = scenes(recording, attempts_only=attempts_only, num_slots=vehicles)
    if strict:
        refuse_findings(recorded_scenes.import_findings)
    trajectories = recorded_scenes.trajectories(range(len(recorded_scenes)))
    warn_about(trajectories.import_findings)
    return trajectories


@check_arguments
def write_column_map(table: str | Path, out: str | Path) -> None:
    """Write a map of columns to fill in.

    Args:
        table: The CSV, Parquet or Arrow file that it is for; its columns are listed.
        out: The file to write; it must not exist.

    Raises:
        ConfigError: There is such a file.
        ImportFormatError: The table cannot be read.
        OSError: The file cannot be written.
    """
    from overtaking.core.files import write_new_file
    from overtaking.recordings.column_map import template
    from overtaking.recordings.table_files import column_names

    target = Path(out)
    if target.exists():
        raise ConfigError(
            what="map of columns",
            where=str(target),
            expected="a new file",
            got="one that exists",
            next_step="choose another name",
        )
    write_new_file(target, template(column_names(Path(table))))
