"""What the examination of a recording finds, and what becomes of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Check(StrEnum):
    """The checks, in the order in which a recording passes them."""

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
    """What the reader does about a finding. A refused recording has an error instead."""

    CORRECTED = "corrected"
    LEFT_OUT = "left out"
    REPORTED = "reported"
    """The values are unchanged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A fault of a recording.

    Attributes:
        check: The check that found it.
        consequence: What the reader did.
        detail: One sentence: columns, values, and for a correction how it was made.
        rows: Number of rows that it concerns.
        vehicle: Name of the vehicle in the file; None for the whole file.
        first_time_s: Time of its first row, as the file counts [s]; None for the whole file.
    """

    check: Check
    consequence: Consequence
    detail: str
    rows: int
    vehicle: str | None = None
    first_time_s: float | None = None
