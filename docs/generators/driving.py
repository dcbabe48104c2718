"""The reference of what drivers observe and answer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from generators.markdown import page, section, table, unit

from overtaking.model.driver_interface import (
    EGO_COLUMNS,
    NEIGHBOUR_COLUMNS,
    NEIGHBOUR_ROLES,
    PASSING_COLUMNS,
    Move,
    ObservedValue,
)
from overtaking.model.trajectories import Stage
from overtaking.sim.action_spaces import ACTION_SPACES

if TYPE_CHECKING:
    from enum import IntEnum

INTRODUCTION = """\
What a [driver of your own](../how-to/drive-it-yourself.md) observes and answers. Each column of an
`observation` has shape (simulation,) and is float32. A flag is 1 or 0. Networks in ONNX files get
`observation.table`, which has all columns in this order: ego, each neighbour, pass against oncoming
traffic.
"""
EGO_NOTE = """\
Read them as `observation.ego.speed`. Sides are 1 for the overtaking side and -1 for the kerb side;
positions across the road, headings and yaw rates grow towards the overtaking side.
"""
NEIGHBOUR_NOTE = """\
Read them as `observation.leader.gap`. The neighbours are {roles}. Left is the overtaking side, also
in left-hand traffic. The last two approach on the other side of a two-way road. Without a vehicle
all columns are zero except the gap, which is large.
"""
PASSING_NOTE = """\
Read them as `observation.passing.sight_distance`. They are beliefs of the model's driver, also if
the neighbours are observed by a sensor; with a sensor the gap ahead of the leader is zero. On
one-way roads all are zero.
"""
ANSWER = """\
`action`, its numbers, and the limits within which they are clipped. A number acts in whole steps.
"""
CODES = "A `{name}` is one of: {codes}."


def content() -> str:
    """The page `reference/driving.md`."""
    roles = ", ".join(f"`{one}`" for one in NEIGHBOUR_ROLES)
    answers = (
        (
            f"`{name}`" if place == 0 else "",
            f"`{part.name}`",
            unit(part.unit),
            f"{part.low:g} to {part.high:g}",
            f"{part.resolution:g}",
        )
        for name, control in ACTION_SPACES.items()
        for place, part in enumerate(control.parts)
    )
    return page(
        "What a driver observes and answers",
        INTRODUCTION,
        section("The ego", EGO_NOTE, _numbers(EGO_COLUMNS), _codes(Stage)),
        section("The neighbours", NEIGHBOUR_NOTE.format(roles=roles), _numbers(NEIGHBOUR_COLUMNS)),
        section("A pass against oncoming traffic", PASSING_NOTE, _numbers(PASSING_COLUMNS)),
        section(
            "Answers",
            ANSWER,
            table(("`action`", "number", "unit", "limits", "step"), answers),
            _codes(Move),
        ),
    )


def _numbers(columns: dict[str, ObservedValue]) -> str:
    """A table of names, units and meanings."""
    rows = ((f"`{name}`", unit(of), meaning) for name, (of, meaning) in columns.items())
    return table(("name", "unit", "meaning"), rows)


def _codes(kind: type[IntEnum]) -> str:
    """The numbers of an enumeration."""
    codes = ", ".join(f"{int(one)} `{one.name}`" for one in kind)
    return CODES.format(name=kind.__name__, codes=codes)
