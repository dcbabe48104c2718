"""Rules about places and signs: L17, L29."""

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, as_f32
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import (
    RoadInterval,
    distance_to_intervals,
    ego_may_be,
    opposing_lane_span,
    overtaking_span,
    target_may_be,
    zone_intervals,
)
from overtaking.labels.law.margins import (
    SAME_MARGIN_M,
    UNCONSTRAINED,
    breach_frames_in,
    finding_from_margins,
    finding_not_applicable,
)
from overtaking.labels.law.measurement_errors import MeasurementErrors, return_time_error
from overtaking.labels.law.numbers import amount
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.snapshots import METRES_PER_MM, at_frame, slot_or_ego
from overtaking.model.overtake_events import NEVER
from overtaking.model.road_course import ZoneKind
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.vehicles import VehicleKind
from overtaking.model.verdicts import Case, Finding, Verdict

_NO_FRAME = np.iinfo(np.int32).max  # Later than any frame.

_WITH_APPROACH = (ZoneKind.JUNCTION, ZoneKind.PEDESTRIAN_CROSSING, ZoneKind.LEVEL_CROSSING)
"""Places that one must not overtake immediately before, either."""

_WAIVED_ON_SEVERAL_LANES = (
    ZoneKind.CREST,
    ZoneKind.LEVEL_CROSSING,
    ZoneKind.JUNCTION,
    ZoneKind.BEND,
)
"""Article 41(3): with two lanes in the same direction, if the other side is not used."""

_ARTICLE_41 = (*_WAIVED_ON_SEVERAL_LANES, ZoneKind.PEDESTRIAN_CROSSING, ZoneKind.NARROW)

WHILE_OVERTAKING = "From line_crossed until the target is passed and the ego back on its side"


def approach_length(kind: ZoneKind) -> float:
    """How long before a place one must not overtake, by Article 41 [m]."""
    return float(constant("law.places.before")) if kind in _WITH_APPROACH else 0.0


def _intervals_with_approach(case: Case, kinds: Iterable[ZoneKind]) -> list[RoadInterval]:
    return zone_intervals(case, kinds, approach_length)


def keeps_out_of(case: Case, along: list[RoadInterval], applies: Mask) -> Finding:
    """The ego does not overtake in some stretches, in the simulations that count."""
    span, margin = overtaking_span(case), distance_to_intervals(case, along)
    rows = np.flatnonzero(applies & span.is_nonempty)
    is_in_span = span.mask(rows, margin.shape[1])
    min_margin = np.full(len(applies), UNCONSTRAINED)
    min_margin[rows] = np.where(is_in_span, margin[rows], UNCONSTRAINED).min(axis=1)
    first, last, longest = breach_frames_in(span, rows, margin[rows] < 0)
    return finding_from_margins(
        applies & span.is_nonempty & (min_margin < UNCONSTRAINED),
        min_margin,
        first,
        last,
        longest=longest,
    )


def keeps_out_of_zones(
    case: Case,
    applies_by_kind: Mapping[ZoneKind, Mask],
    approach_length: Callable[[ZoneKind], float],
) -> Finding:
    """The ego does not overtake in places of some kinds.

    Args:
        case: The batch.
        applies_by_kind: The simulations that count for each kind, shape (simulation,).
        approach_length: How long before a place of a kind its stretch begins [m].
    """
    return combined_findings(
        [
            keeps_out_of(case, zone_intervals(case, [kind], approach_length), counts)
            for kind, counts in applies_by_kind.items()
        ]
    )


def _lawful_place(case: Case) -> Finding:
    """The ego does not overtake in a place of Article 41, nor a vehicle that itself overtakes."""
    trajectories = case.trajectories
    if not (
        trajectories.road.is_two_way
        or trajectories.road.course
        or "road_kind" in trajectories.unknown
    ):
        return finding_not_applicable(case.signals.num_simulations)
    all_simulations = np.ones(case.signals.num_simulations, np.bool_)
    is_waived = (
        all_simulations & (trajectories.road.num_lanes > 1) & ~opposing_lane_span(case).is_nonempty
    )
    intervals_always = _intervals_with_approach(
        case, set(_ARTICLE_41) - set(_WAIVED_ON_SEVERAL_LANES)
    )
    findings = [
        keeps_out_of(case, intervals_always, all_simulations),
        keeps_out_of(
            case,
            _intervals_with_approach(case, _WAIVED_ON_SEVERAL_LANES),
            all_simulations & ~is_waived,
        ),
        target_keeps_its_side(case),
    ]
    return combined_findings(findings)


