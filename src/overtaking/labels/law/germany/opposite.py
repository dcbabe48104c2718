"""The side of oncoming traffic and places where one does not overtake: §§ 5, 19, 26, and signs."""

import numpy as np

from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import ego_may_be, target_may_be
from overtaking.labels.law.margins import (
    finding_at_frame,
    finding_from_margins,
    finding_not_applicable,
)
from overtaking.labels.law.numbers import amount
from overtaking.labels.law.oncoming_traffic import L25, L26, NO_REACTION, TIME_TO_PASS
from overtaking.labels.law.rule import Grade, Rule, Spread, adopt
from overtaking.labels.law.sight import (
    SEES_ONCOMING,
    crossing_frame,
    passing_sight_margin,
    sight_error,
)
from overtaking.labels.law.zones import (
    WHILE_OVERTAKING,
    approach_length,
    keeps_out_of_zones,
    target_is_motorcycle,
    zone_error,
)
from overtaking.model.road_course import ZoneKind
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.vehicles import VehicleKind
from overtaking.model.verdicts import Case, Finding
from overtaking.world.sight_distance import all_zones_for

_STVO = "de-stvo-2013"
_SENTENCE = "§ 5(2) sentence 1 StVO"
_SEE = (
    "Only those may overtake who can see that they will not hinder oncoming traffic at any time of "
    "the overtake."
)
_FINE = "100 EUR, 1 point (BKat 19, Kraftfahrt-Bundesamt)"


def _signs(case: Case) -> Finding:
    """The ego does not overtake vehicles with several tracks where a sign forbids it."""
    trajectories, attempted = case.trajectories, case.events.has_attempt
    if not all_zones_for(trajectories.road, 1):
        # Only a posted limit tells that signs are known.
        may_stand = attempted & ("speed_limit" in trajectories.unknown)
        margin = np.zeros(len(attempted), np.float32)
        return finding_from_margins(may_stand, margin, case.events.attempt, case.events.attempt)
    tracks = target_may_be(case, bicycle=False) & ~target_is_motorcycle(case)
    tracks &= case.target.slot != NO_VEHICLE
    signs = {
        ZoneKind.NO_OVERTAKING: tracks,
        ZoneKind.NO_OVERTAKING_HEAVY: tracks & ego_may_be(case, VehicleKind.TRUCK),
    }
    return keeps_out_of_zones(case, signs, approach_length)


O9 = Rule(
    id="de.stvo.5-3-2@2013",
    code="O9",
    article="§ 5(3) number 2 StVO; signs 276 and 277",
    title="Signs",
    gloss="Sign 276 forbids motor vehicles to overtake motor vehicles with several tracks, sign "
    "277 those above 3.5 t.",
    predicate=(
        f"{WHILE_OVERTAKING}: the ego's front is not in a stretch with a sign for it, the target "
        "being no bicycle and no motorcycle."
    ),
    unit="m",
    grade=Grade.LIGHT,
    source=_STVO,
    required_inputs=frozenset(["kinds", "speed_limit"]),
    check=_signs,
    spread=zone_error(approach_length),
)

O14 = adopt(
    L25,
    id="de.stvo.5-2-1.pull-out@2013",
    code="O14",
    article=_SENTENCE,
    title="Time to pass",
    predicate=TIME_TO_PASS,
    gloss=_SEE,
    grade=Grade.SERIOUS,
    source=_STVO,
    fine=_FINE,
)

O15 = adopt(
    L26,
    id="de.stvo.5-2-1.oncoming@2013",
    code="O15",
    article=_SENTENCE,
    title="No reaction of oncoming traffic",
    predicate=NO_REACTION,
    gloss=_SEE,
    grade=Grade.SERIOUS,
    source=_STVO,
    fine=_FINE,
)


def _oversees(case: Case) -> Finding:
    """As the line is crossed, air and road show as much as the overtake takes."""
    if not case.trajectories.road.is_two_way:
        return finding_not_applicable(case.signals.num_simulations)
    return finding_at_frame(
        crossing_frame(case), passing_sight_margin(case), case.events.has_attempt
    )


O16 = Rule(
    id="de.stvo.5-2-1.sight@2013",
    code="O16",
    article=_SENTENCE,
    title="Sight of the road ahead",
    gloss=_SEE,
    predicate=SEES_ONCOMING,
    unit="m",
    grade=Grade.SERIOUS,
    source=_STVO,
    required_inputs=frozenset(["weather"]),
    check=_oversees,
    spread=Spread(
        formula=f"(time on the left + {amount('law.sight.oncoming_margin')}) sv",
        standard_error=sight_error,
    ),
    fine=_FINE,
    only_two_way_roads=True,
)


def _approach_length(kind: ZoneKind) -> float:
    """How long before a crossing one does not overtake [m]."""
    if kind is ZoneKind.LEVEL_CROSSING:
        return float(constant("law_de.pass.level_crossing"))
    return approach_length(kind)


def _no_crossing(case: Case) -> Finding:
    """The ego overtakes no vehicle where pedestrians cross, no motor vehicle where rails cross."""
    if not case.trajectories.road.course:
        return finding_not_applicable(case.signals.num_simulations)
    has_target = case.target.slot != NO_VEHICLE
    crossings = {
        ZoneKind.PEDESTRIAN_CROSSING: has_target,
        ZoneKind.LEVEL_CROSSING: has_target & target_may_be(case, bicycle=False),
    }
    return keeps_out_of_zones(case, crossings, _approach_length)


O17 = Rule(
    id="de.stvo.19-1-3.26-3@2013",
    code="O17",
    article="§ 19(1) sentence 3 and § 26(3) StVO",
    title="Crossings",
    gloss="Drivers do not overtake at crossings of pedestrians, and do not overtake motor vehicles "
    "at level crossings, from their sign on.",
    predicate=(
        f"{WHILE_OVERTAKING}: the ego's front is not in a crossing of pedestrians or "
        f"{amount('law.places.before')} before it, nor, the target being no bicycle, in a level "
        f"crossing or {amount('law_de.pass.level_crossing')} before it."
    ),
    unit="m",
    grade=Grade.LIGHT,
    source=_STVO,
    required_inputs=frozenset(["kinds"]),
    check=_no_crossing,
    spread=zone_error(_approach_length),
    fine="80 EUR at crossings of pedestrians (BKat 113)",
)
