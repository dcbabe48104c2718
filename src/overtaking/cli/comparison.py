"""A comparison of simulators, as values and as a page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group
from rich.text import Text

from overtaking.cli.tables import open_table
from overtaking.model.overtake_events import Outcome
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import OvertakeClass
from overtaking.simulators.comparison import PARTING_DISTANCE, TOGETHER

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from rich.console import RenderableType

    from overtaking.cli.tables import FittingTable
    from overtaking.simulators.comparison import Comparison, Ending, Parting

Values = dict[str, Any]

_KINDS = ("ego ahead or behind", "ego in another lane", "other ahead or behind", "other aside")


def values_of(found: Comparison) -> Values:
    """Totals over all simulations, and a row for each."""
    classes = found.endings[0].classes
    groups = {
        "by_class": [
            (one.title, classes == one) for one in OvertakeClass if (classes == one).any()
        ],
        "by_weather": [(str(name), found.weather == name) for name in np.unique(found.weather)],
    }
    return {
        "simulators": list(found.simulators),
        "simulations": len(found.index),
        "policy": found.policy,
        "same_class": int(found.is_same_class.all(axis=0).sum()),
        "classes": [one.title for one in OvertakeClass],
        "parting_distance_m": PARTING_DISTANCE,
        "others": [_other(found, k) for k in range(len(found.partings))],
        **{
            name: [_group(found, title, mask) for title, mask in group]
            for name, group in groups.items()
        },
        "rows": [_row(found, row) for row in range(len(found.index))],
    }


def _other(found: Comparison, k: int) -> Values:
    """One of the others beside the first simulator."""
    first, other = found.endings[0], found.endings[k + 1]
    counts = np.zeros((len(OvertakeClass), len(OvertakeClass)), np.int64)
    np.add.at(counts, (first.classes, other.classes), 1)
    kind = _kind(found.partings[k])
    return {
        "simulator": found.simulators[k + 1],
        "same_class": int(np.trace(counts)),
        "class_counts": counts.tolist(),
        "partings": {name: int((kind == at).sum()) for at, name in enumerate(_KINDS)},
        "never_part": int((kind < 0).sum()),
    }


def _kind(parting: Parting) -> NDArray[np.int64]:
    """Index into `_KINDS` of each parting; -1 where there is none."""
    aside = np.abs(parting.left) > np.abs(parting.along)
    return np.where(parting.frame == TOGETHER, -1, 2 * (parting.vehicle != EGO_SLOT) + aside)


def _group(found: Comparison, name: str, mask: NDArray[np.bool_]) -> Values:
    """Some of the simulations, side by side on every simulator."""
    return {
        "name": name,
        "simulations": int(mask.sum()),
        "same_class": found.is_same_class[:, mask].sum(axis=1).tolist(),
        "completed": [_count(one, mask, Outcome.COMPLETED) for one in found.endings],
        "collisions": [_count(one, mask, Outcome.COLLISION) for one in found.endings],
        "median_parting_s": [_median(times[mask]) for times in found.times],
    }


def _median(times: NDArray[np.float64]) -> float | None:
    """The time by which half have parted, None if so many never do [s]."""
    middle = float(np.median(times))
    return round(middle, 3) if np.isfinite(middle) else None


def _count(ended: Ending, mask: NDArray[np.bool_], outcome: Outcome) -> int:
    return int((ended.outcome[mask] == outcome).sum())


def _row(found: Comparison, row: int) -> Values:
    every = found.endings
    return {
        "index": int(found.index[row]),
        "weather": str(found.weather[row]),
        "classes": [OvertakeClass(one.classes[row]).title for one in every],
        "lane_changes": [int(one.lane_changes[row]) for one in every],
        "contacts": [bool(one.has_contact[row]) for one in every],
        "frames": [int(one.num_frames[row]) for one in every],
        "partings": [_parting(found, k, row) for k in range(len(found.partings))],
    }


def _parting(found: Comparison, k: int, row: int) -> Values | None:
    """Time and position at which another simulator diverges from the first; None if never."""
    p = found.partings[k]
    if p.frame[row] == TOGETHER:
        return None
    return {
        "time_s": round(float(found.times[k, row]), 3),
        "vehicle": int(p.vehicle[row]),
        "position_m": round(float(p.s[row]), 3),
        "along_m": round(float(p.along[row]), 3),
        "left_m": round(float(p.left[row]), 3),
    }


def render(values: Values) -> Group:
    """A comparison as a page."""
    *most, last = values["simulators"]
    names = f"{', '.join(most)} and {last}"
    head = f"{values['simulations']:,} scenarios on {names}: {values['same_class']:,} of one class"
    head += f" under the policy {values['policy']}"
    parts: list[RenderableType] = [Text(head)]
    for other in values["others"]:
        parts += [Text(), _class_table(values, other), Text(_partings(values, other))]
    for key, title in (("by_class", f"class on {most[0]}"), ("by_weather", "weather")):
        parts += [Text(), _group_table(values, key, title)]
    return Group(*parts)


def _partings(values: Values, other: Values) -> str:
    kinds = ", ".join(f"{count:,} {name}" for name, count in other["partings"].items())
    distance = f"{values['parting_distance_m']:g} m"
    return f"first {distance} apart: {kinds}; {other['never_part']:,} never part"


def _class_table(values: Values, other: Values) -> FittingTable:
    """The classes that there are, one simulator below, the other across."""
    counts = np.array(other["class_counts"])
    across = np.flatnonzero(counts.any(axis=0) | counts.any(axis=1))
    names = [values["classes"][k] for k in across]
    head = f"{values['simulators'][0]} below, {other['simulator']} across"
    table = open_table(head, *(f"{name}>" for name in names))
    for k, name in zip(across, names, strict=True):
        table.add_row(Text(name, style="bold"), *(f"{count:,}" for count in counts[k, across]))
    return table


def _group_table(values: Values, key: str, title: str) -> FittingTable:
    """Groups of simulations, each with what became of them on every simulator."""
    every = values["simulators"]
    others = every[1:]
    columns = [("alike", others, "same_class"), ("completed", every, "completed")]
    columns += [("collided", every, "collisions"), ("half apart", others, "median_parting_s")]
    heads = [f"{head} {name}>" for head, names, _ in columns for name in names]
    table = open_table(title, "scenarios>", *heads)
    for row in values[key]:
        cells = [_cell(cell) for _, _, name in columns for cell in row[name]]
        table.add_row(Text(row["name"], style="bold"), f"{row['simulations']:,}", *cells)
    return table


def _cell(value: float | None) -> str:
    if value is None:
        return "never"
    return f"{value:.2f} s" if isinstance(value, float) else f"{value:,}"
