"""Labels all recordings of a folder, in shards that run in parallel and can be resumed.

Each recording has its own road, so the result is not a data set but the tables of labels with a
manifest. The manifest lists recordings that failed, with the reason; the other recordings are
labelled. The bytes of a shard depend only on its recordings, not on the process or the time.
"""

from __future__ import annotations

import hashlib
import json
import os
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from traceback import format_exception
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from overtaking.core.errors import ConfigError, DatasetError, OvertakingError
from overtaking.core.process_limits import refusal_of
from overtaking.core.progress import ProgressCallback, ProgressCounter
from overtaking.core.representation import as_utf8
from overtaking.data import lock, plan, shards
from overtaking.data.import_report import refuse_findings
from overtaking.data.importing import READER_VERSION
from overtaking.data.interruption import all_or_nothing
from overtaking.data.location import PARTIAL, Folder, Location
from overtaking.data.manifest import ShardRecord, content_hash
from overtaking.data.tables.encode_labels import contents
from overtaking.data.tables.schemas import LABEL_TABLES, schema_of
from overtaking.data.tables.schemas import VERSION as TABLE_VERSION
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.import_report import ImportFinding  # noqa: TC001, pydantic reads it.
from overtaking.model.trajectories import UNKNOWNS
from overtaking.recordings.formats import check_options, read_recording
from overtaking.recordings.messages import refused
from overtaking.recordings.table_streams import uncompressed_name

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    import pyarrow as pa

    from overtaking.data.work import Executor, OnDone

MANIFEST = "recordings.json"

ENDINGS = {
    "commonroad": (".xml",),
    "exid": ("_tracks.csv",),
    "highd": ("_tracks.csv",),
    "ngsim": (".csv", ".txt"),
    "pinto2023": (".csv", ".parquet", ".pq"),
    "table": (".csv", ".tsv", ".parquet", ".pq", ".arrow", ".arrows", ".feather"),
}
"""Endings of the names of recordings by format, regardless of case. Other files of a folder are
ignored."""

TABLES = (*LABEL_TABLES, "simulations")

SHARD_SIZE = 256
"""Recordings in a shard. After an interruption, only unfinished shards are repeated."""

NUMBERS = 1_000_000
"""Simulation numbers reserved for each recording: those of recording `k` begin at `k * NUMBERS`."""

# Files that this package puts into a folder before its manifest.
_OWN_FILES = frozenset({lock.FILE_NAME, PARTIAL})


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """The recordings of a shard.

    Attributes:
        shard: The numbers of the recordings in the folder.
        names: The file names of the recordings, in the same order.
    """

    shard: plan.Shard
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class FailedRecording:
    """A recording without simulations in the result.

    Attributes:
        reason: The error in one line.
        is_fault: Whether the reason is a fault of this package, not of the recording.
        traceback: The traceback of a fault, else empty.
    """

    reason: str
    is_fault: bool
    traceback: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelledRecording:
    """The tables of a recording.

    Attributes:
        tables: Chunks of consecutive simulations; each has the tables by name.
        findings: The rows of the import report.
    """

    tables: Sequence[Mapping[str, pa.Table]]
    findings: tuple[ImportFinding, ...]


Outcome = LabelledRecording | FailedRecording


@dataclass(frozen=True, slots=True, kw_only=True)
class PartReport:
    """The report of a shard, a JSON file beside its tables.

    Attributes:
        sizes: Size of each recording when it was read, by file name [bytes].
        refused: Reason for each recording that cannot be used, by file name.
        faults: Reason for each recording at which this package failed, by file name.
        import_report: The rows of the import report.
    """

    sizes: dict[str, int]
    refused: dict[str, str]
    faults: dict[str, str]
    import_report: list[ImportFinding]

    @property
    def failed(self) -> dict[str, str]:
        """Reason for each recording without simulations in the result, in the order of files."""
        reasons = {**self.refused, **self.faults}
        return {name: reasons[name] for name in self.sizes if name in reasons}


