"""Import reports: the faults that were found in a recording of real traffic when it was read.

The reader of a recording (`recordings`) checks each vehicle, and the file as a whole. A check that
finds a fault makes one `ImportFinding` for all rows with this fault. A batch of simulations from a
recording keeps the findings, so that a result can be traced to its source, and data sets store them
as a table. The functions here join reports and format them for people.
"""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportFinding:
    """A fault of a recording and what the reader did about it, a row of an import report.

    Attributes:
        recording: Name of the recording; in a folder of recordings the name of its file.
        check: Name of the check that found the fault, such as "frame rate" or "gaps" (rows of a
            vehicle are missing between others, or its position jumps). All names are in
            `recordings.findings.Check`; this is a plain text because reports are also read back
            from tables.
        vehicle: Name of the faulty vehicle in the file; None if the fault concerns the whole file.
        first_time_s: Time of the first row with the fault, on the time axis of the file [s]; None
            if the fault concerns the whole file, or if the rows of the vehicle state no time.
        rows: Number of rows of the file with the fault. A row with several faults counts in each
            finding.
        consequence: Action of the reader on these rows: "corrected", "left out", or "reported" if
            it kept the values of the file (`recordings.findings.Consequence`).
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


def join_findings(reports: Iterable[Iterable[ImportFinding]]) -> tuple[ImportFinding, ...]:
    """Join the findings of several reports, in order and without repetitions.

    Batches that are parts of one recording have the same report, so their findings repeat.

    Args:
        reports: The rows of each report.
    """
    # The keys of a dict are distinct and keep the order.
    return tuple(dict.fromkeys(finding for report in reports for finding in report))


def summarize_findings(findings: Iterable[ImportFinding]) -> list[str]:
    """Summarize findings in one line for each check and consequence, for people.

    A line may cover several recordings, so a folder of many recordings has few lines.

    Args:
        findings: The rows of one or more import reports.

    Returns:
        Lines such as "01_tracks.csv: gaps: corrected, 40 rows, 12 findings; the first: vehicle 7 at
        3.2 s: ...", in the order of the first findings.
    """
    groups: dict[tuple[str, str], list[ImportFinding]] = {}
    for finding in findings:
        groups.setdefault((finding.check, finding.consequence), []).append(finding)
    return [_summarize_group(group) for group in groups.values()]


def _summarize_group(findings: list[ImportFinding]) -> str:
    """The line for findings of the same check and consequence, at least one."""
    first = findings[0]
    num_recordings = len({finding.recording for finding in findings})
    source_name = first.recording if num_recordings == 1 else f"{num_recordings:,} recordings"
    head = f"{source_name}: {first.check}: {first.consequence}, {_format_num_rows(findings)}"
    if len(findings) == 1:
        return f"{head}: {format_place(first)}{first.detail}"
    first_source = f"{first.recording}: " if num_recordings > 1 else ""
    first_text = f"{first_source}{format_place(first)}{first.detail}"
    return f"{head}, {len(findings):,} findings; the first: {first_text}"


def _format_num_rows(findings: Iterable[ImportFinding]) -> str:
    """The sum of the rows of the findings, such as "1 row" or "1,200 rows"."""
    num_rows = sum(finding.rows for finding in findings)
    return f"{num_rows:,} row{'' if num_rows == 1 else 's'}"


def format_place(finding: ImportFinding) -> str:
    """Vehicle and time of a finding, such as "vehicle 7 at 3.2 s: ", to put before its detail.

    Empty if the fault concerns the whole file.
    """
    if finding.vehicle is None:
        return ""
    time = "" if finding.first_time_s is None else f" at {finding.first_time_s:g} s"
    return f"vehicle {finding.vehicle}{time}: "
