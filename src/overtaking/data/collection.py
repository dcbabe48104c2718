"""Labels of a folder of recordings, a shard of them at a time: in parallel, and to be resumed.

Recordings have roads of their own, so the result is no data set, but the tables of labels and a
manifest. A recording that cannot be read and labelled to its end is named with the reason, and the
others go on. The content of a shard follows from its files alone: neither the process that makes it
nor the time changes a byte.
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
from overtaking.core.steps import Progress, Steps
from overtaking.core.words import as_utf8
from overtaking.data import lock, plan, shards
from overtaking.data.import_report import refuse_findings
from overtaking.data.importing import READER_VERSION
from overtaking.data.interruption import all_or_nothing
from overtaking.data.location import PARTIAL, Folder, Location
from overtaking.data.manifest import ShardRecord, content_hash
from overtaking.data.tables.encode_labels import contents
from overtaking.data.tables.schemas import LABEL_TABLES, schema_of
from overtaking.data.tables.schemas import VERSION as TABLE_VERSION
from overtaking.labels.law import PORTUGAL
from overtaking.model.import_report import ImportFinding  # noqa: TC001, pydantic reads it.
from overtaking.model.trajectory import UNKNOWNS
from overtaking.recordings.formats import check_options, read_recording
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
"""How the names of recordings end, by format, in small or capital letters; the other files of a
folder are left alone."""

TABLES = (*LABEL_TABLES, "simulations")

SHARD_SIZE = 256
"""Recordings of a shard: at most that much to do again."""

NUMBERS = 1_000_000
"""Numbers of simulations that each recording has; its own is the first divided by this."""

_OWN = frozenset({lock.FILE_NAME, PARTIAL})


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """The recordings of a shard.

    Attributes:
        shard: Their numbers.
        names: Their files.
    """

    shard: plan.Shard
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class FailedRecording:
    """A recording without simulations in the result.

    Attributes:
        reason: One line.
        is_fault: Whether the reason is a fault of this package, not of the recording.
        traceback: The traceback of a fault, else empty.
    """

    reason: str
    is_fault: bool
    traceback: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelledRecording:
    """The tables of a recording that was read and labelled to its end.

    Attributes:
        tables: The tables of some simulations each, in order.
        findings: The rows of the import report.
    """

    tables: Sequence[Mapping[str, pa.Table]]
    findings: tuple[ImportFinding, ...]


Outcome = LabelledRecording | FailedRecording


@dataclass(frozen=True, slots=True, kw_only=True)
class PartReport:
    """The report of a shard, a JSON file beside its tables.

    Attributes:
        sizes: Size of each recording when it was read [bytes].
        refused: Recordings that cannot be used, with the reason.
        faults: Recordings at which this package failed, with the reason.
        import_report: The rows of the import report.
    """

    sizes: dict[str, int]
    refused: dict[str, str]
    faults: dict[str, str]
    import_report: list[ImportFinding]

    @property
    def failed(self) -> dict[str, str]:
        """All recordings without simulations in the result, in order, with the reason."""
        reasons = {**self.refused, **self.faults}
        return {name: reasons[name] for name in self.sizes if name in reasons}


_PART_REPORT = TypeAdapter(PartReport)
_PANIC = "PanicException"  # Of a fault in compiled code; pyo3 derives it from `BaseException`.


@dataclass(frozen=True, slots=True, kw_only=True)
class Labelling:
    """What all shards share; see `Work`.

    Attributes:
        file_format: Format of the recordings.
        folder: Where they lie.
        options: Options of the reader.
        fingerprint: Of all that decides the result.
    """

    file_format: str
    folder: str
    options: Mapping[str, Any]
    fingerprint: str

    def for_one_core(self) -> Labelling:
        """The same: nothing here has threads of its own."""
        return self

    def location(self, where: str) -> Location:
        """The folder of the result, if this process sees the same one.

        Raises:
            DatasetError: Something else is there, or nothing.
        """
        location = Folder(Path(where))
        if _begun(location) == self.fingerprint:
            return location
        raise _other(
            location, "one that every worker sees", "choose a folder that all machines share"
        )

    def make(self, task: Part, location: Location, on_done: OnDone) -> ShardRecord:
        """Put a shard into its place, unless it is there and intact and no failed recording works.

        Raises:
            OSError: It cannot be written.
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
        # Without the commit mark an interruption leaves no shard that contradicts its report.
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
        """The tables of each recording, counted when its last simulation is there.

        Args:
            task: The recordings.
            location: Where their report is written.
            on_done: Called for each failed recording.
            outcomes: Outcomes of recordings that were read already.
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
            # Only here: an error in writing ends the run, and does not fail the recording.
            last = len(outcome.tables) - 1
            for place, tables in enumerate(outcome.tables):
                yield int(place == last), tables
        # Before the shard is in its place, which says that it is complete.
        location.put_text(_part_report_name(task.shard), _text(asdict(report)))

    def _read_and_label(self, number: int, name: str) -> Outcome:
        """Read and label a recording to its end, so that nothing of a failed one is written.

        Args:
            number: Its number among all recordings.
            name: Its file.
        """
        try:
            path = Path(self.folder) / name
            scenes = read_recording(self.file_format, path, self.options).scenes
            tables = [
                contents(
                    scenes.trajectories(chunk),
                    number * NUMBERS + np.arange(chunk.start, chunk.stop, dtype=np.int64),
                    TABLES,
                    [as_utf8(f"{name}: {source}") for source in scenes.sources(chunk)],
                )
                for chunk in plan.runs(0, min(len(scenes), NUMBERS), plan.RECORDED_CHUNK_SIZE)
            ]
            findings = tuple(
                replace(finding, recording=as_utf8(name)) for finding in scenes.import_findings
            )
        except BaseException as error:
            if not (isinstance(error, Exception) or type(error).__name__ == _PANIC):
                raise  # Ctrl-C and SIGTERM.
            return _failed_recording(error, number, name)
        return LabelledRecording(tables=tables, findings=findings)


def _failed_recording(error: BaseException, number: int, name: str) -> FailedRecording:
    """A recording at which an error was raised: refused, or a fault of this package."""
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
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Label all recordings of a folder.

    Args:
        file_format: One of `ENDINGS`.
        folder: Where the recordings lie.
        out: Folder for the tables.
        options: Options of the reader.
        executor: Chooses who makes the shards, given their number.
        resume: Whether to complete what an earlier call has begun; failed recordings are read
            again.
        strict: Whether all recordings are examined first, and a finding is an error. It does not
            change the result.
        progress: Called with the number of recordings that are done, and of all.

    Returns:
        The content of the manifest.

    Raises:
        ConfigError: There is no recording, or an option is not for the format or out of its range.
        ImportFormatError: `strict` refuses a finding.
        DatasetError: The folder holds something else or cannot be written, or the process was asked
            to end; finished shards are kept.
    """
    names = _names(file_format, folder)
    check_options(file_format, options)
    if strict:
        _refuse_any_finding(file_format, folder, names, options)
    identity = _identity(file_format, names, options)
    job = Labelling(
        file_format=file_format,
        folder=str(folder.resolve()),
        options=options,
        fingerprint=hashlib.sha256(_text(identity).encode()).hexdigest(),
    )
    location = Folder(out)
    with all_or_nothing(out, "time to complete it", "complete it with --resume"), location.locked():
        parts = [
            Part(shard=shard, names=tuple(names[shard.first : shard.stop]))
            for shard in plan.shards(len(names), SHARD_SIZE)
        ]
        is_first = _begin(location, job, parts, resume=resume)
        location.sweep()
        location.prepare(TABLES)
        try:
            step = Steps(len(names), progress)
            with closing(executor(len(parts))(job, parts, location, step)) as made:
                records = sorted(made, key=lambda one: one.number)
            identity["files_sha256"] = _files_hash(folder, names)
            return _complete(location, job, identity, parts, records)
        except ConfigError:
            if is_first:  # The manifest of a call that cannot succeed would keep the right one out.
                location.remove(MANIFEST)
            raise
        finally:
            location.sweep()


