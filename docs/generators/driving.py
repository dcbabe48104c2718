"""The reference of what policies observe and answer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from generators.markdown import page, section, table, unit

from overtaking.model.driver_interface import (
    EGO_COLUMNS,
    NEIGHBOUR_COLUMNS,
    NEIGHBOUR_ROLES,
    PASSING_COLUMNS,
    Move,
)
from overtaking.model.trajectories import Stage
from overtaking.sim.controls import CONTROLS

if TYPE_CHECKING:
    from enum import IntEnum

INTRODUCTION = """\
What a [driver of your own](../how-to/drive-it-yourself.md) is given and answers. `seen.of(name)` is
a number of the ego, `seen.of(name, role)` one of a neighbour, each of shape (simulation,) and
float32. A flag is 1 or 0. Networks in ONNX files get all of them in this order: the numbers of the
ego, for each role those of the neighbour, and those of a pass against oncoming traffic.
"""
AROUND_NOTE = """\
Roles: {roles}. A role is a place: ahead (`lead`) and behind (`rear`) in the ego's lane, and in the
next faster and slower one; the last two are on the other side of the road.
"""
MEETING_NOTE = """\
`seen.of(name)` gives these as well. They are the model driver's own, whatever is observed of
others; a sensor measures no room. On roads of one direction they are zero.
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
        for name, control in CONTROLS.items()
        for place, part in enumerate(control.parts)
    )
    return page(
        "What a driver observes and answers",
        INTRODUCTION,
        section("Numbers of the ego", _numbers(EGO_COLUMNS), _codes(Stage)),
        section(
            "Numbers of a neighbour", AROUND_NOTE.format(roles=roles), _numbers(NEIGHBOUR_COLUMNS)
        ),
        section(
            "Numbers of a pass against oncoming traffic", MEETING_NOTE, _numbers(PASSING_COLUMNS)
        ),
        section(
            "Answers",
            ANSWER,
            table(("`action`", "number", "unit", "limits", "step"), answers),
            _codes(Move),
        ),
    )


def _numbers(named: dict[str, tuple[str, str]]) -> str:
    """A table of names, units and meanings."""
    rows = ((f"`{name}`", unit(of), meaning) for name, (of, meaning) in named.items())
    return table(("name", "unit", "meaning"), rows)


def _codes(kind: type[IntEnum]) -> str:
    """The numbers of an enumeration."""
    codes = ", ".join(f"{int(one)} `{one.name}`" for one in kind)
    return CODES.format(name=kind.__name__, codes=codes)
