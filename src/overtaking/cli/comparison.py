"""A comparison of two simulators, as values and as a page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from overtaking.model.events import Outcome
from overtaking.model.labels import OvertakeClass
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.model.vehicles import Role
from overtaking.simulators.comparison import PARTING_DISTANCE, POLICY, TOGETHER

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.simulators.comparison import Comparison, Ending

Values = dict[str, Any]

_KINDS = ("ego ahead or behind", "ego in another lane", "other ahead or behind", "other aside")


def values_of(found: Comparison) -> Values:
    """What is said of all simulations together, and a row for each."""
    counts = _crossed(found)
    return {
        "simulators": list(found.simulators),
        "simulations": len(found.index),
        "policy": POLICY,
        "same_class": int(np.trace(counts)),
        "classes": [one.title for one in OvertakeClass],
        "class_counts": counts.tolist(),
        "parting_distance_m": PARTING_DISTANCE,
        "partings": {name: int((_kind(found) == k).sum()) for k, name in enumerate(_KINDS)},
        "never_part": int((found.parting.frame == TOGETHER).sum()),
        "by_weather": [_weather(found, str(name)) for name in np.unique(found.weather)],
        "rows": [_row(found, row) for row in range(len(found.index))],
    }


def _crossed(found: Comparison) -> NDArray[np.int64]:
    """Number of simulations by class on the first and on the second simulator."""
    counts = np.zeros((len(OvertakeClass), len(OvertakeClass)), np.int64)
    np.add.at(counts, (found.one.classes, found.other.classes), 1)
    return counts


def _kind(found: Comparison) -> NDArray[np.int64]:
    """Index into `_KINDS` of each parting; -1 where there is none."""
    p = found.parting
    kind = 2 * (p.vehicle != Role.EGO) + (np.abs(p.left) > np.abs(p.along))
    return np.where(p.frame == TOGETHER, -1, kind)


def _weather(found: Comparison, name: str) -> Values:
    mask = found.weather == name
    times = found.time[mask]
    parted = times[np.isfinite(times)]
    return {
        "weather": name,
        "simulations": int(mask.sum()),
        "same_class": int((found.one.classes == found.other.classes)[mask].sum()),
        "completed": [_count(one, mask, Outcome.COMPLETED) for one in (found.one, found.other)],
        "collisions": [_count(one, mask, Outcome.COLLISION) for one in (found.one, found.other)],
        "median_parting_s": round(float(np.median(parted)), 3) if len(parted) else None,
    }


def _count(ended: Ending, mask: NDArray[np.bool_], outcome: Outcome) -> int:
    return int((ended.outcome[mask] == outcome).sum())


def _row(found: Comparison, row: int) -> Values:
    p = found.parting
    parted = p.frame[row] != TOGETHER
    return {
        "index": int(found.index[row]),
        "weather": str(found.weather[row]),
        "classes": [OvertakeClass(e.classes[row]).title for e in (found.one, found.other)],
        "lane_changes": [int(e.lane_changes[row]) for e in (found.one, found.other)],
        "contacts": [bool(e.has_contact[row]) for e in (found.one, found.other)],
        "frames": [int(e.num_frames[row]) for e in (found.one, found.other)],
        "parting_s": round(float(found.time[row]), 3) if parted else None,
        "parting_vehicle": int(p.vehicle[row]) if p.vehicle[row] != NO_VEHICLE else None,
        "parting_position_m": round(float(p.s[row]), 3) if parted else None,
        "parting_along_m": round(float(p.along[row]), 3) if parted else None,
        "parting_left_m": round(float(p.left[row]), 3) if parted else None,
    }


def render(values: Values) -> Group:
    """A comparison as a page."""
    one, other = values["simulators"]
    total = values["simulations"]
    head = f"{total:,} scenarios on {one} and {other}: {values['same_class']:,} of one class"
    kinds = ", ".join(f"{count:,} {name}" for name, count in values["partings"].items())
    distance = f"{values['parting_distance_m']:g} m"
    foot = f"first {distance} apart: {kinds}; {values['never_part']:,} never part"
    return Group(
        Text(head),
        Text(),
        _class_table(values),
        Text(),
        _weather_table(values),
        Text(),
        Text(foot),
    )


def _class_table(values: Values) -> Table:
    """The classes that there are, one simulator below, the other across."""
    one, other = values["simulators"]
    counts = np.array(values["class_counts"])
    across = np.flatnonzero(counts.any(axis=0) | counts.any(axis=1))
    names = [values["classes"][k] for k in across]
    table = _table(f"{one} below, {other} across", *names)
    for k, name in zip(across, names, strict=True):
        table.add_row(name, *(f"{count:,}" for count in counts[k, across]))
    return table


def _weather_table(values: Values) -> Table:
    one, other = values["simulators"]
    pair = f"{one}, {other}"
    heads = ("scenarios", "alike", f"completed {pair}", f"collisions {pair}", "part after")
    table = _table("weather", *heads)
    for row in values["by_weather"]:
        median = row["median_parting_s"]
        table.add_row(
            row["weather"],
            f"{row['simulations']:,}",
            f"{row['same_class']:,}",
            *(
                ", ".join(f"{count:,}" for count in row[name])
                for name in ("completed", "collisions")
            ),
            "never" if median is None else f"{median:.2f} s",
        )
    return table


def _table(first: str, *others: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column(first, style="bold")
    for name in others:
        table.add_column(name, justify="right")
    return table
