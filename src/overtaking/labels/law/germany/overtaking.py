"""Overtaking, § 5: on which side, how fast, when not, how far aside, and back again."""

from collections.abc import Callable

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.float32_math import HALF
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.alongside import (
    L1,
    L10,
    L11,
    L22,
    NOT_IN_QUEUES,
    TARGET_KEEPS_SPEED,
    check_lateral_distance,
    in_queue,
)
from overtaking.labels.law.case import (
    alongside,
    ego_may_be,
    meteorological_range,
    neighbour_at,
    signed_lane,
)
from overtaking.labels.law.lamps_and_indicators import INDICATES, L18
from overtaking.labels.law.margins import UNCONSTRAINED, finding_at_frame
from overtaking.labels.law.measurement_errors import MeasurementErrors, gap_error
from overtaking.labels.law.numbers import amount
from overtaking.labels.law.oncoming_traffic import BACK_BEFORE_ONCOMING, L24
from overtaking.labels.law.returning import L9, RETURNS_SOON
from overtaking.labels.law.rule import Grade, Rule, Spread, adopt
from overtaking.labels.law.starting import L7, TARGET_KEEPS_LANE
from overtaking.labels.snapshots import at_frame, vehicle_snapshot
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.vehicles import VehicleKind
from overtaking.model.verdicts import Case, Finding


def _on_the_left(case: Case) -> Finding:
    """While alongside the target the ego is left of it, unless both are in queues."""
    frames_alongside = alongside(case)
    ego_lane = signed_lane(case.signals.lane)[frames_alongside.simulation, frames_alongside.frame]
    margin = (ego_lane - signed_lane(frames_alongside.lane) - HALF).astype(np.float32)
    wrong = np.flatnonzero(margin < 0)
    margin[
        wrong[in_queue(case, frames_alongside.simulation[wrong], frames_alongside.frame[wrong])]
    ] = UNCONSTRAINED
    return frames_alongside.finding(case, margin)


O1 = adopt(
    L1,
    id="de.stvo.5-1@2013",
    code="O1",
    article="§ 5(1) StVO; exceptions § 7(2) and (2a)",
    title="Overtake on the left",
    gloss="Overtaking is done on the left. Where queues have formed one may be faster on the "
    "right.",
    predicate=f"While ego and target overlap: lane(ego) is left of lane(target). {NOT_IN_QUEUES}",
    grade=Grade.SERIOUS,
    source="de-stvo-2013",
    check=_on_the_left,
    spread=L1.spread,
    fine="100 EUR, 1 point (BKat 17, Kraftfahrt-Bundesamt)",
)


def _much_faster(case: Case) -> Finding:
    """As the ego comes alongside it is 10 km/h faster than the target or more."""
    frame, target = case.events.overlap_begin, case.target.slot
    rows, entry_frame = np.arange(len(frame)), np.maximum(frame, 0)
    has_target = vehicle_snapshot(case.trajectories, target, rows, entry_frame)
    faster = at_frame(case.signals.speed, entry_frame) - has_target.speed
    return finding_at_frame(frame, faster - constant("law_de.pass.faster"), target != NO_VEHICLE)


