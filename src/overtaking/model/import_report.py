"""The rows of an import report, the findings of the examination of a recording.

Simulations from recordings carry them, so that a table of results can be traced to its source.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportFinding:
    """A finding of a recording, a row of an import report.

    Attributes:
        recording: Name of the recording; in a folder of recordings the name of its file.
        check: Name of the check, a value of `recordings.findings.Check`. It is a text here because
            reports are also read back from tables.
        vehicle: Name of the vehicle in the file; None for the whole file.
        first_time_s: Time of its first row, as the file counts [s]; None for the whole file, and
            for a vehicle whose rows state no time.
        rows: Number of rows of the file that it concerns.
        consequence: Action of the import on these rows, a value of
            `recordings.findings.Consequence`: "corrected", "left out", or "reported" where the
            values of the file were kept.
        detail: One sentence with columns and values.
    """

    recording: str
    check: str
    vehicle: str | None
    first_time_s: float | None
    rows: int
    consequence: str
    detail: str

    def to_dict(self) -> dict[str, Any]:
        """The row by column, for JSON."""
        return asdict(self)


def joined_findings(reports: Iterable[Iterable[ImportFinding]]) -> tuple[ImportFinding, ...]:
    """The findings of several reports, each once, in order.

    Parts of one recording have the same report.

    Args:
        reports: The reports.
    """
    return tuple(dict.fromkeys(finding for report in reports for finding in report))


def check_lines(findings: Iterable[ImportFinding]) -> list[str]:
    """One line for each check and consequence, in the order of their first findings.

    Args:
        findings: The rows of an import report.

    Returns:
        Lines such as "01_tracks.csv: gaps: corrected, 40 rows, 12 findings; the first: ...".
    """
    by_check: dict[tuple[str, str], list[ImportFinding]] = {}
    for finding in findings:
        by_check.setdefault((finding.check, finding.consequence), []).append(finding)
    return [_check_line(group) for group in by_check.values()]


def _check_line(findings: list[ImportFinding]) -> str:
    """The line of one check and consequence."""
    first = findings[0]
    num_recordings = len({finding.recording for finding in findings})
    source_name = first.recording if num_recordings == 1 else f"{num_recordings:,} recordings"
    head = f"{source_name}: {first.check}: {first.consequence}, {_rows_text(findings)}"
    if len(findings) == 1:
        return f"{head}: {place_text(first)}{first.detail}"
    source = f"{first.recording}: " if num_recordings > 1 else ""
    return (
        f"{head}, {len(findings):,} findings; the first: {source}{place_text(first)}{first.detail}"
    )


def _rows_text(findings: Iterable[ImportFinding]) -> str:
    """Number of rows of some findings in words."""
    num_rows = sum(finding.rows for finding in findings)
    return f"{num_rows:,} row{'' if num_rows == 1 else 's'}"


def place_text(finding: ImportFinding) -> str:
    """Vehicle and time of a finding, before its detail; empty for the whole file."""
    if finding.vehicle is None:
        return ""
    time = "" if finding.first_time_s is None else f" at {finding.first_time_s:g} s"
    return f"vehicle {finding.vehicle}{time}: "
