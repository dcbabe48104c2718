"""The law of one simulation on a terminal: classes, broken rules, and what would have kept them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from overtaking.cli.timeline import who, words
from overtaking.core.units import kmh_from_mps
from overtaking.knowledge import terms

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rich.console import RenderableType

    from overtaking.cli.description import Values
    from overtaking.cli.drawing import Glyphs

_CODE_WIDTH = 5


def law_lines(values: Values, width: int, glyphs: Glyphs) -> Iterator[RenderableType]:
    """Everything about the law.

    Args:
        values: What `describe` says of the simulation.
        width: Columns to fill.
        glyphs: The characters to draw with.
    """
    yield Text(
        f"The law ({values['rules_version']}, an interpretation, no legal advice)", style="bold"
    )
    yield _policies(values, width)
    if values["broken"]:
        yield Text()
        yield Text("Broken, and what would have been legal", style="bold")
    for one in values["broken"]:
        yield _breach(one, values, width, glyphs)
    yield Text()
    yield _rest(values, width)


def _grid(width: int, first: int) -> Table:
    """Two columns, the first of fixed width, the second with its lines broken."""
    grid = Table.grid(padding=(0, 1, 0, 0))
    grid.width = width
    grid.add_column(min_width=first, max_width=first)
    grid.add_column(ratio=1)
    return grid


def _policies(values: Values, width: int) -> Table:
    """Each policy: the class, the rules that made it so, and which rules it requires."""
    grid = _grid(width, max(len(name) for name in values["policies"]))
    for name, one in values["policies"].items():
        facts = [one["class"]]
        reasons = (what for what in ("broken", "undecidable") if one[what])
        facts += [f"{what} {', '.join(one[what])}" for what in reasons]
        words = Text("; ".join(facts))
        grid.add_row(name, words.append(f"\n{terms('policies')[name].meaning}", style="dim"))
    return grid


def _breach(one: Values, values: Values, width: int, glyphs: Glyphs) -> Table:
    """One broken rule: which, how severe, when, by how much, and the remedies."""
    frames = f"{one['first_frame']}{glyphs.dash}{one['last_frame']}"
    span = f"{one['from_s']:.2f}{glyphs.dash}{one['to_s']:.2f} s (frames {frames})"
    if one["first_frame"] == one["last_frame"]:
        span = f"{one['from_s']:.2f} s (frame {one['first_frame']})"
    facts = [span, f"margin {one['margin']:.2f} {one['unit']}"]
    if one["belief"]:
        facts.append(_BELIEFS[one["belief"]])
    body = Text()
    body.append(f"{one['title']}, {one['law']}: ", style="bold")
    body.append(words(one["severity"]))
    if not one["duty_of_ego"]:
        body.append(f"; the duty of {who(values['target'])}, not the ego's")
    elif not one["required_by"]:
        body.append("; no policy asks for it")
    body.append("\n" + "; ".join(facts))
    for place, remedy in enumerate(one["remedies"]):
        text = " and ".join(_change(change, values) for change in remedy)
        body.append(f"\n{'or' if place else 'needs'} {text}")
    grid = _grid(width, _CODE_WIDTH)
    grid.add_row(Text(one["rule"], style="bold"), body)
    return grid


def _rest(values: Values, width: int) -> Table:
    """The rules that cannot be decided, those that are kept, and those that do not apply."""
    grid = _grid(width, len("Do not apply"))
    if not values["broken"]:
        grid.add_row("Broken", "nothing")
    for place, one in enumerate(values["undecidable"]):
        missing = ", ".join(words(name) for name in one["not_recorded"])
        grid.add_row(
            "" if place else "Undecidable",
            f"{one['rule']} {one['title']}" + (f" (not recorded: {missing})" if missing else ""),
        )
    for title, key in (("Kept", "kept"), ("Do not apply", "not_applicable")):
        if values[key]:
            grid.add_row(title, ", ".join(values[key]))
    return grid


_BELIEFS = {
    "legal": "lawful when decided",
    "mistaken": "the driver was mistaken",
    "knowingly_illegal": "knowingly illegal",
    "lucky": "the driver was lucky",
}


Told = tuple[str, str]
"""The change in words; and both values, empty where the change says all."""


def _change(change: Values, values: Values) -> str:
    """A change in words, with the value that was and the one that would have been lawful."""
    what, both = _TELL.get(change["quantity"], _plain)(change, values)
    when = "" if change["time_s"] is None else f" at {change['time_s']:.2f} s"
    return what + when + (f": {both}" if both else "")


def _numbers(change: Values, digits: int = 1) -> Told:
    """The difference, and both values."""
    unit = change["unit"]
    return (
        f"{abs(change['by']):.{digits}f} {unit}",
        f"{change['needed']:.{digits}f} {unit} instead of {change['actual']:.{digits}f} {unit}",
    )


def _speed(change: Values, _: Values) -> Told:
    by, way = abs(change["by"]), "faster" if change["by"] > 0 else "slower"
    needed, actual = (kmh_from_mps(change[name]) for name in ("needed", "actual"))
    both = f"{needed:.0f} km/h instead of {actual:.0f} km/h"
    return f"{by:.1f} m/s ({kmh_from_mps(by):.0f} km/h) {way}", both


def _clearance(change: Values, _: Values) -> Told:
    whose = "" if change["vehicle"] is None else f" between it and {who(change['vehicle'])}"
    return f"{abs(change['by']):.2f} m more to the line{whose}", ""


def _lanes(change: Values, values: Values) -> Told:
    sides = ("left", "right") if values["road"]["driving_side"] == "right" else ("right", "left")
    count = abs(round(change["by"]))
    side = sides[0] if change["by"] > 0 else sides[1]
    return f"{count} lane{'s' if count > 1 else ''} farther to the {side}", ""


def _width(change: Values, _: Values) -> Told:
    by, both = _numbers(change, 2)
    if change["actual"] == 0:
        return "a lane to overtake in", f"{by} wide, there is none"
    return f"a lane beside it that is {by} wider", both


def _plain(change: Values, _: Values) -> Told:
    by, both = _numbers(change, 2)
    way = "more" if change["by"] > 0 else "less"
    return f"{by} {way} {words(change['quantity'])}", both


def _told(text: str, digits: int = 1, *, whole: bool = True) -> Callable[[Values, Values], Told]:
    """Tells by how much, and of whom; `whole` is whether with both values."""

    def tell(change: Values, _: Values) -> Told:
        by, both = _numbers(change, digits)
        return text.format(by=by, who=who(change["vehicle"])), both if whole else ""

    return tell


_TELL: dict[str, Callable[[Values, Values], Told]] = {
    "gap_ahead": _told("{by} more to {who} ahead"),
    "gap_behind": _told("{by} more to {who} behind"),
    "gap_oncoming": _told("{by} more to {who}, which comes towards it,"),
    "lateral_gap": _told("{by} more to the side of {who}", 2),
    "clearance": _clearance,
    "speed": _speed,
    "lanes_left": _lanes,
    "lane": _lanes,
    "time_out": _told("the return {by} sooner", whole=False),
    "arrival": _told("{by} more until the next one comes up from behind"),
    "sight": _told("{by} more sight"),
    "width": _width,
    "unsignalled": _told("the indicator on for {by} more", 2, whole=False),
    "wrong_lamps": _told("the right lamps for {by} more", 2, whole=False),
    "target_drift": _told("{by} less drift of {who} to the side", 2),
    "target_accel": _told("{by} less acceleration of {who}", 2),
}
