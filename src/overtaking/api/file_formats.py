"""Public functions that write data sets in other formats, and make data sets of recordings.

A *data set* is a folder of tables with many simulations of one ego, the vehicle whose overtaking is
studied. *Exporting* writes its simulations for another program. *Importing* reads recorded traffic
(tracks of vehicles from a drone or camera): each overtake, and each vehicle that follows another,
becomes a simulation with the positions of the recording; nothing is simulated.
*The paper* is the published study that the package reproduces (Pinto, Dutra and Fonseca 2023);
`pinto2023` is the format of its table. A *finding* is a contradiction or doubt in a recording, such
as speeds in another unit than stated. *Facts* are the content of a data set as logic statements.
*Profile*: the named setting of road and traffic that a data set was drawn from.

`check_arguments` raises a `ConfigError` for an argument of another type than its annotation.
"""

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
"""The formats that a data set can be written in.

`asp` and `prolog` are logic programs, `popper` is the input of the rule learner Popper.
"""


_FACT_OPTIONS = ("frame_step", "with_law")


_EXPORT_OPTIONS = {"asp": _FACT_OPTIONS, "prolog": _FACT_OPTIONS, "popper": ("about",)}
"""The options that a format has in addition to the arguments of `export_dataset`."""


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
"""Types of the options of all formats; a reader refuses options that its format does not have."""


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
        dataset: The data set, or its folder or URL.
        out: File or folder to write, on this machine. For `pinto2023` a file that ends in `.csv` or
            `.parquet`; an existing file is replaced. For all other formats a folder, which must
            not exist or be empty: files for each simulation (`commonroad`, `highd`,
            `openscenario`), files of facts with the rules that interpret them (`asp`, `prolog`), or
            the three input files of Popper.
        file_format: A name in `EXPORT_FORMATS`.
        simulation_ids: Numbers of the simulations to write, from 0; None for all.
        overtake_class: Write only those simulations that have this class, such as `Success_L`
            (completed and legal); None for all classes.
        policy: The set of rules of law that decides whether an overtake is legal, and so its class:
            `paper`, `default` or `strict`; None for the default of the profile.
        progress: Called with the number of simulations that are written, and of all; not for
            `popper`.
        options: For `asp` and `prolog`: `frame_step`, the interval between written positions, 1 or
            more frames (recorded instants), 10 by default; and `with_law=True`, which adds the
            facts that only the rules of law read. For `popper`: `about`, the fact to learn:
            `legal` (the default), `collision`, or `start` (this is a bad instant to start: the
            driver does not start, or the overtake fails).

    Returns:
        Number of rows (`pinto2023`), of vehicle states (`commonroad`, `highd`, `openscenario`) or
        of facts (all others) that were written.

    Raises:
        ConfigError: A format, option, simulation, class or policy does not exist, no simulation is
            selected, the name of the file does not fit the format, or the folder is not empty.
        DatasetError: The data set is not complete, or damaged.
        OSError: The file cannot be written.
    """
    # `folder_of` refuses a URL; its second argument completes the message "a folder to ...".
    target = folder_of(out, "export to")
    _check_export_options(file_format, options)
    source = load_dataset(dataset)
    selected_ids = _selected_simulations(source, simulation_ids, overtake_class, policy)
    if file_format in ("asp", "prolog"):
        return _export_facts(source, target, file_format, selected_ids, progress, **options)
    if file_format == "popper":
        return _export_popper(source, target, selected_ids, policy, **options)
    total = len(source) if selected_ids is None else len(selected_ids)
    if file_format in recording_export.FORMATS:  # The formats with files for each simulation.
        return recording_export.write_folder(
            source.batches(selected_ids),
            target,
            file_format=file_format,
            total=total,
            road=source.road,
            # Only OpenSCENARIO has a place for events.
            events=_event_times(source) if file_format == "openscenario" else None,
            progress=progress,
        )
    from overtaking.recordings import pinto2023  # Slow to import, as it loads pandas.

    def tables() -> Iterator[pa.Table]:
        """Parts of the table, one batch of simulations at a time to save memory."""
        num_done = 0
        for batch_ids, trajectories in source.batches(selected_ids):
            yield pinto2023.to_table(trajectories, batch_ids)
            num_done += len(batch_ids)
            if progress is not None:
                progress(num_done, total)

    return pinto2023.write_table(tables(), target)


def _event_times(dataset: Dataset) -> dict[int, dict[str, float]]:
    """Times of overtake events since the start of each simulation [s].

    Returns:
        For each simulation number, the times by event name, such as `attempt`.
    """
    event_times = defaultdict[int, dict[str, float]](dict)
    table = dataset.table("events")
    columns = (table[name].to_pylist() for name in ("simulation", "event", "time_ms"))
    for simulation_id, event, time_ms in zip(*columns, strict=True):
        event_times[simulation_id][event] = time_ms / 1000.0
    return event_times


def _selected_simulations(
    dataset: Dataset,
    simulation_ids: Iterable[int] | None,
    overtake_class: str | None,
    policy: str | None,
) -> NDArray[np.int64] | None:
    """Numbers of the simulations to write, ascending, shape (selected,); None for all.

    Raises:
        ConfigError: A simulation, class or policy does not exist, or no simulation is selected.
    """
    from overtaking.data.choice import chosen as select_simulations

    selected_ids = select_simulations(dataset, simulation_ids, overtake_class, policy)
    if selected_ids is not None and not selected_ids.size:
        raise ConfigError(
            what="simulations",
            where="export",
            expected="at least one",
            got=f"none of class {overtake_class}" if overtake_class else "none",
            next_step="choose others; overtaking stats counts the classes",
        )
    return selected_ids


def _check_export_options(file_format: str, options: Mapping[str, Any]) -> None:
    """Refuse an unknown format, and options that the format does not have."""
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
    selected_ids: Any,
    progress: ProgressCallback | None,
    *,
    frame_step: int = 10,
    with_law: bool = False,
) -> int:
    """Write simulations as facts.

    A separate function, so that `check_arguments` checks the options, which `export_dataset` takes
    as `**options`. `selected_ids` is the result of `_selected_simulations`; its type is `Any`,
    because `check_arguments` does not know the type of arrays. Other arguments as in
    `export_dataset`.
    """
    from overtaking.analysis.logic.fact_files import write_facts

    return write_facts(
        dataset,
        out,
        language=language,
        simulation_ids=selected_ids,
        frame_step=frame_step,
        with_law=with_law,
        progress=progress,
    )


@check_arguments
def _export_popper(
    dataset: Dataset,
    out: Path,
    selected_ids: Any,
    policy: str | None,
    *,
    about: str = "legal",
) -> int:
    """Write the input of the learner Popper: an example for each simulation.

    A separate function for the same reason as `_export_facts`, with the same arguments.
    """
    from overtaking.analysis.learning.examples import examples_of
    from overtaking.analysis.learning.popper import write_popper
    from overtaking.analysis.learning.targets import target_of

    target, examples = target_of(about), examples_of(dataset, policy)
    if selected_ids is not None:
        examples = examples.where(np.isin(examples.simulations, selected_ids))
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
    """Make a data set of a recording of real traffic.

    Args:
        file_format: `commonroad` (XML 2018b or 2020a), `exid`, `highd`, `ngsim`, `pinto2023` (the
            paper's table) or `table` (any columns, which the option `columns` describes).
        path: The file; for exiD and highD, which have three files, the file `..._tracks.csv`.
        out: Folder for the data set, on this machine; it must not exist, or be empty.
        strict: Whether any finding is an error, raised before anything is written. (The policy
            `strict`, a set of rules of law, is something else.)
        progress: Called with the number of simulations that are done, and of all.
        on_read: Called with the number of bytes that are done, and of all, before the first
            simulation is made; None calls `progress` instead. Each byte of the file counts three
            times: for its hash, its table and the examination. The call may come from another
            thread.
        options: Each format has some of these; all may be left out, except `columns`.
            All: `speed_limit` [m/s], infinite for no limit, replaces the limit of the file.
            All but `pinto2023`: `attempts_only=True` omits vehicles that follow another and never
            leave their lane towards the overtaking side. `vehicles` is the largest number of
            vehicles of a simulation, 16 by default. `smooth=True` smooths the tracks as Thiemann et
            al. (2008) did for NGSIM.
            All but `pinto2023` and `highd`: `driving_side` ("right", "left") replaces the side of
            the file.
            All but `commonroad` and `highd`: `road` is the road of the recording: a name, an
            OpenDRIVE file, or a `Road`.
            `exid`, `ngsim`, `table`: `only` maps column names to the value that a row must have;
            other rows are omitted.
            `table`: `columns` states which column holds which quantity in which unit (a *map*): the
            name of a map of the package, a TOML file, or its content.
            `commonroad`: `lanelet` is the id of a lanelet (a piece of a lane) on the road to read,
            for a file with several roads.
            `highd`: `direction`, 1 or 2, selects a carriageway.

    Returns:
        The complete data set, with labels (events, verdicts of the law, classes). Its manifest
        states counts and measured errors of the recording; its `import_report` lists all findings.
        A `RecordingWarning` states the first finding.

    Raises:
        ConfigError: There is no such format, the format does not have an option, or the folder is
            not empty.
        ImportFormatError: The file cannot be used; the message names line and element or column.
            Also for a finding if `strict` is true.
        DatasetError: The folder cannot be written; no files remain.
    """
    from overtaking.data.import_report import refuse_findings, warn_about
    from overtaking.data.importing import write_scenes
    from overtaking.recordings.formats import read_recording
    from overtaking.recordings.reading_progress import report_reading

    for name, value in options.items():
        # An unknown name passes as `Any`; the reader refuses it and lists the format's options.
        check_argument(value, _READER_OPTIONS.get(name, Any), "import_recording", name)
    target = folder_of(out, "import to")
    with report_reading(on_read or progress):
        recording = read_recording(file_format, path, _with_road(options))
    if strict:
        refuse_findings(recording.scenes.import_findings)
    write_scenes(recording, target, file_format, progress)
    dataset = load_dataset(target)
    warn_about(dataset.import_findings)
    return dataset


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
    """Label all recordings in a folder, and write the labels without the tracks.

    Labels are events, verdicts of the law, classes and features of each overtake. The result is no
    data set, because each recording has its own road. If a recording cannot be read or labelled,
    none of its overtakes are in the result; the other recordings are labelled.

    Args:
        file_format: As in `import_recording`.
        folder: Folder of the recordings; files whose names do not end as the format requires are
            ignored.
        out: Folder for the result: tables of labels, among them `simulations`, and
            `recordings.json`. Recordings are numbered from 0 by file name; the number of a
            simulation is 1,000,000 times its recording's number plus its number in the recording.
            If a recording fails by a programming error in this package, a file `fault-*.txt`, with
            the number of the recording in its name, holds the traceback.
        executor: Where recordings are labelled: `threads` of this process, `processes` of this
            machine, `ray` for a Ray cluster; `auto` takes processes for more than 256 recordings,
            else threads. The result has the same bytes in all cases.
        workers: Number of processes, not for `threads` or with `address`; None for one per core.
        address: Only for `ray`. Address `HOST:PORT` of a Ray cluster; None starts one on this
            machine for the duration of the call.
        resume: Whether to complete the result of an interrupted call; failed recordings are tried
            again.
        strict: Whether any finding is an error. All recordings are then read twice, first to
            examine them before anything is written. (The policy `strict`, a set of rules of law, is
            something else.)
        progress: Called with the number of recordings that are done, and of all.
        on_read: Called as in `import_recording` for each recording that this process reads itself;
            None reports no bytes, because `progress` counts recordings here.
        options: As in `import_recording`.

    Returns:
        The content of `recordings.json`: counts, the options, and a hash over all tables;
        `failed`, the reason for each failed recording; the numbers of programming errors (`faults`)
        and of unusable files (`refused`) among them; and `import_report`, a dictionary for each
        finding. A `RecordingWarning` states the first finding of a recording, for ten recordings at
        most.

    Raises:
        ConfigError: The folder has no recording, the format does not have an option, a value is out
            of range, or the executor cannot be used.
        ImportFormatError: `strict` is true and there is a finding.
        DatasetError: The folder `out` holds other files or cannot be written; finished parts stay
            for `resume`.
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
            # A function, because `auto` depends on the number of shards (groups of recordings),
            # which is known only after the folder has been listed.
            executor=lambda num_shards: executor_for_shards(
                executor, num_shards, address=address, workers=workers
            ),
            resume=resume,
            strict=strict,
            progress=progress,
        )
    # `recordings.json` holds findings as dictionaries, one for each.
    warn_about([ImportFinding(**row) for row in result["import_report"]])
    return result


