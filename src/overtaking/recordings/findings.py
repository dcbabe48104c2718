"""Findings of the examination of a recording, and their consequences."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Check(StrEnum):
    """Names of the checks, in the order in which a recording passes them."""

    IDENTITY = "identity"
    TIME = "time"
    MISSING_CELLS = "missing cells"
    DUPLICATE_ROWS = "duplicate rows"
    NUMBER_FORMAT = "number format"
    FRAME_RATE = "frame rate"
    GAPS = "gaps"
    SIZES = "sizes"
    KINDS = "kinds"
    SPEEDS = "speeds"
    HEADINGS = "headings"
    ACCELERATIONS = "accelerations"
    AXES = "axes"
    MOTION = "motion"
    DUPLICATE_VEHICLES = "duplicate vehicles"
    LANES = "lanes"


class Consequence(StrEnum):
    """What the reader does about a finding.

    A recording that it refuses has no finding but raises an `ImportFormatError`.
    """

    CORRECTED = "corrected"
    LEFT_OUT = "left out"
    REPORTED = "reported"
    """The values in the result are those of the file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A fault of a recording.

    Attributes:
        check: The check that found the fault.
        consequence: Whether the reader corrected, left out, refused or only reported it.
        detail: One sentence with columns, values and, for a correction, its method.
        rows: Number of rows with the fault.
        vehicle: Name of the vehicle in the file; None if the fault concerns the whole file.
        first_time_s: Time of the first of these rows, as the file counts [s]; None as above.
    """

    check: Check
    consequence: Consequence
    detail: str
    rows: int
    vehicle: str | None = None
    first_time_s: float | None = None
