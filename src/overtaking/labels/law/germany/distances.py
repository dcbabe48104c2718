"""Distance to the vehicle ahead, § 4: as courts ask for it, as it is fined, and of trucks."""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import (
    distance_to_intervals,
    ego_may_be,
    is_regaining_gap,
    span_after_gap_recovery,
    zone_intervals,
)
from overtaking.labels.law.margins import (
    UNCONSTRAINED,
    finding_from_margins,
    finding_not_applicable,
    finding_over_span,
    minimum_over,
)
from overtaking.labels.law.measurement_errors import MeasurementErrors
from overtaking.labels.law.numbers import GAP_REGAIN_TIME, amount
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.road_course import ZoneKind
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.vehicles import VehicleKind
from overtaking.model.verdicts import Case, Finding


def _gap(case: Case) -> tuple[F32, Mask]:
    """Gap to the leader, and where it counts: not for 3 s after a cut-in; (simulation, time)."""
    signals, place = case.signals, NeighbourRole.LEADER
    counts = (signals.neighbour_slot[:, place] != NO_VEHICLE) & ~is_regaining_gap(case)
    return signals.gap[:, place], counts


def distance_in_whole_mm(speed: F32, seconds: str) -> F32:
    """Way of some tenths of a second, rounded down to whole millimetres [m].

    Speeds are recorded in whole mm/s, so the logic program has the same integers.
    """
    tenths = round(10.0 * float(constant(seconds)))
    whole_mm = np.rint(speed.astype(np.float64) * 1000.0).astype(np.int64) * tenths // 10
    return (whole_mm / 1000.0).astype(np.float32)