def _with_road(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options, with the option `road`, if set, as a `Road` instead of its name or file."""
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
    """The overtakes in a table of vehicle positions; users call it as `Trajectories.from_table`.

    Like `import_recording` with the format `table`, but in memory: it writes nothing.

    Args:
        table: A row per vehicle and instant: a pandas or Arrow table, or a mapping of columns.
        columns: Which column holds which quantity in which unit (a *map*): the name of a map of the
            package, a TOML file, its content, or only its section `columns`, such as
            `{"vehicle": "id", "time": "t [s]", "x": "x [m]"}`.
        road: The road, in the coordinates of the table: a name, an OpenDRIVE file, or a `Road`.
            None for the road that the map describes; lanes that the map does not describe are
            inferred from the tracks.
        driving_side: Side that traffic keeps to, "right" or "left"; replaces the side that the map
            states. A given `road` must have the same side.
        speed_limit: Speed limit of the road [m/s], infinite for no limit; replaces the limit that
            the map or the road states.
        attempts_only: Whether vehicles are omitted that follow another and never leave their lane
            towards the overtaking side.
        vehicles: Largest number of vehicles of a simulation; vehicles that were never near the
            ego are omitted first.
        strict: Whether any finding is an error. (The policy `strict`, a set of rules of law, is
            something else.)

    Returns:
        A simulation for each overtake, and for each vehicle that follows another. `unknown` names
        the quantities that the table does not state, `import_report` lists the findings. A
        `RecordingWarning` states the first finding.

    Raises:
        ConfigError: The map, the road or the driving side cannot be used.
        ImportFormatError: The table cannot be used; the message names row and column. Also for a
            finding if `strict` is true.
    """
    from overtaking.data.import_report import refuse_findings, warn_about
    from overtaking.recordings.column_map import column_map
    from overtaking.recordings.scenes import scenes
    from overtaking.recordings.tables import recording_of, with_driving_side
    from overtaking.recordings.track_table import track_rows_from_table

    stated_road = None if road is None else resolve_road(road)
    # The driving side is set first, because lanes are inferred from it; the limit can be set later.
    mapping = with_driving_side(column_map(columns), driving_side, stated_road)
    track_rows = track_rows_from_table(table, mapping)
    recording = recording_of(track_rows, mapping, "table", road=stated_road)
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
    """Write a template for the option `columns` of `import_recording`, to be filled in by hand.

    Args:
        table: The CSV, Parquet or Arrow file to import; a comment in the template lists its
            columns.
        out: The TOML file to write; it must not exist, because a map filled in by hand would be
            lost.

    Raises:
        ConfigError: The file `out` exists.
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
