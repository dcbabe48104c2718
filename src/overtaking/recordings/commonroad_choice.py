"""Which road of a CommonRoad scenario is read: the one that was asked for, or the busiest."""

import dataclasses
from collections.abc import Iterable, Mapping
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.recordings.commonroad_lanes import Lanelet, contains
from overtaking.recordings.commonroad_road import Network, Stretch
from overtaking.recordings.messages import refused

F64 = NDArray[np.float64]

MAX_ROADS = 48
"""Roads that are tried, the busiest lanelets first."""

SINGLE_LANE = 0.1
"""Weight of traffic on a road with one lane, on which no overtake is possible."""

_MAX_NAMED = 3  # Other roads that are named.
_MAX_SAMPLE = 2_000  # Points that decide how busy lanelets are.


class _Option(NamedTuple):
    """A road that can be read.

    Attributes:
        lanelet: Id of its busiest lanelet.
        road: The road.
        share: Part of all recorded states that is on it.
    """

    lanelet: int
    road: Stretch
    share: float

    @property
    def weight(self) -> float:
        """What the busiest road has most of."""
        return self.share * (1.0 if self.road.road.num_lanes > 1 else SINGLE_LANE)

    def __str__(self) -> str:
        """The lanelet to choose the road by, and what is on it."""
        lanes = self.road.road.num_lanes
        words = "1 lane" if lanes == 1 else f"{lanes} lanes"
        return f"{self.lanelet} ({words}, {self.share:.0%} of the states)"


def chosen_road(network: Network, wanted: int | None, x: F64, y: F64) -> Stretch:
    """The road of a lanelet, or else the one with most traffic.

    A road that cannot be represented is passed over. The notes of the result name the others.

    Args:
        network: The lanelets.
        wanted: Id of the lanelet, None for the busiest road.
        x: Positions of all recorded states, shape (row,) [m].
        y: The same.

    Raises:
        ConfigError: There is no such lanelet.
        ImportFormatError: The road, or every road with traffic, cannot be represented.
    """
    options, refused = _options(network, x, y)
    if wanted is None:
        if not options:
            raise refused[0] if refused else _nobody(network)
        best = max(options, key=lambda one: one.weight).road
    else:
        best = _asked_for(network, wanted, options)
    others = _named(one for one in options if one.road.lanelets != best.lanelets)
    return dataclasses.replace(best, notes=best.notes | {"other_roads": others or None})


def _named(options: Iterable[_Option]) -> str:
    """Some roads, for a message."""
    return "; ".join(map(str, islice(options, _MAX_NAMED)))


def _asked_for(network: Network, wanted: int, options: list[_Option]) -> Stretch:
    """The road of one lanelet."""
    if wanted not in network.lanelets:
        raise ConfigError.of(
            what=f"lanelet {wanted}",
            where="read_commonroad",
            expected=f"one of {', '.join(map(str, sorted(network.lanelets)))}",
            got=str(wanted),
            next_step="choose one of them",
        )
    try:
        return network.stretch(network.lanelets[wanted], is_part=True)
    except ImportFormatError as error:
        named = f", --lanelet {_named(options)}" if options else ""
        raise ImportFormatError(f"{error}{named}") from None


def _options(network: Network, x: F64, y: F64) -> tuple[list[_Option], list[ImportFormatError]]:
    """The roads with traffic, the busiest first, and why others cannot be read."""
    share = _shares(network.lanelets, x, y)
    options: list[_Option] = []
    refused: list[ImportFormatError] = []
    seen: set[int] = set()
    tries = 0
    for number in sorted(share, key=lambda number: (-share[number], number)):
        if number in seen or tries == MAX_ROADS:
            continue
        tries += 1
        try:
            road = network.stretch(network.lanelets[number], is_part=False)
        except ImportFormatError as error:
            refused.append(error)
            seen |= {other.number for other in network.rows[number]}
            continue
        own = {one: share[one] for one in road.lanelets - seen if one in share}
        if own:
            total = sum(share.get(one, 0.0) for one in road.lanelets)
            busiest = max(own, key=lambda one: (own[one], -one))
            options.append(_Option(busiest, road, total))
        # What lies beside a part of it, such as an entry, is no road of its own.
        seen |= {other.number for one in road.lanelets for other in network.rows[one]}
    return sorted(options, key=lambda one: (-one.share, one.lanelet)), refused


def _shares(lanelets: Mapping[int, Lanelet], x: F64, y: F64) -> dict[int, float]:
    """Part of all points that is in each lanelet that is a lane and has any."""
    some = slice(None, None, 1 + len(x) // _MAX_SAMPLE)
    x, y = x[some], y[some]
    found: dict[int, float] = {}
    for number, one in lanelets.items():
        (left, bottom), (right, top) = one.box
        near = (x >= left) & (x <= right) & (y >= bottom) & (y <= top)
        inside = contains(one, x[near], y[near]).sum() if one.is_lane and near.any() else 0
        if inside:
            found[number] = float(inside) / len(x)
    return found


def _nobody(network: Network) -> ImportFormatError:
    return refused(
        network.name, "vehicles", "some on its lanes", "none", "choose another recording"
    )
