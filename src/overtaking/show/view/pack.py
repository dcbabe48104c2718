"""One simulation as the page reads it: its description, and columns of recorded integers.

`viewer/src/bundle.ts` declares the same for the page. Columns are the recorded integers, or those
of a stated step, as differences between neighbours; None where there is no value. Differences take
little room once they are compressed.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.labels.explanation import margins_by_frame
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.vehicles import Colour
from overtaking.model.verdicts import Verdict
from overtaking.show import wording
from overtaking.show.description import describe
from overtaking.show.judgement import EVENTS
from overtaking.show.paragraphs import paragraphs_of
from overtaking.show.video.palette import PAINT
from overtaking.show.video.sky import haze, sky
from overtaking.show.view.ghosts import recorded_beliefs
from overtaking.world.surrogate_safety import ttc

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.labels.labelling import LabelledTrajectories
    from overtaking.model.road import Road
    from overtaking.model.trajectories import Trajectories

    Values = dict[str, Any]

NEAR = {"L3": 10.0, "L10": 0.5, "L12": 2.0, "L14": 20.0, "L14s": 20.0}
"""Margins below which a rule that is kept is shown, in its unit, of rules with a margin in every
frame: some 0.5 s of way at 70 km/h, 7 km/h, and the width of a mirror and a hand."""

_COURSE_EVERY_M = 5.0
_COURSE_STEPS = 100_000
"""Of a curvature per 1/m, and of a slope."""

_LEAST_TTC = 0.1
"""What is nearer to a collision is as near, to be drawn [s]."""

_TTC_STEPS = 10_000
"""Of an inverse time to collision, per 1/s: 20 s are told to a tenth of a second."""

_STEPS_PER_UNIT = 1000
_PLACES = 4  # Decimals of a margin, as in `show --json`: both are then rounded to the same text.
_MM = 1000.0


def pack(labelled: LabelledTrajectories, number: int) -> Values:
    """Everything that a page shows of one simulation.

    Args:
        labelled: A batch of one simulation, with its labels.
        number: Its number in its data set.

    Returns:
        Plain Python values. `values` is what `overtaking show --json` prints.
    """
    run, values = labelled.trajectories, describe(labelled, number)
    return {
        "values": values,
        "told": _told(values),
        "road": _road(run),
        "vehicles": [
            _vehicle(run, int(slot)) for slot in np.flatnonzero(run.scenario.vehicles.valid[0])
        ],
        "leader": _neighbour_slots(labelled, NeighbourRole.LEADER),
        "follower": _neighbour_slots(labelled, NeighbourRole.FOLLOWER),
        "gap_mm": _gap(labelled),
        "inverse_ttc": _inverse_ttc(labelled),
        "sight_dm": _sight(labelled),
        "air": _air(run),
        "law": _law(labelled, values),
        "ghosts": recorded_beliefs(run),
    }


def differences(column: NDArray[np.integer], order: int = 1) -> list[int]:
    """A column as its first value and the differences that follow.

    Args:
        column: Integers, shape (time,).
        order: How often; 2 gives differences of differences.
    """
    found = column.astype(np.int64)
    for _ in range(order):
        found = np.diff(found, prepend=0)
    return found.tolist()


def sparse(column: NDArray[np.floating], steps_per_unit: float) -> list[int | None]:
    """A column with holes, as differences between the values that are there.

    Args:
        column: Shape (time,), NaN where there is no value.
        steps_per_unit: Factor before it is rounded to integers.
    """
    there = np.isfinite(column)
    whole = np.rint(np.where(there, column, 0.0) * steps_per_unit).astype(np.int64)
    values = iter(differences(whole[there]))
    return [next(values) if one else None for one in there.tolist()]


def _told(values: Values) -> Values:
    """What the terminal says, in its words."""
    dash = "–"
    return {
        "road": wording.road_words(values["road"]),
        "weather": wording.weather_words(values["weather"]),
        "outcome": wording.outcome_words(values),
        "ending": wording.ending_words(values),
        "unknown": [wording.words(name) for name in values["not_recorded"]],
        "vehicles": [wording.vehicle_words(one) for one in values["vehicles"]],
        "events": [
            {
                "letter": EVENTS[one["event"]].letter,
                "name": wording.words(one["event"]),
                "sentence": wording.sentence(one["event"], values),
            }
            for one in values["events"]
        ],
        "broken": [asdict(wording.breach_words(one, values, dash)) for one in values["broken"]],
        "undecidable": [wording.doubt_words(one) for one in values["undecidable"]],
        "decisions": [_decision(one) for one in values["decisions"]],
    }


def _decision(one: Values) -> Values:
    """Beliefs at a decision: a row for each neighbour."""
    near = [(place, of) for place, of in one["neighbours"].items() if of is not None]
    rows = [wording.percept_words(place, of) for place, of in near] or [
        ("no vehicle near", "", "", "")
    ]
    return {"kind": wording.words(one["kind"]), "rows": rows}


def _road(run: Trajectories) -> Values:
    """The borders of the lanes from the slow side on, and the lines on them."""
    road = run.road
    lines = [road.lanes[0].right_mark] if road.overtaking_sign > 0 else [road.lanes[0].left_mark]
    lines += [one.left_mark if road.overtaking_sign > 0 else one.right_mark for one in road.lanes]
    is_marked = "marks" not in run.unknown
    return {
        "side": int(road.overtaking_sign),
        "borders_mm": np.rint(road.lane_boundaries * _MM).astype(int).tolist(),
        "lines": [one.value for one in lines] if is_marked else None,
        "verges_mm": [
            0 if one is None else round(one.width * _MM)
            for one in (road.kerb_side_neighbour, road.overtaking_side_neighbour)
        ],
        "oncoming": _oncoming(road, is_marked=is_marked),
        "course": course_of(road),
    }


def course_of(road: Road) -> Values | None:
    """Bends and slopes at stations, as the page draws every road straight; None without any."""
    s = np.arange(0.0, road.length, _COURSE_EVERY_M)
    curvature, grade = road.curvature_at(s), road.grade_at(s)
    if not (curvature.any() or grade.any()):
        return None
    bends, slopes = (
        differences(np.rint(one * _COURSE_STEPS).astype(np.int64)) for one in (curvature, grade)
    )
    return {"every_m": _COURSE_EVERY_M, "curvature": bends, "grade": slopes}


def _oncoming(road: Road, *, is_marked: bool) -> Values | None:
    """The lane of the other direction, and the marks of the line before it, each with its begin."""
    beyond = road.overtaking_side_neighbour
    if beyond is None or not road.is_two_way:
        return None
    edge = beyond.left_mark if road.overtaking_sign > 0 else beyond.right_mark
    begins = [
        (None if begin == -np.inf else begin, mark) for begin, mark in road.overtaking_edge_marks
    ]
    return {
        "width_mm": round(beyond.width * _MM),
        "edge": edge.value if is_marked else None,
        "marks": [[begin, mark.value] for begin, mark in begins] if is_marked else None,
    }


def _vehicle(run: Trajectories, slot: int) -> Values:
    """A body with its motion, in the frames in which it was recorded."""
    bodies, states = run.scenario.vehicles, run.states
    frames = np.flatnonzero(run.state_mask[0, slot])
    first, last = int(frames[0]), int(frames[-1])
    span = slice(first, last + 1)
    headings, direction = run.headings_and_origin
    turn = round(direction / 1e-4)
    is_lit = not run.unknown & {"indicators", "lamps"}
    lights = states.lights[0, slot, span] if is_lit else np.zeros(last + 1 - first, np.uint8)
    away = np.flatnonzero(~run.state_mask[0, slot, span]) + first
    return {
        "slot": slot,
        "symbol": wording.symbol(slot),
        "kind": int(bodies.kind[0, slot]),
        "paint": PAINT[Colour(int(bodies.colour[0, slot]))],
        "length_mm": round(float(bodies.length[0, slot]) * _MM),
        "width_mm": round(float(bodies.width[0, slot]) * _MM),
        "first": first,
        "away": away.tolist(),
        "s": differences(states.s[0, slot, span], 2),
        "d": differences(states.d[0, slot, span], 2),
        "angle": differences(headings[0, slot, span].astype(int) - turn),
        "speed": differences(states.speed[0, slot, span]),
        "accel": differences(states.accel_lon[0, slot, span]),
        "lights": differences(lights),
    }


def _neighbour_slots(labelled: LabelledTrajectories, role: NeighbourRole) -> list[int | None]:
    """Slot of the vehicle that has a role, frame by frame; None where no vehicle has it.

    Gaps and times to collision of the frame refer to this vehicle. The page finds beliefs by the
    slot, not by the role: from the decision to change lanes on, the driver's leader is the vehicle
    ahead in the new lane.
    """
    signals, frames = labelled.signals, int(labelled.trajectories.num_frames[0])
    has_role = signals.has_neighbour(role)[0, :frames]
    return sparse(
        np.where(has_role, signals.neighbour_slot[0, role, :frames].astype(float), np.nan), 1
    )


def _margin_steps(margins: NDArray[np.floating]) -> list[int | None]:
    """Margins in whole steps. A negative one stays negative, as its sign is the verdict."""
    steps = np.rint(margins * _STEPS_PER_UNIT)
    return sparse(np.where((margins < 0) & (steps == 0), -1.0, steps), 1)


def _gap(labelled: LabelledTrajectories) -> list[int | None]:
    """From the ego's bumper to that of the vehicle ahead in its lane."""
    seen, last = labelled.signals, int(labelled.trajectories.num_frames[0])
    there = seen.has_neighbour(NeighbourRole.LEADER)[0, :last]
    return sparse(np.where(there, seen.gap[0, NeighbourRole.LEADER, :last], np.nan), _MM)