def _two_speeds(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Error of a difference of two speeds."""
    del case
    return np.full_like(finding.margin, np.sqrt(2.0) * errors.speed_std)


O2 = Rule(
    id="de.stvo.5-2-2@2013",
    code="O2",
    article="§ 5(2) sentence 2 StVO",
    title="Substantially faster",
    gloss="Only those may overtake who are substantially faster than the overtaken.",
    predicate=f"At overlap_begin: v - v_target >= {amount('law_de.pass.faster')}.",
    unit="m/s",
    grade=Grade.SERIOUS,
    source="de-stvo-2013",
    check=_much_faster,
    spread=Spread(formula="sqrt(2) sv", standard_error=_two_speeds),
    fine="80 EUR, 1 point (BKat 18, Kraftfahrt-Bundesamt)",
)

O3 = adopt(
    L24,
    id="de.stvo.5-2-1@2013",
    code="O3",
    article="§ 5(2) sentence 1 StVO",
    title="Oncoming traffic",
    predicate=BACK_BEFORE_ONCOMING,
    gloss="Only those may overtake who can see that they will not hinder oncoming traffic at any "
    "time.",
    grade=Grade.SERIOUS,
    source="de-stvo-2013",
    fine="100 EUR, 1 point (BKat 19, Kraftfahrt-Bundesamt)",
)

O4 = adopt(
    L7,
    id="de.stvo.5-3-1@2013",
    code="O4",
    article="§ 5(3) number 1 StVO",
    title="Clear situation",
    predicate=TARGET_KEEPS_LANE,
    gloss="Do not overtake where the situation is unclear, such as behind a vehicle that moves "
    "out.",
    grade=Grade.SERIOUS,
    source="de-stvo-2013",
    fine="100 EUR, 1 point (BKat 19, Kraftfahrt-Bundesamt)",
)


def _trucks_see(case: Case) -> Finding:
    """As a truck begins to overtake, one sees 50 m or more through fog and rain."""
    trucks = ego_may_be(case, VehicleKind.TRUCK) & case.events.has_attempt
    margin = meteorological_range(case) - constant("law_de.pass.truck_sight")
    return finding_at_frame(case.events.attempt, margin, trucks)


O5 = Rule(
    id="de.stvo.5-3a@2013",
    code="O5",
    article="§ 5(3a) StVO",
    title="No overtaking by trucks in fog",
    gloss="Drivers of vehicles above 7.5 t do not overtake if they see less than "
    f"{amount('law_de.pass.truck_sight')} for fog, snow or rain.",
    predicate=(
        "At attempt, the ego being a truck: the meteorological optical range is "
        f"{amount('law_de.pass.truck_sight')} or more."
    ),
    unit="m",
    grade=Grade.SERIOUS,
    source="de-stvo-2013",
    required_inputs=frozenset(["kinds", "weather"]),
    check=_trucks_see,
    fine="120 EUR, 1 point (BKat 21, Kraftfahrt-Bundesamt)",
)


def _calm(gap: F32, speed: F32, closing_speed: F32, decel: F32) -> F32:
    """Margin of a gap behind: no abrupt braking [m]."""
    del speed, decel
    closing = np.maximum(closing_speed, np.float32(0.0))
    return gap - closing * closing / (np.float32(2.0) * constant("law.entry.braking"))


def _not_endangered(place: NeighbourRole, event: str) -> tuple[Callable[[Case], Finding], Spread]:
    """Check and error of a rule about the one behind in a place at an event."""

    def check(case: Case) -> Finding:
        frame = getattr(case.events, event)
        neighbour = neighbour_at(case, place, frame)
        speed = at_frame(case.signals.speed, np.maximum(frame, 0))
        return finding_at_frame(
            frame, _calm(neighbour.gap, speed, neighbour.closing_speed, speed), neighbour.valid
        )

    def error(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        del finding
        return gap_error(case, place, getattr(case.events, event), _calm, errors)

    return check, Spread(
        formula=f"sqrt(2 sp^2 + 2 (dv/a)^2 sv^2), a = {amount('law.entry.braking')}",
        standard_error=error,
    )


_AT_PULL_OUT, _AT_PULL_OUT_ERROR = _not_endangered(NeighbourRole.LEFT_FOLLOWER, "line_crossed")
_AT_RETURN, _AT_RETURN_ERROR = _not_endangered(NeighbourRole.FOLLOWER, "return_end")

O6 = Rule(
    id="de.stvo.5-4-1@2013",
    code="O6",
    article="§ 5(4) sentence 1 StVO",
    title="Following traffic",
    gloss="A driver moving out to overtake behaves so that following traffic is in no danger.",
    predicate=(
        "At line_crossed: gap to the follower in the lane on the left >= closing speed^2 / (2 x "
        f"{amount('law.entry.braking')}), so that it need not brake hard."
    ),
    unit="m",
    grade=Grade.SERIOUS,
    source="de-stvo-2013",
    check=_AT_PULL_OUT,
    spread=_AT_PULL_OUT_ERROR,
    fine="80 EUR, 1 point (BKat 22, Kraftfahrt-Bundesamt)",
)


def motor_vehicle_distance(case: Case) -> np.float32:
    """Smallest lawful distance to the side of a motor vehicle [m]."""
    del case
    return constant("law_de.side.motor")


def _apart_from_motor(case: Case) -> Finding:
    """Check the lateral distance to a motor vehicle."""
    return check_lateral_distance(case, motor_vehicle_distance, bicycle=False)


O7 = adopt(
    L10,
    id="de.stvo.5-4-2@2013",
    code="O7",
    article="§ 5(4) sentence 2 StVO",
    title="Lateral distance",
    gloss="Keep a sufficient distance to the side of others when overtaking.",
    predicate=(
        "While ego and target overlap, the target being no bicycle: distance between their sides "
        f">= {amount('law_de.side.motor')}, which is enough under normal conditions."
    ),
    grade=Grade.LIGHT,
    source="de-stvo-2013",
    check=_apart_from_motor,
    spread=L10.spread,
)

O8 = adopt(
    L18,
    id="de.stvo.5-4a@2013",
    code="O8",
    article="§ 5(4a) StVO",
    title="Indicate",
    predicate=INDICATES,
    grade=Grade.LIGHT,
    gloss="Announce moving out and moving back in time and clearly, with the indicators.",
    source="de-stvo-2013",
)


def bicycle_distance(case: Case) -> np.float32:
    """Smallest lawful distance to the side of a bicycle, which is smaller in towns [m].

    A road of unknown kind gets the larger distance. The choice has no effect: without the kind of
    road the rule is undecidable.
    """
    road, unknown = case.trajectories.road, case.trajectories.unknown
    in_town = road.kind == "town" and "road_kind" not in unknown
    return constant("law_de.side.bicycle_town" if in_town else "law_de.side.bicycle")


def _apart_from_bicycle(case: Case) -> Finding:
    """Check the lateral distance to a bicycle."""
    return check_lateral_distance(case, bicycle_distance, bicycle=True)


O10 = adopt(
    L11,
    id="de.stvo.5-4-3@2013",
    code="O10",
    article="§ 5(4) sentence 3 StVO",
    title="Overtaking a bicycle",
    gloss=f"Motor vehicles keep at least {amount('law_de.side.bicycle_town')} to the side of those "
    "who walk or cycle, outside built-up areas "
    f"{amount('law_de.side.bicycle')}.",
    predicate=(
        "While ego and target overlap, the target being a bicycle: distance between their sides >= "
        f"{amount('law_de.side.bicycle')}, in towns {amount('law_de.side.bicycle_town')}."
    ),
    unit="m",
    grade=Grade.LIGHT,
    source="de-stvo-2013",
    required_inputs=frozenset(["kinds", "road_kind"]),
    check=_apart_from_bicycle,
    spread=L10.spread,
)

O11 = adopt(
    L9,
    id="de.stvo.5-4-5@2013",
    code="O11",
    article="§ 5(4) sentence 5 StVO",
    title="Duty to return",
    predicate=f"{RETURNS_SOON} O3 is the rule for the lane of oncoming traffic.",
    gloss="An overtaking driver moves back to the right as soon as possible.",
    grade=Grade.LIGHT,
    source="de-stvo-2013",
)

O12 = Rule(
    id="de.stvo.5-4-6@2013",
    code="O12",
    article="§ 5(4) sentence 6 StVO",
    title="The overtaken is not hindered",
    gloss="An overtaking driver does not hinder the overtaken.",
    predicate=(
        "At return_end: gap to the vehicle behind >= closing speed^2 / (2 x "
        f"{amount('law.entry.braking')}), so that it need not brake hard."
    ),
    unit="m",
    grade=Grade.LIGHT,
    source="de-stvo-2013",
    check=_AT_RETURN,
    spread=_AT_RETURN_ERROR,
)

O13 = adopt(
    L22,
    id="de.stvo.5-6@2013",
    code="O13",
    article="§ 5(6) sentence 1 StVO",
    title="Let others overtake",
    predicate=TARGET_KEEPS_SPEED,
    gloss="A driver being overtaken does not accelerate.",
    grade=Grade.LIGHT,
    source="de-stvo-2013",
)
