"""Words for the description of a simulation, for the terminal and the page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from overtaking.core.units import kmh_from_mps
from overtaking.show.judgement import EVENTS

if TYPE_CHECKING:
    from collections.abc import Callable

    from overtaking.show.judgement import Values

SYMBOLS = "E123456789abcdefghijklmnopqrstuvwxyz"
"""The letter of each vehicle slot; the ego is E."""


def symbol(slot: int) -> str:
    """The letter of a vehicle."""
    return SYMBOLS[slot] if slot < len(SYMBOLS) else "?"


def words(name: str) -> str:
    """The name of a stage, decision, outcome or belief as a person writes it."""
    return name.lower().replace("_", " ")


def who(vehicle: int | None) -> str:
    """A vehicle by its symbol."""
    return "nobody" if vehicle is None else symbol(vehicle)


def sentence(event: str, values: Values) -> str:
    """An event in words."""
    meets = "is struck by" if values["struck_by_partner"] else "runs into"
    target, partner = who(values["target"]), who(values["collision_partner"])
    return EVENTS[event].sentence.format(target=target, partner=partner, meets=meets)


def road_words(road: Values) -> str:
    """The road in words."""
    ids, limit = road["lane_ids"], road["speed_limit_mps"]
    signs = "limit unknown" if limit is None else f"limit {kmh_from_mps(limit):.0f} km/h"
    if lower := road.get("lower_limits"):
        least = min(one["speed_limit_mps"] for one in lower)
        signs += f", in places lower, down to {kmh_from_mps(least):.0f}"
    lanes = f"lanes {ids[0]} (slow) to {ids[-1]} (fast)" if len(ids) > 1 else f"lane {ids[0]}"
    lanes += ", oncoming traffic beside it" if road.get("is_two_way") else ""
    return f"{road['name']}, {lanes}, {signs}, {road['driving_side']}-hand traffic"


def weather_words(weather: Values | None) -> str:
    """Weather and light in words."""
    if weather is None:
        return "unknown"
    sky = ["night" if weather["night"] else "day"]
    sky += [f"{name} {weather[f'{name}_percent']:.0f} %" for name in ("rain", "fog", "wind")]
    sky += ["low sun ahead"] if weather["low_sun"] else []
    return f"{weather['preset'] or 'drawn freely'}: {', '.join(sky)}"


def outcome_words(values: Values) -> str:
    """The outcome, and how it came to it."""
    detail = values["detail"]
    return words(values["outcome"]) + ("" if detail == "none" else f": {words(detail)}")


_PLACES = {"leader": "leader", "new_leader": "ahead", "new_follower": "behind"}


def percept_words(place: str, neighbour: Values) -> tuple[str, str, str, str]:
    """One neighbour as believed and in truth: name, gap, closing speed, and the lawful gap."""
    gap, gap_true = neighbour["gap_m"], neighbour["true_gap_m"]
    closing, closing_true = neighbour["closing_speed_mps"], neighbour["true_closing_speed_mps"]
    truth = ("", "")
    if gap_true is not None:
        truth = (f" ({gap_true:.1f})", f" ({kmh_from_mps(closing_true):+.0f})")
    law = neighbour["law"]
    who = "?" if neighbour["vehicle"] is None else symbol(neighbour["vehicle"])
    return (
        f"{_PLACES[place]} {who}",
        ("not seen" if gap is None else f"{gap:.1f}") + truth[0],
        ("" if closing is None else f"{kmh_from_mps(closing):+.0f}") + truth[1],
        "" if law is None else f"{law['rule']} {words(law['belief'])}",
    )


def ending_words(values: Values) -> list[str]:
    """The outcome, and a line for each collision."""
    passed = values["num_passed"]
    facts = [outcome_words(values).capitalize()]
    if values["num_attempts"] > 1:
        facts.append(f"attempts: {values['num_attempts']}")
    if values["was_intended"] is False:
        facts.append("the attempt was not intended")
    if passed:
        facts.append(f"{passed} vehicle{'s' if passed > 1 else ''} passed")
    end = "." if values["collisions"] else ". No collision."
    first = ", ".join(facts) + end
    return [first, *_oncoming(values.get("oncoming")), *map(_collision, values["collisions"])]


def _oncoming(found: Values | None) -> list[str]:
    """How the overtake stood to oncoming traffic, if the ego entered the opposing lane."""
    if found is None or found["time_in_opposing_lane_s"] is None:
        return []
    told = [f"On the other side for {found['time_in_opposing_lane_s']:.1f} s"]
    if found["gap_at_crossing_m"] is None:
        sight = found["sight_at_crossing_m"]
        return [f"{told[0]}; nobody came, and the road was in sight for {sight:.0f} m."]
    told.append(f"traffic came from {found['gap_at_crossing_m']:.0f} m away")
    if found["gap_at_return_m"] is not None:
        gap, time = found["gap_at_return_m"], found["time_to_meet_at_return_s"]
        told.append(f"{gap:.0f} m ({time:.1f} s) were left")
    return ["; ".join(told) + "."]


def _collision(one: Values) -> str:
    """Collision partners, instant and impact speed."""
    pair = " and ".join(symbol(slot) for slot in one["vehicles"])
    facts = [f"Collision of {pair} at {one['time_s']:.2f} s"]
    if one["impulse_newton_s"] is not None:
        speed = kmh_from_mps(one["closing_speed_mps"])
        facts.append(f"impulse {one['impulse_newton_s']} N s, closing at {speed:.0f} km/h")
    return ": ".join(facts)


def vehicle_words(one: Values) -> str:
    """A vehicle by colour and kind."""
    return f"{one['colour'] or ''} {one['kind'] or 'vehicle'}".strip()


@dataclass(frozen=True, slots=True, kw_only=True)
class Breach:
    """A broken rule in words.

    Attributes:
        rule: Title and article.
        grade: Severity, and the vehicle with the duty if not the ego.
        facts: When, by how much, and what the driver believed.
        remedies: Each of them alone would have kept the rule.
    """

    rule: str
    grade: str
    facts: str
    remedies: list[str]


def breach_words(one: Values, values: Values, dash: str) -> Breach:
    """A broken rule in words.

    Args:
        one: The rule, from `values["broken"]`.
        values: What `describe` says of the simulation.
        dash: Between two ends of a range.
    """
    frames = f"{one['first_frame']}{dash}{one['last_frame']}"
    span = f"{one['from_s']:.2f}{dash}{one['to_s']:.2f} s (frames {frames})"
    if one["first_frame"] == one["last_frame"]:
        span = f"{one['from_s']:.2f} s (frame {one['first_frame']})"
    facts = [span, f"margin {margin_words(one['margin'], one['unit'])}"]
    if one["belief"]:
        facts.append(BELIEFS[one["belief"]])
    grade = words(one["severity"])
    if not one["duty_of_ego"]:
        grade += f"; the duty of {who(values['target'])}, not the ego's"
    elif not one["required_by"]:
        grade += "; no policy asks for it"
    if one["text"] != "read":
        grade += f"; its text is {one['text']}, not read"
    return Breach(
        rule=f"{one['title']}, {one['law']}",
        grade=grade,
        facts="; ".join(facts),
        remedies=[" and ".join(_change(change, values) for change in of) for of in one["remedies"]],
    )


def margin_words(margin: float, unit: str) -> str:
    """A margin with its unit. Shares have the unit 1, which is left out."""
    return f"{margin:.2f}" if unit == "1" else f"{margin:.2f} {unit}"


def doubt_words(one: Values) -> str:
    """A rule that cannot be decided, and what the recording lacks."""
    missing = ", ".join(words(name) for name in one["not_recorded"])
    why = f"not recorded: {missing}" if missing else "its margin is within its error"
    why = "its text was not read" if one["text_not_read"] else why
    return f"{one['rule']} {one['title']} ({why})"


BELIEFS = {
    "legal": "lawful when decided",
    "mistaken": "the driver was mistaken",
    "knowingly_illegal": "knowingly illegal",
    "lucky": "the driver was lucky",
}


Told = tuple[str, str]
"""The change in words; and both values, empty where the change says all."""


def _change(change: Values, values: Values) -> str:
    """A change in words, with the actual value and the lawful one."""
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
    """Says by how much, and of which vehicle; `whole` is whether with both values."""

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
    "gap_to_return": _told("{by} more between those between whom it returns"),
    "place": _told("the overtake {by} away from there", 0, whole=False),
    "evasion": _told("{who} in its lane, {by} less over the edge", 2, whole=False),
    "oncoming_braking": _told("{by} less braking of {who}, which comes towards it,", 2),
    "target_accel": _told("{by} less acceleration of {who}", 2),
}