_PART_REPORT = TypeAdapter(PartReport)
_PANIC = "PanicException"  # A fault in Rust code; pyo3 derives it from `BaseException`.


@dataclass(frozen=True, slots=True, kw_only=True)
class Labelling:
    """The work on all shards; see `Work`.

    Attributes:
        file_format: Format of the recordings.
        folder: Folder of the recordings.
        options: Options of the reader.
        fingerprint: Hash over everything that determines the result, except for the recordings.
    """

    file_format: str
    folder: str
    options: Mapping[str, Any]
    fingerprint: str

    def for_one_core(self) -> Labelling:
        """This object: the work starts no threads."""
        return self

    def location(self, where: str) -> Location:
        """The folder of the result, checked because workers may run on other machines.

        Raises:
            DatasetError: This process finds another manifest in the folder, or none.
        """
        location = Folder(Path(where))
        if _read_fingerprint(location) == self.fingerprint:
            return location
        raise _folder_error(
            location, "one that every worker sees", "choose a folder that all machines share"
        )

    def make(self, task: Part, location: Location, on_done: OnDone) -> ShardRecord:
        """Label the recordings of a shard and write it.

        A shard that exists and is intact is kept, unless one of its failed recordings can be
        labelled now.

        Args:
            task: The recordings.
            location: Folder of the result.
            on_done: Called with the number of recordings that are done.

        Returns:
            The record of the shard for the manifest.

        Raises:
            OSError: The shard cannot be written.
        """
        record = shards.finished_shard(
            location, task.shard, tables=TABLES, fingerprint=self.fingerprint
        )
        report = _read_part_report(location, task.shard)
        outcomes: dict[str, Outcome] = {}
        if record is not None and report is not None:
            outcomes = {
                name: self._read_and_label(number, name)
                for number, name in enumerate(task.names, task.shard.first)
                if as_utf8(name) in report.failed
            }
            if not any(isinstance(outcome, LabelledRecording) for outcome in outcomes.values()):
                on_done(len(task.names))
                return record
        # The commit mark goes first: an interruption must not leave an old shard with a new report.
        location.remove(shards.name_of(shards.MARK, task.shard))
        return shards.write_shard(
            location,
            task.shard,
            self._pieces(task, location, on_done, outcomes),
            fingerprint=self.fingerprint,
            on_piece=on_done,
            schemas={name: schema_of(name, UNKNOWNS, recorded=True) for name in TABLES},
        )

    def _pieces(
        self, task: Part, location: Location, on_done: OnDone, outcomes: Mapping[str, Outcome]
    ) -> Iterator[shards.Piece]:
        """Yield the tables of each recording; its last chunk counts as one recording that is done.

        Args:
            task: The recordings.
            location: Folder of the result, for the report of the shard and tracebacks.
            on_done: Called for each failed recording.
            outcomes: Outcomes of recordings that are labelled already, by file name.
        """
        report = PartReport(sizes={}, refused={}, faults={}, import_report=[])
        for number, name in enumerate(task.names, task.shard.first):
            report.sizes[as_utf8(name)] = _size_of(Path(self.folder) / name)
            outcome = outcomes.get(name) or self._read_and_label(number, name)
            _write_traceback(location, number, outcome)
            if isinstance(outcome, FailedRecording):
                failures = report.faults if outcome.is_fault else report.refused
                failures[as_utf8(name)] = outcome.reason
                on_done(1)
                continue
            report.import_report.extend(outcome.findings)
            # Outside of `_read_and_label`, so that an error in writing ends the run instead of
            # counting as a failed recording.
            last = len(outcome.tables) - 1
            for place, tables in enumerate(outcome.tables):
                yield int(place == last), tables
        # The report is written before the commit mark, which marks the shard as complete.
        location.put_text(_part_report_name(task.shard), _json_text(asdict(report)))

    def _read_and_label(self, number: int, name: str) -> Outcome:
        """Read and label a whole recording, so that no part of a failed recording is written.

        Args:
            number: Number of the recording in the folder.
            name: File name of the recording.
        """
        try:
            path = Path(self.folder) / name
            scenes = read_recording(self.file_format, path, self.options).scenes
            _check_num_simulations(name, len(scenes))
            tables = [
                contents(
                    scenes.trajectories(chunk),
                    number * NUMBERS + np.arange(chunk.start, chunk.stop, dtype=np.int64),
                    TABLES,
                    [as_utf8(f"{name}: {source}") for source in scenes.sources(chunk)],
                )
                for chunk in plan.runs(0, len(scenes), plan.RECORDED_CHUNK_SIZE)
            ]
            findings = tuple(
                replace(finding, recording=as_utf8(name)) for finding in scenes.import_findings
            )
        except BaseException as error:
            if not (isinstance(error, Exception) or type(error).__name__ == _PANIC):
                raise  # Ctrl-C and SIGTERM end the run.
            return _failed_recording(error, number, name)
        return LabelledRecording(tables=tables, findings=findings)