def _refuse_any_finding(
    file_format: str, folder: Path, names: Iterable[str], options: Mapping[str, Any]
) -> None:
    """Refuse the first finding of all recordings, before anything is written.

    Raises:
        ImportFormatError: There is a finding.
    """
    for name in names:
        try:
            scenes = read_recording(file_format, folder / name, options).scenes
        except Exception:  # It is a failed recording of the result.
            continue
        refuse_findings(
            [replace(finding, recording=as_utf8(name)) for finding in scenes.import_findings]
        )


def _names(file_format: str, folder: Path) -> list[str]:
    """The recordings of a folder, in order."""
    if file_format not in ENDINGS:
        raise ConfigError.not_among("format", "import", ENDINGS, file_format)
    endings = ENDINGS[file_format]
    may_be_compressed = file_format != "commonroad"  # XML is read uncompressed only.
    names = sorted(
        file.name
        for file in folder.iterdir()
        if (uncompressed_name(file) if may_be_compressed else file.name).lower().endswith(endings)
    )
    if names:
        return names
    raise ConfigError.of(
        what="folder",
        where=str(folder),
        expected=f"recordings, files that end in {' or '.join(endings)}",
        got="none",
        next_step="check the folder and the format",
    )


def _identity(file_format: str, names: list[str], options: Mapping[str, Any]) -> dict[str, Any]:
    """All that decides the result, except for the bytes of the recordings.

    Their sizes are compared shard by shard: a failed recording may be repaired before `--resume`.
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
    """Hash over the names and sizes of the recordings, which stand in for their bytes."""
    lines = "\n".join(f"{name} {_size_of(folder / name)}" for name in names)
    return hashlib.sha256(os.fsencode(lines)).hexdigest()


def _size_of(path: Path) -> int:
    """Size of a recording; -1 if the system does not tell it [bytes]."""
    try:
        return path.stat().st_size
    except OSError:
        return -1


def _begin(location: Folder, job: Labelling, parts: Iterable[Part], *, resume: bool) -> bool:
    """Write the first manifest, or check that an earlier call may be continued; whether first."""
    if not location.has(MANIFEST):
        if strangers := location.names() - _OWN:
            raise _other(
                location, "an empty folder", "choose another", f"one with {min(strangers)}"
            )
        location.put_text(MANIFEST, _text({"fingerprint": job.fingerprint, "complete": False}))
        return True
    if _begun(location) != job.fingerprint:
        raise _other(location, "the labels of these recordings", "choose another folder")
    if not resume:
        next_step = "complete it with --resume, or choose another folder"
        raise _other(location, "an empty folder", next_step, "one that was begun")
    for part in parts:
        _check_sizes(location, job, part)
    return False


def _check_sizes(location: Folder, job: Labelling, part: Part) -> None:
    """Refuse recordings that have changed since they were labelled.

    Raises:
        DatasetError: A recording has another size.
    """
    report = _read_part_report(location, part.shard)
    if report is None or not location.has(shards.name_of(shards.MARK, part.shard)):
        return
    for name in part.names:
        size = _size_of(Path(job.folder) / name)
        key = as_utf8(name)
        if key not in report.failed and size != report.sizes.get(key):
            raise _other(
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
    """Write the last manifest."""
    reports = [
        report for part in parts if (report := _read_part_report(location, part.shard)) is not None
    ]
    values = {
        **identity,
        "fingerprint": job.fingerprint,
        "complete": True,
        "simulations": sum(one.tables[shards.MARK].rows for one in records),
        "refused": sum(len(report.refused) for report in reports),
        "faults": sum(len(report.faults) for report in reports),
        "failed": {name: reason for report in reports for name, reason in report.failed.items()},
        "import_report": [
            finding.to_dict() for report in reports for finding in report.import_report
        ],
        "content_hash": content_hash(tuple(records)),
    }
    location.put_text(MANIFEST, _text(values))
    return values


def _begun(location: Folder) -> str | None:
    """The fingerprint that a folder was begun with."""
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
        OSError: It is there and cannot be read.
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


def _text(values: Mapping[str, Any]) -> str:
    return json.dumps(values, indent=1, ensure_ascii=False) + "\n"


def _other(location: Location, expected: str, next_step: str, got: str = "others") -> DatasetError:
    return DatasetError.of(
        what="folder of labels",
        where=str(location),
        expected=expected,
        got=got,
        next_step=next_step,
    )
