"""Rules about places and signs: L17, L29."""

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, as_f32
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import (
    Along,
    distance_from,
    ego_may_be,
    on_the_other_side,
    overtaking,
    stretches_of,
    target_may_be,
)
from overtaking.labels.law.margins import ENDLESS, SAME_MARGIN_M, decided, ends_in, inapplicable
from overtaking.labels.law.measurement_errors import MeasurementErrors, time_back_error
from overtaking.labels.law.numbers import amount
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.snapshots import METRES, at, slot_of
from overtaking.model.overtake_events import NEVER
from overtaking.model.road_course import ZoneKind
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.vehicles import VehicleKind
from overtaking.model.verdicts import Case, Finding, Verdict

_LATE = np.iinfo(np.int32).max  # Later than any frame.

_BEFORE = (ZoneKind.JUNCTION, ZoneKind.PEDESTRIAN_CROSSING, ZoneKind.LEVEL_CROSSING)
"""Places that one must not overtake immediately before, either."""

_WAIVED = (ZoneKind.CREST, ZoneKind.LEVEL_CROSSING, ZoneKind.JUNCTION, ZoneKind.BEND)
"""Article 41(3): with two lanes in the same direction, if the other side is not used."""

_OF_41 = (*_WAIVED, ZoneKind.PEDESTRIAN_CROSSING, ZoneKind.NARROW)

WHILE_OVERTAKING = "From line_crossed until the target is passed and the ego back on its side"


def immediately_before(kind: ZoneKind) -> float:
    """How long before a place one must not overtake, by Article 41 [m]."""
    return float(constant("law.places.before")) if kind in _BEFORE else 0.0


def _places_of(case: Case, kinds: Iterable[ZoneKind]) -> list[Along]:
    return stretches_of(case, kinds, immediately_before)


def away_from(case: Case, along: list[Along], about: Mask) -> Finding:
    """The ego does not overtake in some stretches, in the simulations that count."""
    span, margin = overtaking(case), distance_from(case, along)
    rows = np.flatnonzero(about & span.exists)
    inside = span.mask(rows, margin.shape[1])
    low = np.full(len(about), ENDLESS)
    low[rows] = np.where(inside, margin[rows], ENDLESS).min(axis=1)
    first, last, longest = ends_in(span, rows, margin[rows] < 0)
    return decided(about & span.exists & (low < ENDLESS), low, first, last, longest=longest)


def away_from_each(
    case: Case, about: Mapping[ZoneKind, Mask], before: Callable[[ZoneKind], float]
) -> Finding:
    """The ego does not overtake in places of some kinds.

    Args:
        case: The batch.
        about: The simulations that count for each kind, shape (simulation,).
        before: How long before a place of a kind its stretch begins [m].
    """
    return together(
        [
            away_from(case, stretches_of(case, [kind], before), counts)
            for kind, counts in about.items()
        ]
    )


def _lawful_place(case: Case) -> Finding:
    """The ego does not overtake in a place of Article 41, nor a vehicle that itself overtakes."""
    run = case.trajectories
    if not (run.road.is_two_way or run.road.course or "road_kind" in run.unknown):
        return inapplicable(case.signals.num_simulations)
    every = np.ones(case.signals.num_simulations, np.bool_)
    free = every & (run.road.num_lanes > 1) & ~on_the_other_side(case).exists
    always = _places_of(case, set(_OF_41) - set(_WAIVED))
    found = [
        away_from(case, always, every),
        away_from(case, _places_of(case, _WAIVED), every & ~free),
        target_keeps_its_side(case),
    ]
    return together(found)


def target_keeps_its_side(case: Case) -> Finding:
    """On a two-way road the target is not itself over the line between the directions."""
    run, events, road = case.trajectories, case.events, case.trajectories.road
    if not (road.is_two_way or "road_kind" in run.unknown):
        return inapplicable(case.signals.num_simulations)
    vehicle, frame = case.target.slot, events.attempt
    line = np.float32(road.overtaking_sign * road.lane_boundaries[-1])
    there = (vehicle != NO_VEHICLE) & (frame != NEVER)
    return decided(there, line - target_reach(case), frame, frame)


def target_reach(case: Case) -> F32:
    """How far the target reaches to the left at the attempt, shape (simulation,) [m]."""
    run, row = case.trajectories, np.arange(case.signals.num_simulations)
    slot, frame = slot_of(case.target.slot), np.maximum(case.events.attempt, 0)
    across = np.float32(run.road.overtaking_sign) * as_f32(run.states.d[row, slot, frame]) * METRES
    return across + run.scenario.vehicles.width[row, slot] * HALF


