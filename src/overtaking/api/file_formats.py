"""Formats of other programs: data sets are exported to them, recordings are imported from them."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.api.datasets import load_dataset
from overtaking.core.errors import ConfigError
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.data.location import folder_of
from overtaking.model.checks import check_argument, check_arguments
from overtaking.model.import_report import ImportFinding
from overtaking.model.road import Road
from overtaking.model.trajectories import Trajectories
from overtaking.recordings import export as recording_export
from overtaking.recordings.roads import resolve_road

EXPORT_FORMATS = ("pinto2023", "commonroad", "highd", "openscenario", "asp", "prolog", "popper")
"""The formats that a data set can be written in."""


_FACT_OPTIONS = ("frame_step", "with_law")


_EXPORT_OPTIONS = {"asp": _FACT_OPTIONS, "prolog": _FACT_OPTIONS, "popper": ("about",)}
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
    dataset: Dataset | str | Path,
    out: str | Path,
    *,
    file_format: str = EXPORT_FORMATS[0],
    simulation_ids: Iterable[int] | None = None,
    overtake_class: str | None = None,
    policy: str | None = None,
    progress: ProgressCallback | None = None,
    **options: Any,
) -> int:
    """Write simulations of a data set in the format of another program or of the paper.

    Args:
        dataset: The data set, or its folder.
        out: File or folder to write. The paper's table (`pinto2023`) is a file that ends in `.csv`
            or `.parquet` and is replaced as a whole. The other formats are a folder, which must not
            exist or be empty. It gets a scenario or recording for each simulation, with its road
            for `openscenario`; files of facts and a theory for `asp` and `prolog`; the three files
            of the learner for `popper`.
        file_format: One of `EXPORT_FORMATS`.
        simulation_ids: Numbers of the simulations to write, all by default.
        overtake_class: Class of the simulations to write, such as `Success_L`; None for all.
        policy: The policy that decides about the class: `paper`, `default` or `strict`; None for
            the default of the profile.
        progress: Called with the number of simulations that are done, and of all.
        options: Of `asp` and `prolog`: `frame_step`, the number of frames from one written position
            to the next, and `with_law=True`, which adds the facts that only the law reads. Of
            `popper`: `about`, which is `legal`, `collision` or `start`.

    Returns:
        Number of rows, states or facts written.

    Raises:
        ConfigError: A format, simulation, class or policy does not exist, no simulation is left,
            the name of the file does not fit the format, or the folder is taken.
        DatasetError: The data set is not complete, or damaged.
        OSError: The file cannot be written.
    """
    target = folder_of(out, "export to")
    _check_export_options(file_format, options)
    source = load_dataset(dataset)
    numbers = _selected_simulations(source, simulation_ids, overtake_class, policy)
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
            events=_event_times(source) if file_format == "openscenario" else None,
            progress=progress,
        )
    from overtaking.recordings import pinto2023  # It loads pandas, which nothing else here needs.

    def tables() -> Iterator[pa.Table]:
        num_done = 0
        for simulation_ids, trajectories in source.batches(numbers):
            yield pinto2023.to_table(trajectories, simulation_ids)
            num_done += len(simulation_ids)
            if progress is not None:
                progress(num_done, total)

    return pinto2023.write_table(tables(), target)


def _event_times(dataset: Dataset) -> dict[int, dict[str, float]]:
    """Times of the events of each simulation, by the name of the event [s]."""
    event_times = defaultdict[int, dict[str, float]](dict)
    rows = dataset.table("events").select(["simulation", "event", "time_ms"])
    for number, name, time in zip(*rows.to_pydict().values(), strict=True):
        event_times[number][name] = time / 1000.0
    return event_times


def _selected_simulations(
    dataset: Dataset,
    simulation_ids: Iterable[int] | None,
    overtake_class: str | None,
    policy: str | None,
) -> NDArray[np.int64] | None:
    """The simulations to write, None for all.

    Raises:
        ConfigError: A simulation, class or policy does not exist, or no simulation is left.
    """
    from overtaking.data.choice import chosen

    numbers = chosen(dataset, simulation_ids, overtake_class, policy)
    if numbers is not None and not numbers.size:
        raise ConfigError(
            what="simulations",
            where="export",
            expected="at least one",
            got=f"none of class {overtake_class}" if overtake_class else "none",
            next_step="choose others; overtaking stats counts the classes",
        )
    return numbers


def _check_export_options(file_format: str, options: Mapping[str, Any]) -> None:
    """Check that the format exists and has these options."""
    if file_format not in EXPORT_FORMATS:
        raise ConfigError.unknown_choice(
            what="format", where="export", choices=EXPORT_FORMATS, got=file_format
        )
    option_names = _EXPORT_OPTIONS.get(file_format, ())
    for name in sorted(set(options) - set(option_names)):
        raise ConfigError(
            what=f"option {name}",
            where=f"export to {file_format}",
            expected=", ".join(option_names) or "none of those that some formats have",
            got=options[name],
            next_step="leave it out",
        )


@check_arguments
def _export_facts(
    dataset: Dataset,
    out: Path,
    language: str,
    numbers: Any,
    progress: ProgressCallback | None,
    *,
    frame_step: int = 10,
    with_law: bool = False,
) -> int:
    """Write selected simulations as facts; see `export_dataset`."""
    from overtaking.analysis.logic.export import write_facts

    return write_facts(
        dataset,
        out,
        language=language,
        chosen=numbers,
        every=frame_step,
        with_law=with_law,
        progress=progress,
    )


@check_arguments
def _export_popper(
    dataset: Dataset,
    out: Path,
    numbers: Any,
    policy: str | None,
    *,
    about: str = "legal",
) -> int:
    """Write the examples of a data set for the learner Popper; see `export_dataset`."""
    from overtaking.analysis.learning.examples import examples_of
    from overtaking.analysis.learning.popper import write_popper
    from overtaking.analysis.learning.targets import target_of

    target, examples = target_of(about), examples_of(dataset, policy)
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
    """Make a data set of a recording of real traffic: every overtake becomes a simulation.

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
            `smooth=True` smooths tracks as Thiemann et al. (2008) smooth the tracks of NGSIM.

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
    executor: str = "auto",
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
        executor: `auto`, `threads`, `processes` or `ray`; the choice changes no byte.
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
            the executor cannot be used.
        ImportFormatError: `strict` refuses a finding.
        DatasetError: The folder holds something else or cannot be written; finished shards are
            kept.
    """
    from overtaking.data.collection import label_folder
    from overtaking.data.executors import executor_for_shards
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
            executor=lambda shards: executor_for_shards(
                executor, shards, address=address, workers=workers
            ),
            resume=resume,
            strict=strict,
            progress=progress,
        )
    warn_about([ImportFinding(**row) for row in result["import_report"]])
    return result


def _with_road(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options of a reader with the road itself in place of its name or file."""
    road = options.get("road")
    return {**options} if road is None else {**options, "road": resolve_road(road)}


@check_arguments
def trajectories_from_table(
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
            out, the road that the map describes; missing facts are inferred from the traffic.
        driving_side: Side that traffic keeps to, "right" or "left"; replaces the side that the map
            states.
        speed_limit: Speed limit of the road [m/s], infinite for no limit; replaces the limit that
            the map or the road states.
        attempts_only: Whether vehicles that follow and never move left are left out.
        vehicles: Largest number of vehicles of a simulation.
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

    map_road = None if road is None else resolve_road(road)
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