def _error(seconds: str) -> Spread:
    """Error of a gap less a way of some seconds."""

    def standard_error(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        del case
        distance = float(constant(seconds)) * errors.speed_std
        return np.full_like(finding.margin, np.hypot(np.sqrt(2.0) * errors.position_std, distance))

    return Spread(
        formula=f"sqrt(2 sp^2 + ({amount(seconds)})^2 sv^2)", standard_error=standard_error
    )


def courts_distance(speed: F32) -> F32:
    """Gap to the leader that courts require at a speed [m/s]; shape of the speeds [m]."""
    return distance_in_whole_mm(speed, "law_de.distance.courts")


def fined_distance(speed: F32) -> F32:
    """Gap to the leader below which a driver is fined at a speed [m/s]; shape of the speeds [m]."""
    return distance_in_whole_mm(speed, "law_de.distance.fined")


def _courts(case: Case) -> Finding:
    """The gap is at least the distance that courts require."""
    gap, counts = _gap(case)
    margin = gap - courts_distance(case.signals.speed)
    return finding_over_span(np.where(counts, margin, UNCONSTRAINED), span_after_gap_recovery(case))


A1 = Rule(
    id="de.stvo.4-1@2013",
    code="A1",
    article="§ 4(1) StVO",
    title="Distance",
    gloss="Keep, as a rule, a distance behind which one can stop even if the vehicle ahead brakes "
    "suddenly.",
    predicate=(
        "At every frame: gap to the leader in the ego's lane >= "
        f"{amount('law_de.distance.courts')} v, which is what courts ask for; not in the "
        f"{GAP_REGAIN_TIME} after the leader cut in or the recording began."
    ),
    unit="m",
    grade=Grade.LIGHT,
    source="de-stvo-2013",
    applies_without_attempt=True,
    check=_courts,
    spread=_error("law_de.distance.courts"),
)


def _check_fined_distance(case: Case) -> Finding:
    """Above 80 km/h the gap is not under the way of 0.9 s for more than 3 s on end, or 140 m."""
    gap, counts = _gap(case)
    speed, span = case.signals.speed, span_after_gap_recovery(case)
    fast = counts & (speed > constant("law_de.distance.fined_above"))
    fast &= span.mask(np.arange(len(speed)), speed.shape[1])
    near = fast & (gap < fined_distance(speed))
    trajectories = _run_lengths(near).astype(np.float32) * np.float32(
        case.signals.frame_interval_ms / 1000.0
    )
    required_distance = constant("law_de.distance.way") / np.maximum(speed, np.float32(1.0))
    margin = np.minimum(constant("law_de.distance.lasting"), required_distance) - trajectories
    minimum = minimum_over(np.where(fast, margin, UNCONSTRAINED), span)
    applies = span.is_nonempty & fast.any(axis=1)
    return finding_from_margins(
        applies,
        minimum.min_margin,
        minimum.first_frame,
        minimum.last_frame,
        longest=minimum.longest_run,
    )


def _run_lengths(mask: Mask) -> np.ndarray:
    """How many frames in a row a mask has held so far, 0 where it does not, (simulation, time)."""
    frame = np.arange(1, mask.shape[1] + 1)
    last_off = np.maximum.accumulate(np.where(mask, 0, frame), axis=1)
    return np.where(mask, frame - last_off, 0)


A2 = Rule(
    id="de.stvo.4-1.fined@2013",
    code="A2",
    article="§ 4(1) StVO; BKatV, annex, numbers 12.5 to 12.7",
    title="Distance, as it is fined",
    gloss=A1.gloss,
    predicate=(
        f"At every frame above {amount('law_de.distance.fined_above')}: the gap has not been under "
        f"five tenths of half the speedometer, {amount('law_de.distance.fined')} v, for more than "
        f"{amount('law_de.distance.lasting')} on end, or than {amount('law_de.distance.way')} / v "
        "if that is less. Exceptions as A1. The margin is the time that was left."
    ),
    unit="s",
    grade=Grade.SERIOUS,
    source="de-stvo-2013",
    applies_without_attempt=True,
    check=_check_fined_distance,
    fine="by the tenths of half the speedometer (BKatV, numbers 12.5 to 12.7)",
)


def truck_distance(speed: F32) -> F32:
    """Gap to the leader that trucks must keep, the same at each speed; shape of the speeds [m]."""
    return np.full_like(speed, constant("law_de.distance.trucks"))


def _trucks_keep_distance(case: Case) -> Finding:
    """On a motorway a truck above 50 km/h is 50 m or more behind."""
    trucks, road = ego_may_be(case, VehicleKind.TRUCK), case.trajectories.road
    motorway = road.kind == "motorway" or "road_kind" in case.trajectories.unknown
    if not (motorway and trucks.any()):
        return finding_not_applicable(case.signals.num_simulations)
    gap, counts = _gap(case)
    counts = counts & (case.signals.speed > constant("law_de.distance.trucks_above"))
    margin = gap - truck_distance(case.signals.speed)
    return finding_over_span(
        np.where(counts & trucks[:, None], margin, UNCONSTRAINED), span_after_gap_recovery(case)
    )


def _two_places(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Error of a gap."""
    del case
    return np.full_like(finding.margin, np.sqrt(2.0) * errors.position_std)


A3 = Rule(
    id="de.stvo.4-3@2013",
    code="A3",
    article="§ 4(3) StVO",
    title="Distance of trucks",
    gloss="On motorways drivers of trucks above 3.5 t keep at least "
    f"{amount('law_de.distance.trucks')} to the vehicle ahead when faster than "
    f"{amount('law_de.distance.trucks_above')}.",
    predicate=(
        "At every frame on a motorway, the ego being a truck above "
        f"{amount('law_de.distance.trucks_above')}: gap to the leader >= "
        f"{amount('law_de.distance.trucks')}. Exceptions as A1."
    ),
    unit="m",
    grade=Grade.LIGHT,
    source="de-stvo-2013",
    required_inputs=frozenset(["kinds", "road_kind"]),
    applies_without_attempt=True,
    check=_trucks_keep_distance,
    spread=Spread(formula="sqrt(2) sp", standard_error=_two_places),
)


def _leaves_room(case: Case) -> Finding:
    """Where a truck can be overtaken, the gap ahead of it holds another vehicle."""
    trajectories, trucks = (
        case.trajectories,
        ego_may_be(case, VehicleKind.TRUCK) & ~case.events.has_attempt,
    )
    in_town = trajectories.road.kind == "town" and "road_kind" not in trajectories.unknown
    if not trajectories.road.is_two_way or trajectories.road.num_lanes > 1 or in_town:
        return finding_not_applicable(case.signals.num_simulations)
    gap, counts = _gap(case)
    bans = zone_intervals(case, [ZoneKind.NO_OVERTAKING], lambda _: 0.0)
    counts = counts & trucks[:, None] & (distance_to_intervals(case, bans) >= 0.0)
    margin = gap - room_for_another(case.signals.speed)
    return finding_over_span(np.where(counts, margin, UNCONSTRAINED), span_after_gap_recovery(case))


def room_for_another(speed: F32) -> F32:
    """A car with the distance that courts ask for behind and ahead of it [m]."""
    distance = courts_distance(np.float32(2.0) * speed)
    return constant("law_de.distance.entering_length") + distance


def _room_error(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Error of a gap less a length and twice the way of 1.5 s."""
    del case
    distance = 2.0 * float(constant("law_de.distance.courts")) * errors.speed_std
    return np.full_like(finding.margin, np.hypot(np.sqrt(2.0) * errors.position_std, distance))


A4 = Rule(
    id="de.stvo.4-2@2013",
    code="A4",
    article="§ 4(2) StVO",
    title="Trucks leave room",
    gloss="Outside built-up areas vehicles with a speed limit of their own keep so large a "
    "distance to the vehicle ahead that one that overtakes can move in. This does not hold for who "
    "moves out to overtake, on several lanes in one direction, and where overtaking is forbidden.",
    predicate=(
        "At every frame on a two-way road with one lane each way outside built-up areas, the ego "
        "being a truck that does not begin to overtake, not in a stretch of sign 276: gap to the "
        f"leader >= {amount('law_de.distance.entering_length')} + 2 x "
        f"{amount('law_de.distance.courts')} v, a car with the distances of A1. Exceptions as A1."
    ),
    unit="m",
    grade=Grade.LIGHT,
    source="de-stvo-2013",
    required_inputs=frozenset(["kinds", "road_kind"]),
    applies_without_attempt=True,
    check=_leaves_room,
    spread=Spread(
        formula=f"sqrt(2 sp^2 + ({amount('law_de.distance.courts', times=2.0)})^2 sv^2)",
        standard_error=_room_error,
    ),
    only_two_way_roads=True,
)