def _inverse_ttc(labelled: LabelledTrajectories) -> Values:
    """One over the time to collision, to the vehicle ahead and that of the one behind.

    As `Encounter.ttc` of the measures of safety, 0 where they do not close. Its inverse has no
    infinities, and what is urgent is large.
    """
    seen, last = labelled.signals, int(labelled.trajectories.num_frames[0])

    def to(place: NeighbourRole) -> list[int | None]:
        time = ttc(seen.gap[0, place, :last], seen.closing_speed[0, place, :last])
        urgency = 1.0 / np.maximum(time, _LEAST_TTC)
        return sparse(np.where(seen.has_neighbour(place)[0, :last], urgency, np.nan), _TTC_STEPS)

    return {"ahead": to(NeighbourRole.LEADER), "behind": to(NeighbourRole.FOLLOWER)}


def _sight(labelled: LabelledTrajectories) -> list[int] | None:
    """How far the ego sees a lit vehicle; None where the weather is not known."""
    if "weather" in labelled.trajectories.unknown:
        return None
    sight = labelled.signals.sight_lit[0, : int(labelled.trajectories.num_frames[0])]
    return differences(np.rint(sight * 10.0).astype(np.int64))


def _air(run: Trajectories) -> Values:
    """The weather in words, and the extinction of what fog and rain hide [1/m]; as in films."""
    seen = sky(run)
    return {"text": seen.text, "extinction": haze(seen)}


def _law(labelled: LabelledTrajectories, values: Values) -> list[Values]:
    """The rules that are broken, then those that are nearly, each with its paragraph."""
    said = {one["rule"]: one["paragraph"] for one in paragraphs_of(labelled, values, PORTUGAL)}
    findings, frames = labelled.findings, int(labelled.trajectories.num_frames[0])
    series = margins_by_frame(labelled)
    rows = []
    for place, rule in enumerate(PORTUGAL.rules):
        verdict, margin = int(findings.verdict[0, place]), float(findings.margin[0, place])
        broken, of = verdict == Verdict.ILLEGAL, series.get(rule.code)
        if not broken and (of is None or margin >= NEAR[rule.code]):
            continue
        span = (
            [int(findings.first_frame[0, place]), int(findings.last_frame[0, place])]
            if broken
            else None
        )
        rows.append(
            {
                "rule": rule.code,
                "margin": round(margin, _PLACES),
                "breach": span,
                "margins": None if of is None else _margin_steps(of[:frames]),
                "paragraph": said[rule.code],
            }
        )
    return sorted(rows, key=lambda one: (one["breach"] is None, one["breach"] or []))