def _check_num_simulations(name: str, count: int) -> None:
    """Refuse a recording with more simulations than have numbers of their own.

    Args:
        name: File name of the recording.
        count: Number of its simulations.

    Raises:
        ImportFormatError: There are more than `NUMBERS`.
    """
    if count > NUMBERS:
        raise refused(
            as_utf8(name),
            "simulations",
            f"at most {NUMBERS:,} in a recording of a folder",
            f"{count:,}",
            "divide the recording, or import it alone",
        )


def _failed_recording(error: BaseException, number: int, name: str) -> FailedRecording:
    """Describe the error of a recording: a refusal, or a fault of this package."""
    name = as_utf8(name)
    error = refusal_of(error, name) or error
    if isinstance(error, OvertakingError):
        return FailedRecording(reason=as_utf8(str(error)), is_fault=False)
    if isinstance(error, OSError):
        reason = as_utf8(f"{name}: {error.strerror or error}")
        return FailedRecording(reason=reason, is_fault=False)
    text = " ".join(f"{type(error).__name__}: {error}".split())
    reason = (
        f"{name}: a fault of overtaking itself, please report it with "
        f"{_traceback_name(number)}: {text}"
    )
    traceback = as_utf8("".join(format_exception(error)))
    return FailedRecording(reason=as_utf8(reason), is_fault=True, traceback=traceback)


