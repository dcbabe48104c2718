"""Overtaking, § 5: on which side, how fast, when not, how far aside, and back again."""

from collections.abc import Callable

import numpy as np

from overtaking.core.arrays import F32
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import (
    ego_may_be,
    meteorological_range,
    neighbour_at,
)
from overtaking.labels.law.margins import finding_at_frame
from overtaking.labels.law.measurement_errors import MeasurementErrors, gap_error
from overtaking.labels.law.numbers import ABRUPT_BRAKING, amount
from overtaking.labels.law.oncoming_traffic import BACK_BEFORE_ONCOMING, L24
from overtaking.labels.law.rule import Grade, Rule, Spread, adopt
from overtaking.labels.law.starting import L7, TARGET_KEEPS_LANE
from overtaking.labels.snapshots import at_frame, vehicle_snapshot
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.vehicles import VehicleKind
from overtaking.model.verdicts import Case, Finding


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
    return gap - closing * closing / (np.float32(2.0) * ABRUPT_BRAKING.f32)


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
        formula=f"sqrt(2 sp^2 + 2 (dv/a)^2 sv^2), a = {ABRUPT_BRAKING}",
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
        f"{ABRUPT_BRAKING}), so that it need not brake hard."
    ),
    unit="m",
    grade=Grade.SERIOUS,
    source="de-stvo-2013",
    check=_AT_PULL_OUT,
    spread=_AT_PULL_OUT_ERROR,
    fine="80 EUR, 1 point (BKat 22, Kraftfahrt-Bundesamt)",
)


O12 = Rule(
    id="de.stvo.5-4-6@2013",
    code="O12",
    article="§ 5(4) sentence 6 StVO",
    title="The overtaken is not hindered",
    gloss="An overtaking driver does not hinder the overtaken.",
    predicate=(
        "At return_end: gap to the vehicle behind >= closing speed^2 / (2 x "
        f"{ABRUPT_BRAKING}), so that it need not brake hard."
    ),
    unit="m",
    grade=Grade.LIGHT,
    source="de-stvo-2013",
    check=_AT_RETURN,
    spread=_AT_RETURN_ERROR,
)