def target_keeps_its_side(case: Case) -> Finding:
    """On a two-way road the target is not itself over the line between the directions."""
    trajectories, events, road = case.trajectories, case.events, case.trajectories.road
    if not (road.is_two_way or "road_kind" in trajectories.unknown):
        return finding_not_applicable(case.signals.num_simulations)
    vehicle, frame = case.target.slot, events.attempt
    line = np.float32(road.overtaking_sign * road.lane_boundaries[-1])
    has_target = (vehicle != NO_VEHICLE) & (frame != NEVER)
    return finding_from_margins(has_target, line - target_left_edge(case), frame, frame)


def target_left_edge(case: Case) -> F32:
    """How far the target reaches to the left at the attempt, shape (simulation,) [m]."""
    trajectories, row = case.trajectories, np.arange(case.signals.num_simulations)
    slot, frame = slot_or_ego(case.target.slot), np.maximum(case.events.attempt, 0)
    across = (
        np.float32(trajectories.road.overtaking_sign)
        * as_f32(trajectories.states.d[row, slot, frame])
        * METRES_PER_MM
    )
    return across + trajectories.scenario.vehicles.width[row, slot] * HALF


def combined_findings(findings: list[Finding]) -> Finding:
    """Several checks of one rule: the least margin, and the frames of the breaches."""
    applies = np.stack([finding.verdict != Verdict.NOT_APPLICABLE for finding in findings])
    min_margin = np.where(
        applies, np.stack([finding.margin for finding in findings]), UNCONSTRAINED
    ).min(axis=0)
    first_frames = np.stack(
        [
            np.where(finding.first_frame == NEVER, _NO_FRAME, finding.first_frame)
            for finding in findings
        ]
    )
    last = np.stack([finding.last_frame for finding in findings]).max(axis=0)
    longest = np.stack([finding.longest_run for finding in findings]).max(axis=0)
    return finding_from_margins(
        min_margin < UNCONSTRAINED, min_margin, first_frames.min(axis=0), last, longest=longest
    )


def zone_error(approach_length: Callable[[ZoneKind], float]) -> Spread:
    """Of a position along the road, and of when the ego is back where that decides [m]."""

    def standard_error(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        stop, position = overtaking_span(case).last, np.float32(errors.position_std)
        along = zone_intervals(case, ZoneKind, approach_length)
        at_end = (
            np.abs(at_frame(distance_to_intervals(case, along), stop) - finding.margin)
            < SAME_MARGIN_M
        )
        at_end &= stop == opposing_lane_span(case).last
        return_error = at_frame(case.signals.speed, stop) * return_time_error(case, errors)
        return np.where(
            at_end, np.sqrt(position * position + return_error * return_error), position
        )

    formula = "sp; where the ego is back decides, sqrt(sp^2 + (v sp / speed across the road)^2)"
    return Spread(formula=formula, standard_error=standard_error)


_OF_PLACE = zone_error(approach_length)

L17 = Rule(
    id="pt.ce.41@2013",
    code="L17",
    article="Article 41(1)(a) to (e), (2) and (3)",
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
    required_inputs=frozenset(["road_kind"]),
    check=_lawful_place,
    spread=_OF_PLACE,
)


def _no_sign(case: Case) -> Finding:
    """The ego does not overtake where a sign forbids it."""
    num_simulations = case.signals.num_simulations
    if not case.trajectories.road.course:
        return finding_not_applicable(num_simulations)
    motorcycle = ego_may_be(case, VehicleKind.MOTORCYCLE)
    signs = {
        ZoneKind.NO_OVERTAKING: target_may_be(case, bicycle=False) & ~target_is_motorcycle(case),
        ZoneKind.NO_OVERTAKING_HEAVY: ego_may_be(case, VehicleKind.TRUCK),
        ZoneKind.NO_OVERTAKING_MOTORCYCLE: motorcycle,
    }
    has_target = case.target.slot != NO_VEHICLE
    about_target = {kind: applies & has_target for kind, applies in signs.items()}
    return keeps_out_of_zones(case, about_target, approach_length)


def target_is_motorcycle(case: Case) -> Mask:
    """Whether the target is known to be a motorcycle."""
    vehicle, trajectories = case.target.slot, case.trajectories
    kind = trajectories.scenario.vehicles.kind[np.arange(len(vehicle)), slot_or_ego(vehicle)]
    return (kind == VehicleKind.MOTORCYCLE) & ("kinds" not in trajectories.unknown)


L29 = Rule(
    id="pt.rst.24-c14@2019",
    code="L29",
    article="Regulation of signs, Article 24 (signs C14a to C14c)",
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
    required_inputs=frozenset(["kinds", "speed_limit"]),
    check=_no_sign,
    spread=_OF_PLACE,
    only_two_way_roads=True,
)