def together(found: list[Finding]) -> Finding:
    """Several checks of one rule: the least margin, and the frames of the breaches."""
    about = np.stack([one.verdict != Verdict.NOT_APPLICABLE for one in found])
    low = np.where(about, np.stack([one.margin for one in found]), ENDLESS).min(axis=0)
    firsts = np.stack([np.where(one.first_frame == NEVER, _LATE, one.first_frame) for one in found])
    last = np.stack([one.last_frame for one in found]).max(axis=0)
    longest = np.stack([one.longest_run for one in found]).max(axis=0)
    return decided(low < ENDLESS, low, firsts.min(axis=0), last, longest=longest)


def place_spread(before: Callable[[ZoneKind], float]) -> Spread:
    """Of a position along the road, and of when the ego is back where that decides [m]."""

    def of(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
        stop, position = overtaking(case).stop, np.float32(errors.position_std)
        along = stretches_of(case, ZoneKind, before)
        at_end = np.abs(at(distance_from(case, along), stop) - found.margin) < SAME_MARGIN_M
        at_end &= stop == on_the_other_side(case).stop
        late = at(case.signals.speed, stop) * time_back_error(case, errors)
        return np.where(at_end, np.sqrt(position * position + late * late), position)

    formula = "sp; where the ego is back decides, sqrt(sp^2 + (v sp / speed across the road)^2)"
    return Spread(formula=formula, of=of)


_OF_PLACE = place_spread(immediately_before)

L17 = Rule(
    id="pt.ce.41@2013",
    code="L17",
    law="Article 41(1)(a) to (e), (2) and (3)",
    title="Places and targets",
    gloss="Do not overtake on crests, immediately before and at level crossings, junctions and "
    "crossings, in bends of reduced visibility, where the carriageway is too narrow, nor a vehicle"
    " that overtakes a third. Crests, bends, junctions, level crossings and third vehicles do not "
    "count where there are two or more lanes in the same direction and the opposite side is not "
    "used.",
    predicate=(
        f"{WHILE_OVERTAKING}: the ego's front is in no such place of the road, nor "
        f"{amount('law.places.before')} or less before a crossing or junction. On two-way roads, "
        "at attempt: the target's body is not over the line between the directions."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["road_kind"]),
    check=_lawful_place,
    spread=_OF_PLACE,
)


def _no_sign(case: Case) -> Finding:
    """The ego does not overtake where a sign forbids it."""
    n = case.signals.num_simulations
    if not case.trajectories.road.course:
        return inapplicable(n)
    motorcycle = ego_may_be(case, VehicleKind.MOTORCYCLE)
    signs = {
        ZoneKind.NO_OVERTAKING: target_may_be(case, bicycle=False) & ~of_two_wheels(case),
        ZoneKind.NO_OVERTAKING_HEAVY: ego_may_be(case, VehicleKind.TRUCK),
        ZoneKind.NO_OVERTAKING_MOTORCYCLE: motorcycle,
    }
    there = case.target.slot != NO_VEHICLE
    about_target = {kind: about & there for kind, about in signs.items()}
    return away_from_each(case, about_target, immediately_before)


def of_two_wheels(case: Case) -> Mask:
    """Whether the target is known to be a motorcycle."""
    vehicle, run = case.target.slot, case.trajectories
    kind = run.scenario.vehicles.kind[np.arange(len(vehicle)), slot_of(vehicle)]
    return (kind == VehicleKind.MOTORCYCLE) & ("kinds" not in run.unknown)


L29 = Rule(
    id="pt.rst.24-c14@2019",
    code="L29",
    law="Regulation of signs, Article 24 (signs C14a to C14c)",
    title="Signs against overtaking",
    gloss="Sign C14a forbids to overtake motor vehicles other than two-wheelers. Sign C14b forbids "
    "heavy vehicles to overtake, sign C14c motorcycles and mopeds.",
    predicate=(
        f"{WHILE_OVERTAKING}: the ego's front is not in a stretch with a sign for it and its "
        "target."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    source="pt-signs-2019",
    needs=frozenset(["kinds", "speed_limit"]),
    check=_no_sign,
    spread=_OF_PLACE,
    two_way=True,
)
