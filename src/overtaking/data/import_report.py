"""The import report: its file in a data set, as a pandas table, and as warnings of Python.

The file is no table of simulations: it has a hash of its own in the manifest and no part in the
content hash.
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
from overtaking.core.files import unreadable_error, whole
from overtaking.data.manifest import ReportRecord
from overtaking.model.import_report import ImportFinding, place_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from overtaking.data.location import Location

FILE_NAME = "import_report.json"

MAX_WARNINGS = 10
"""Warnings about the recordings of a folder; one more names the number of the others."""

_MAX_BYTES = 1 << 28  # Some 800,000 findings.
_ROWS = TypeAdapter(tuple[ImportFinding, ...])


def report_frame(findings: Sequence[ImportFinding]) -> pd.DataFrame:
    """The report as a table.

    Args:
        findings: Its rows.

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
    """The content of the file: a JSON array with an object for each row."""
    rows = [finding.to_dict() for finding in findings]
    return json.dumps(rows, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def write_report(location: Location, findings: Sequence[ImportFinding]) -> ReportRecord:
    """Put the report of a data set into its place.

    Args:
        location: Where the data set lies.
        findings: The rows.

    Returns:
        The entry of the manifest.

    Raises:
        OSError: It cannot be written.
    """
    text = report_text(findings)
    location.put_text(FILE_NAME, text)
    return ReportRecord(rows=len(findings), sha256=_sha256(text.encode()))


def read_report(location: Location, record: ReportRecord | None) -> tuple[ImportFinding, ...]:
    """The rows of the report of a data set.

    Args:
        location: Where the data set lies.
        record: The entry of the manifest; None where there is no report.

    Raises:
        DatasetError: The file is missing, damaged, or cannot be read.
    """
    if record is None:
        return ()
    try:
        with location.open(FILE_NAME) as file:
            content = whole(file, _MAX_BYTES)
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
    """Issue a `RecordingWarning` for each recording with findings, and one for many others.

    The warnings point to the line outside the package that called it.

    Args:
        findings: The rows of a report.
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
    """Refuse a recording with findings, as `strict` demands.

    Raises:
        ImportFormatError: There is a finding.
    """
    if not findings:
        return
    first = findings[0]
    raise ImportFormatError.of(
        what="examination with strict",
        where=first.recording,
        expected="no finding",
        got=f"{len(findings)}, the first: {_finding_text(first)}",
        next_step="correct the recording, or leave out strict to read it with a report",
    )


def _frames_of_package() -> int:
    """Number of frames of this package on top of the stack, from the caller's on."""
    frame, count = currentframe(), 0  # None in a Python without frames.
    while frame and frame.f_globals.get("__name__", "").startswith("overtaking."):
        frame, count = frame.f_back, count + 1
    return count - 1


def _warning_text(findings: list[ImportFinding]) -> str:
    """The warning about one recording."""
    first = findings[0]
    if len(findings) == 1:
        return f"{first.recording}: {_finding_text(first)}"
    text = f"{len(findings):,} findings, the first: {_finding_text(first)}"
    return f"{first.recording}: {text}; import_report lists them"


def _finding_text(finding: ImportFinding) -> str:
    place = place_text(finding)
    return f"{finding.check}: {finding.consequence}: {place}{finding.detail}"


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _damaged(location: Location, got: str) -> DatasetError:
    return DatasetError.of(
        what="import report",
        where=location.at(FILE_NAME),
        expected="the file that was written",
        got=got,
        next_step="restore it from a copy, or import the recording again",
    )
