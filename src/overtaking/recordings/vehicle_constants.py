"""Quantities that are constant within a track: sizes, kinds, carriageways."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from overtaking.model.vehicles import VehicleKind, may_be_kind
from overtaking.recordings.column_map import BY_LENGTH, LEFT_OUT, NOT_KNOWN
from overtaking.recordings.findings import Check, Consequence, Finding
from overtaking.scenarios.recording_defaults import kinds_by_length

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.core.arrays import F64, I64, Mask

_KIND_NAMES = {
    **{int(kind): kind.code for kind in VehicleKind},
    BY_LENGTH: "car",
    VehicleKind.TRUCK: "truck",
    VehicleKind.VAN: "van",
    VehicleKind.MOTORCYCLE: "motorcycle",
    VehicleKind.BICYCLE: "bicycle",
    LEFT_OUT: "a type that is not read",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleConstants:
    """Quantities that are constant within a track; arrays have shape (track,).

    Attributes:
        length: [m].
        width: [m].
        kind: `VehicleKind`.
        is_kind_known: Whether the kind is stated and agrees with the length.
        direction: Number of the carriageway; None where no column has it.
        findings: Contradictions between columns.
    """

    length: F64
    width: F64
    kind: I64
    is_kind_known: Mask
    direction: I64 | None
    findings: list[Finding]


def vehicle_kinds(length: F64, type_code: I64, *, has_types: bool) -> tuple[I64, Mask]:
    """The kind of each vehicle, and whether it is known.

    A kind is unknown where none is stated, and where the length contradicts it.

    Args:
        length: Shape (vehicle,) [m].
        type_code: A kind, `BY_LENGTH` for a car, or `NOT_KNOWN`, same shape.
        has_types: Whether the recording states types.
    """
    is_car, no_truck = type_code == BY_LENGTH, np.zeros(len(length), np.bool_)
    by_length = kinds_by_length(length, is_truck=no_truck, is_car=is_car).astype(np.int64)
    kind = np.where(type_code >= 0, type_code, by_length)
    is_known = (type_code != NOT_KNOWN) & may_be_kind(kind, length)
    if not has_types:
        # Without a column of types, "kinds" in `Recording.unknown` covers all vehicles.
        is_known[:] = True
    return kind, is_known


def vote_on_types(
    codes: I64, track: I64, seconds: F64, track_names: NDArray[np.object_], column: str
) -> tuple[I64, list[Finding]]:
    """The most frequent type of each track, and a finding for each track with several.

    Args:
        codes: A `VehicleKind`, `BY_LENGTH`, `LEFT_OUT` or `NOT_KNOWN` for each row, shape (row,).
        track: Index of the track of each row, ascending, same shape.
        seconds: Time of each row, same shape [s].
        track_names: Name of the vehicle of each track.
        column: The column of types.

    Returns:
        The type of each track, `NOT_KNOWN` where no row states one or where two are equally
        frequent, and the findings.
    """
    count = len(track_names)
    kinds = np.unique(codes)
    if len(kinds) == 1:
        return np.full(count, kinds[0]), []
    places = np.searchsorted(kinds, codes)
    votes = np.bincount(track * len(kinds) + places, minlength=count * len(kinds))
    votes = votes.reshape(count, len(kinds))
    votes[:, kinds == NOT_KNOWN] = 0
    most = votes.max(axis=1)
    is_tie = (votes == most[:, None]).sum(axis=1) > 1
    chosen = np.where((most > 0) & ~is_tie, kinds[votes.argmax(axis=1)], NOT_KNOWN)
    findings: list[Finding] = []
    for index in np.flatnonzero((votes > 0).sum(axis=1) > 1).tolist():
        rows = np.arange(*np.searchsorted(track, [index, index + 1]))
        others = rows[(codes[rows] != chosen[index]) & (codes[rows] != NOT_KNOWN)]
        stated = sorted(zip(votes[index].tolist(), kinds.tolist(), strict=True), reverse=True)
        listed = " and ".join(
            f"{_KIND_NAMES[kind]} in {number} row{'s' if number > 1 else ''}"
            for number, kind in stated
            if number
        )
        effect = "its kind is unknown" if is_tie[index] else "the most frequent one is used"
        findings.append(
            Finding(
                check=Check.KINDS,
                consequence=Consequence.CORRECTED,
                detail=f"column {column}: {listed}; {effect}",
                rows=len(others),
                vehicle=str(track_names[index]),
                first_time_s=float(seconds[others[0]]),
            )
        )
    return chosen, findings


def medians(values: F64, group: I64, count: int) -> F64:
    """The median of each group without its NaNs, NaN for an empty group, shape (group,)."""
    is_number = ~np.isnan(values)
    values, group = values[is_number], group[is_number]
    size = np.bincount(group, minlength=count)
    if not len(values):
        return np.full(count, np.nan)
    first = np.minimum(np.cumsum(size) - size, len(values) - 1)
    if (np.diff(values)[np.diff(group) == 0] != 0.0).any():
        values = values[np.lexsort((values, group))]
    low = np.minimum(first + np.maximum(size - 1, 0) // 2, len(values) - 1)
    high = np.minimum(first + size // 2, len(values) - 1)
    return np.where(size > 0, (values[low] + values[high]) * 0.5, np.nan)
