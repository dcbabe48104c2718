"""The import report: as a file of a data set, as a pandas table, and as Python warnings.

The file has a hash of its own in the manifest. It is not part of the content hash, which covers the
tables of simulations.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from dataclasses import fields
from inspect import currentframe
from typing import TYPE_CHECKING

from pydantic import TypeAdapter, ValidationError

from overtaking.core.errors import DatasetError, ImportFormatError, RecordingWarning
from overtaking.core.files import read_bounded, unreadable_error
from overtaking.data.manifest import ReportRecord
from overtaking.model.import_report import ImportFinding, format_place

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from overtaking.data.location import Location

FILE_NAME = "import_report.json"

MAX_WARNINGS = 10
"""Largest number of warnings about recordings; one more states how many recordings follow."""

_MAX_BYTES = 1 << 28  # Room for some 800,000 findings; a longer file is refused.
_ROWS = TypeAdapter(tuple[ImportFinding, ...])


def report_frame(findings: Sequence[ImportFinding]) -> pd.DataFrame:
    """The report as a table.

    Args:
        findings: Rows of the report.

    Returns:
        Columns `recording`, `check`, `vehicle` (text; missing for the whole file), `first_time_s`
        (as the file counts; NaN for the whole file), `rows`, `consequence` and `detail`.
    """
    import pandas as pd  # Writing a data set does not need it.

    dtypes = {"first_time_s": "float64", "rows": "int64"}
    columns = {
        field.name: pd.Series(
            [getattr(finding, field.name) for finding in findings],
            dtype=dtypes.get(field.name, "str"),
        )
        for field in fields(ImportFinding)
    }
    return pd.DataFrame(columns)


def report_text(findings: Sequence[ImportFinding]) -> str:
    """The content of the report's file: a JSON array with one object for each finding."""
    rows = [finding.to_dict() for finding in findings]
    return json.dumps(rows, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def write_report(location: Location, findings: Sequence[ImportFinding]) -> ReportRecord:
    """Write the report of a data set.

    Args:
        location: Folder or store of the data set.
        findings: Rows of the report.

    Returns:
        The entry for the manifest.

    Raises:
        OSError: The file cannot be written.
    """
    text = report_text(findings)
    location.put_text(FILE_NAME, text)
    return ReportRecord(rows=len(findings), sha256=_sha256(text.encode()))


def read_report(location: Location, record: ReportRecord | None) -> tuple[ImportFinding, ...]:
    """Read the report of a data set.

    Args:
        location: Folder or store of the data set.
        record: The entry of the manifest; None if the data set has no report.

    Returns:
        The rows of the report; empty without a report.

    Raises:
        DatasetError: The file is missing, damaged, or cannot be read.
    """
    if record is None:
        return ()
    try:
        with location.open(FILE_NAME) as file:
            content = read_bounded(file, _MAX_BYTES)
    except OSError as error:
        unreadable = unreadable_error(error, location.at(FILE_NAME), DatasetError)
        raise unreadable or _damaged(location, error.strerror or str(error)) from None
    if _sha256(content) != record.sha256:
        raise _damaged(location, "other bytes")
    try:
        return _ROWS.validate_json(content, strict=True)
    except ValidationError as error:
        raise _damaged(location, error.errors(include_url=False)[0]["msg"]) from None


def warn_about(findings: Sequence[ImportFinding]) -> None:
    """Issue a `RecordingWarning` for each recording with findings, at most `MAX_WARNINGS` + 1.

    The warnings point to the line of the user's code that called this package.

    Args:
        findings: Rows of a report.
    """
    stacklevel = _frames_of_package() + 1
    by_recording: dict[str, list[ImportFinding]] = {}
    for finding in findings:
        by_recording.setdefault(finding.recording, []).append(finding)
    for group in list(by_recording.values())[:MAX_WARNINGS]:
        warnings.warn(_warning_text(group), RecordingWarning, stacklevel=stacklevel)
    num_others = len(by_recording) - MAX_WARNINGS
    if num_others > 0:
        text = f"{num_others:,} further recordings have findings; import_report lists them"
        warnings.warn(text, RecordingWarning, stacklevel=stacklevel)


def refuse_findings(findings: Sequence[ImportFinding]) -> None:
    """Refuse a recording with findings, for the option `strict`.

    Args:
        findings: Rows of a report.

    Raises:
        ImportFormatError: `findings` is not empty.
    """
    if not findings:
        return
    first = findings[0]
    raise ImportFormatError(
        what="examination with strict",
        where=first.recording,
        expected="no finding",
        got=f"{len(findings)}, the first: {_finding_text(first)}",
        next_step="correct the recording, or leave out strict to read it with a report",
    )


def _frames_of_package() -> int:
    """Number of stack frames in this package, from the caller's frame outwards."""
    frame, count = currentframe(), 0  # Some Python implementations have no frames: None.
    while frame and frame.f_globals.get("__name__", "").startswith("overtaking."):
        frame, count = frame.f_back, count + 1
    return count - 1  # Without the frame of this function.


def _warning_text(findings: list[ImportFinding]) -> str:
    """The warning about one recording."""
    first = findings[0]
    if len(findings) == 1:
        return f"{first.recording}: {_finding_text(first)}"
    text = f"{len(findings):,} findings, the first: {_finding_text(first)}"
    return f"{first.recording}: {text}; import_report lists them"


def _finding_text(finding: ImportFinding) -> str:
    place = format_place(finding)
    return f"{finding.check}: {finding.consequence}: {place}{finding.detail}"


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _damaged(location: Location, got: str) -> DatasetError:
    return DatasetError(
        what="import report",
        where=location.at(FILE_NAME),
        expected="the file that was written with the data set",
        got=got,
        next_step="restore it from a copy, or import the recording again",
    )
