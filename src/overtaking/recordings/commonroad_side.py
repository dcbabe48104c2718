"""The side of the road that the traffic of a CommonRoad scenario keeps to."""

from collections.abc import Iterable, Sequence

import numpy as np

from overtaking.core.arrays import F64
from overtaking.model.road import DrivingSide
from overtaking.recordings.commonroad_lanes import Lanelet
from overtaking.recordings.countries import keeps_left

_MAX_APART = 40.0  # Carriageways farther apart belong to different roads [m].
_MIN_APART = 1.0  # Nearer lanelets overlap, as they do in junctions [m].
_MAX_COSINE = -0.9  # Two lanelets are opposite if their angle is within 26 degrees of 180 degrees.
_MAX_LANELETS = 2_000  # The time grows with the square of the number, some 0.1 s at this limit.


def side_of_traffic(lanelets: Iterable[Lanelet], country: str | None) -> tuple[DrivingSide, str]:
    """The side that traffic keeps to, and the source of this information in words.

    Oncoming traffic passes on the left in right-hand traffic. Where lanelets name oncoming
    neighbours, these decide; else the side on which the nearest lanelets with the opposite
    direction lie; else the country; else right-hand traffic is assumed.

    Args:
        lanelets: The lanelets of the scenario.
        country: Code of ISO 3166-1 of its country, None if unknown.
    """
    lanes = [lanelet for lanelet in lanelets if lanelet.is_lane]
    by_neighbours = sum(
        lanelet.length
        * ((lanelet.oncoming_left is not None) - (lanelet.oncoming_right is not None))
        for lanelet in lanes
    )
    by_position = _oncoming_surplus(lanes)
    for source, surplus in (
        ("oncoming neighbours", by_neighbours),
        ("oncoming lanelets", by_position),
    ):
        if surplus:
            return (DrivingSide.RIGHT if surplus > 0.0 else DrivingSide.LEFT), source
    if country is None:
        return DrivingSide.RIGHT, "default"
    return (DrivingSide.LEFT if keeps_left(country) else DrivingSide.RIGHT), "country"


def _oncoming_surplus(lanes: Sequence[Lanelet]) -> float:
    """Length of lanes whose nearest oncoming lane is on the left, minus on the right [m]."""
    if not 2 <= len(lanes) <= _MAX_LANELETS:
        return 0.0
    length = np.array([lanelet.length for lanelet in lanes])
    middle = np.stack([_middle(lanelet) for lanelet in lanes])
    chord = np.stack([lanelet.right[-1] - lanelet.right[0] for lanelet in lanes])
    span = np.hypot(*chord.T)
    ahead = chord / np.maximum(span, 1e-9)[:, None]
    surplus = 0.0
    for k in range(len(lanes)):
        east, north = (middle - middle[k]).T
        along = np.abs(east * ahead[k, 0] + north * ahead[k, 1])
        left = north * ahead[k, 0] - east * ahead[k, 1]
        is_beside = (
            (ahead @ ahead[k] < _MAX_COSINE)
            & (along < 0.5 * (span + span[k]))
            & (np.abs(left) > _MIN_APART)
            & (np.abs(left) < _MAX_APART)
        )
        if is_beside.any():
            nearest = left[is_beside][np.argmin(np.abs(left[is_beside]))]
            surplus += float(np.sign(nearest) * length[k])
    return surplus


def _middle(lanelet: Lanelet) -> F64:
    """A point in the middle of a lanelet."""
    left, right = (side[[0, -1]].mean(axis=0) for side in (lanelet.left, lanelet.right))
    return (left + right) * 0.5