def label_folder(
    file_format: str,
    folder: Path,
    out: Path,
    options: Mapping[str, Any],
    *,
    executor: Callable[[int], Executor],
    resume: bool = False,
    strict: bool = False,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Label all recordings of a folder.

    Args:
        file_format: One of `ENDINGS`.
        folder: Folder of the recordings.
        out: Folder for the tables.
        options: Options of the reader.
        executor: Returns the executor for a number of shards.
        resume: Whether to complete the result of an earlier call. Recordings that failed are read
            again.
        strict: Whether to examine all recordings first and refuse a finding. The result does not
            depend on it.
        progress: Called with the number of recordings that are done and the number of all.

    Returns:
        The content of the manifest.

    Raises:
        ConfigError: The folder has no recording, the format lacks an option, or the value of an
            option is out of range.
        ImportFormatError: `strict` is set and a recording has a finding.
        DatasetError: `out` has other content or cannot be written, or a signal ended the call.
            Finished shards are kept.
    """
    names = _list_recordings(file_format, folder)
    check_options(file_format, options)
    if strict:
        _refuse_any_finding(file_format, folder, names, options)
    identity = _identity(file_format, names, options)
    job = Labelling(
        file_format=file_format,
        folder=str(folder.resolve()),
        options=options,
        fingerprint=hashlib.sha256(_json_text(identity).encode()).hexdigest(),
    )
    location = Folder(out)
    with all_or_nothing(out, "time to complete it", "complete it with --resume"), location.locked():
        parts = [
            Part(shard=shard, names=tuple(names[shard.first : shard.stop]))
            for shard in plan.shards(len(names), SHARD_SIZE)
        ]
        is_first = _begin_or_resume(location, job, parts, resume=resume)
        location.sweep()
        location.prepare(TABLES)
        try:
            step = ProgressCounter(len(names), progress)
            with closing(executor(len(parts))(job, parts, location, step)) as shard_records:
                records = sorted(shard_records, key=lambda record: record.number)
            identity["files_sha256"] = _files_hash(folder, names)
            return _complete(location, job, identity, parts, records)
        except ConfigError:
            if is_first:  # With this manifest, a corrected call would find a folder in use.
                location.remove(MANIFEST)
            raise
        finally:
            location.sweep()


def _refuse_any_finding(
    file_format: str, folder: Path, names: Iterable[str], options: Mapping[str, Any]
) -> None:
    """Read all recordings and refuse the first finding, before anything is written.

    Raises:
        ImportFormatError: There is a finding.
    """
    for name in names:
        try:
            scenes = read_recording(file_format, folder / name, options).scenes
        except Exception:  # The result lists it as a failed recording.
            continue
        refuse_findings(
            [replace(finding, recording=as_utf8(name)) for finding in scenes.import_findings]
        )


def _list_recordings(file_format: str, folder: Path) -> list[str]:
    """File names of the recordings of a folder, in alphabetical order."""
    if file_format not in ENDINGS:
        raise ConfigError.unknown_choice(
            what="format", where="import", choices=ENDINGS, got=file_format
        )
    endings = ENDINGS[file_format]
    may_be_compressed = file_format != "commonroad"  # XML is read uncompressed only.
    names = sorted(
        file.name
        for file in folder.iterdir()
        if (uncompressed_name(file) if may_be_compressed else file.name).lower().endswith(endings)
    )
    if names:
        return names
    raise ConfigError(
        what="folder",
        where=str(folder),
        expected=f"recordings, files that end in {' or '.join(endings)}",
        got="none",
        next_step="check the folder and the format",
    )


def _identity(file_format: str, names: list[str], options: Mapping[str, Any]) -> dict[str, Any]:
    """Everything that determines the result, except for the bytes of the recordings.

    `_check_sizes` compares recordings shard by shard instead, because a failed recording may be
    repaired before `--resume`.
    """
    columns = options.get("columns")
    is_file = isinstance(columns, str | Path) and Path(columns).is_file()
    return {
        "format": file_format,
        "options": {name: repr(value) for name, value in sorted(options.items())},
        "columns": Path(str(columns)).read_text(encoding="utf-8") if is_file else "",
        "recordings": len(names),
        "names_sha256": hashlib.sha256(os.fsencode("\n".join(names))).hexdigest(),
        "rules": PORTUGAL.version + PORTUGAL.two_way_version,
        "reader": READER_VERSION,
        "tables": TABLE_VERSION,
    }


def _files_hash(folder: Path, names: Iterable[str]) -> str:
    """Hash over names and sizes of the recordings, without reading their content."""
    lines = "\n".join(f"{name} {_size_of(folder / name)}" for name in names)
    return hashlib.sha256(os.fsencode(lines)).hexdigest()


def _size_of(path: Path) -> int:
    """Size of a recording [bytes]; -1 if it cannot be determined."""
    try:
        return path.stat().st_size
    except OSError:
        return -1


def _begin_or_resume(
    location: Folder, job: Labelling, parts: Iterable[Part], *, resume: bool
) -> bool:
    """Write the first manifest, or check that the result of an earlier call can be completed.

    Returns:
        Whether this is the first call for the folder.

    Raises:
        DatasetError: The folder has other content, or a result to complete without `resume`.
    """
    if not location.has(MANIFEST):
        if other_files := location.names() - _OWN_FILES:
            raise _folder_error(
                location, "an empty folder", "choose another", f"one with {min(other_files)}"
            )
        location.put_text(MANIFEST, _json_text({"fingerprint": job.fingerprint, "complete": False}))
        return True
    if _read_fingerprint(location) != job.fingerprint:
        raise _folder_error(location, "the labels of these recordings", "choose another folder")
    if not resume:
        next_step = "complete it with --resume, or choose another folder"
        raise _folder_error(location, "an empty folder", next_step, "one that was begun")
    for part in parts:
        _check_sizes(location, job, part)
    return False


def _check_sizes(location: Folder, job: Labelling, part: Part) -> None:
    """Refuse recordings of a finished shard that have changed since they were labelled.

    Raises:
        DatasetError: The size of a labelled recording has changed.
    """
    report = _read_part_report(location, part.shard)
    if report is None or not location.has(shards.name_of(shards.MARK, part.shard)):
        return
    for name in part.names:
        size = _size_of(Path(job.folder) / name)
        key = as_utf8(name)
        if key not in report.failed and size != report.sizes.get(key):
            raise _folder_error(
                location,
                "the labels of these recordings",
                "choose another folder",
                f"those of another {key}",
            )


def _complete(
    location: Folder,
    job: Labelling,
    identity: dict[str, Any],
    parts: Iterable[Part],
    records: list[ShardRecord],
) -> dict[str, Any]:
    """Write the final manifest and return its content."""
    reports = [
        report for part in parts if (report := _read_part_report(location, part.shard)) is not None
    ]
    values = {
        **identity,
        "fingerprint": job.fingerprint,
        "complete": True,
        "simulations": sum(record.tables[shards.MARK].rows for record in records),
        "refused": sum(len(report.refused) for report in reports),
        "faults": sum(len(report.faults) for report in reports),
        "failed": {name: reason for report in reports for name, reason in report.failed.items()},
        "import_report": [
            finding.to_dict() for report in reports for finding in report.import_report
        ],
        "content_hash": content_hash(tuple(records)),
    }
    location.put_text(MANIFEST, _json_text(values))
    return values


def _read_fingerprint(location: Folder) -> str | None:
    """The fingerprint in the manifest of a folder; None without a valid manifest."""
    try:
        return json.loads((location.path / MANIFEST).read_text(encoding="utf-8"))["fingerprint"]
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _part_report_name(shard: plan.Shard) -> str:
    """Name of the file with the `PartReport` of a shard."""
    return f"report-{shard.number:05d}.json"


def _read_part_report(location: Location, shard: plan.Shard) -> PartReport | None:
    """The report of a shard; None if it is missing or damaged.

    Raises:
        OSError: The file exists but cannot be read.
    """
    try:
        with location.open(_part_report_name(shard)) as file:
            return _PART_REPORT.validate_json(file.read(), strict=True)
    except (FileNotFoundError, ValidationError):
        return None


def _traceback_name(number: int) -> str:
    """Name of the file with the traceback of a fault at a recording."""
    return f"fault-{number:05d}.txt"


def _write_traceback(location: Location, number: int, outcome: Outcome) -> None:
    """Write the traceback of a fault, or remove the one that an earlier call wrote."""
    if isinstance(outcome, FailedRecording) and outcome.is_fault:
        location.put_text(_traceback_name(number), outcome.traceback)
    else:
        location.remove(_traceback_name(number))


def _json_text(values: Mapping[str, Any]) -> str:
    return json.dumps(values, indent=1, ensure_ascii=False) + "\n"


def _folder_error(
    location: Location, expected: str, next_step: str, got: str = "others"
) -> DatasetError:
    return DatasetError(
        what="folder of labels",
        where=str(location),
        expected=expected,
        got=got,
        next_step=next_step,
    )
