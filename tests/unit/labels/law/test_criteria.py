"""Criteria print their numbers in their sentences, and their error formulas give their errors."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.support.cases import Track, case, ramp, two_way_road
from tests.support.law_fixtures_of_two_ways import place
from tests.support.overtakes import (
    BACK,
    BESIDE,
    alone,
    along_course,
    closing_and_opening,
    crossing,
    limited,
    meeting,
    overtake,
    passing,
    rural,
)

from overtaking.core.errors import KnowledgeError
from overtaking.knowledge.quantities import Quantity
from overtaking.labels.law.criteria.alongside import BicycleDistance, PassingSide, TargetSpeed
from overtaking.labels.law.criteria.starting import GapBehind, NoOtherOvertaking
from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.measurement_errors import MeasurementErrors
from overtaking.labels.law.numbers import quantity
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.road_course import RoadCourse, ZoneKind
from overtaking.model.verdicts import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator

    from overtaking.labels.law.rule import Criterion
    from overtaking.model.road import Road
    from overtaking.model.verdicts import Case

CRITERIA = {rule.code: rule.criterion for rule in (*PORTUGAL.rules, *GERMANY.rules)}

CAPS: set[tuple[type[Criterion], str]] = {
    (NoOtherOvertaking, "max_arrival"),
    (GapBehind, "general_limits"),
}
"""Numbers that no sentence prints, because they only keep margins finite or bound a remedy."""


def paths_of_numbers(record: Any, above: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Names of the fields that lead to each quantity of a record, through nested records."""
    for field in dataclasses.fields(record):
        path, value = (*above, field.name), getattr(record, field.name)
        if isinstance(value, Quantity):
            yield path
        elif dataclasses.is_dataclass(value):
            yield from paths_of_numbers(value, path)


def with_doubled_number(record: Any, path: tuple[str, ...]) -> Any:
    """The record with twice the number to which a path leads."""
    name, *below = path
    value = getattr(record, name)
    if below:
        return dataclasses.replace(record, **{name: with_doubled_number(value, tuple(below))})
    return dataclasses.replace(
        record, **{name: dataclasses.replace(value, value=2.0 * value.number)}
    )


NUMBERS = [
    pytest.param(criterion, path, id=f"{code} {'.'.join(path)}")
    for code, criterion in CRITERIA.items()
    for path in paths_of_numbers(criterion)
    if (type(criterion), path[0]) not in CAPS
]


def behind(s: float = 60.0, *, road: Road | None = None, events: Any = None, **ego: Any) -> Case:
    """The ego and another vehicle of the same speed, 60 m ahead or at another place."""
    track = Track(**({"speed": 30.0} | ego))
    return case(track, Track(s=s, speed=track.speed), road=road, events=events or {})


def returning(oncoming_speed: float) -> Case:
    """Back in frame 150 at 20 m/s, far from an oncoming vehicle of this speed."""
    oncoming = Track(s=700.0, lane=1, speed=oncoming_speed, oncoming=True)
    tracks = Track(speed=20.0), Track(s=-60.0, speed=15.0), oncoming
    return case(*tracks, road=two_way_road(), events=BACK)


def sight_of_300_m() -> Case:
    """An overtake on a two-way road that shows 300 m everywhere."""
    return along_course(RoadCourse(sight=((0.0, 300.0),)), events=BACK)


SP, SV = 0.1, 0.2
ERRORS = MeasurementErrors(position_std=SP, speed_std=SV)
DECEL = 0.9 * 0.7775 * 9.81  # Friction of the dry motorway is 0.7775 at 30 m/s.
GAP_ERROR = math.hypot(math.sqrt(2.0) * SP, SV * math.hypot(1.0 + 30.0 / DECEL, 30.0 / DECEL))
LANE_CHANGE = ramp((4, 0), (6, 1), frames=200)
FASTER = ramp((3, 29.0), (4, 30.0), frames=200)
BY_HAND = [
    # At equal speeds, as L3.
    ("L4", lambda: crossing(Track(s=60.0, speed=30.0, lane=1)), GAP_ERROR),
    ("L5", lambda: crossing(Track(s=-60.0, speed=30.0, lane=1)), GAP_ERROR),
    # In 3 s until the attempt, 100 m between the centres become 82 m, or a gap of 77.6 m.
    (
        "L6",
        lambda: crossing(Track(s=-100.0, speed=36.0, lane=1)),
        math.sqrt(2.0) * math.hypot(SP, 77.6 / 6.0 * SV) / 6.0,
    ),
    ("O2", lambda: passing(1), math.sqrt(2.0) * SV),
    (
        "O6",
        lambda: crossing(Track(s=-100.0, speed=36.0, lane=1)),
        math.sqrt(2.0) * math.hypot(SP, 6.0 / 2.0 * SV),
    ),
    # Behind and ahead at equal speeds, as L3.
    ("L8", lambda: behind(-60.0, events={"return_end": 150}), GAP_ERROR),
    ("L21", lambda: behind(lane=1), GAP_ERROR),
    # The ego passes at 30 m/s a target at 20 m/s, which is then 2 s of its speed behind.
    (
        "L9",
        lambda: passing(1, frames=400, events=BESIDE | {"original_lane": 0}),
        math.hypot(math.sqrt(2.0) * SP, 2.0 * SV) / 10.0,
    ),
    # The gap to the follower, which is 6 m/s faster, is 27.6 m as the 3 s after the change of lane
    # end.
    (
        "L23",
        lambda: crossing(Track(s=-80.0, speed=36.0, lane=1), ego={"lane": LANE_CHANGE}),
        math.sqrt(2.0) * math.hypot(SV * 6.0 / 27.6, SP * 6.0**2 / (2.0 * 27.6**2)),
    ),
    (
        "L3",
        lambda: behind(),
        GAP_ERROR,
    ),
    ("A1", lambda: behind(), math.hypot(math.sqrt(2.0) * SP, 1.5 * SV)),
    # 27 m are due. Each end of the time below them moves by the error of the gap over 0.4 m/s.
    ("A2", closing_and_opening, 2.0 / 0.4 * math.hypot(math.sqrt(2.0) * SP, 0.9 * SV)),
    ("A3", lambda: behind(kind="T"), math.sqrt(2.0) * SP),
    (
        "A4",
        lambda: behind(kind="T", road=two_way_road()),
        math.hypot(math.sqrt(2.0) * SP, 3.0 * SV),
    ),
    ("L28", lambda: behind(kind="T", speed=10.0, road=two_way_road()), math.sqrt(2.0) * SP),
    # At 30 m/s, with the braking distance of `GAP_ERROR`.
    ("L14", lambda: behind(), (1.0 + 30.0 / DECEL) * SV),
    # From the line crossing to the return are 50 frames of 0.05 s; the rule adds 1 s.
    ("L15", sight_of_300_m, (2.5 + 1.0) * SV),
    ("O16", sight_of_300_m, (2.5 + 1.0) * SV),
    # Lanes are 3.75 m wide. The ego is a fifth of a lane left of the middle of its lane.
    ("L1", lambda: passing(1.2), 0.5 * SP / (1.875 - 0.2 * 3.75)),
    ("L2", overtake, SP),
    ("L10", overtake, math.sqrt(2.0) * SP),
    ("L11", lambda: passing(2.4 / 3.75, target={"kind": "B"}), math.sqrt(2.0) * SP / 1.5),
    (
        "L11",
        lambda: passing(1, ego={"speed": FASTER}, target={"kind": "B", "s": 48.0}, events=BESIDE),
        (30.0 - 29.0) / 29.0 * SV / 29.0,
    ),
    ("L12", lambda: passing(1), SV),
    # Over 0.1 m either way of the ego's last place, the limit falls from 120 to 60 km/h.
    ("L12", lambda: alone(road=limited((298.55, 600.0, 60.0))), math.hypot(30.0 / 3.6, SV)),
    ("L13", lambda: passing(1), SV),
    ("V3", lambda: alone(ego={"speed": 13.8}, weather={"fog": 100.0, "rain": 100.0}), SV),
    ("L17", lambda: place(ZoneKind.NARROW, 300.0, 350.0), SP),
    # The centre of the truck is 0.3 m right of the border of the third lane.
    ("L20", lambda: passing(1.5 - 0.3 / 3.75, ego={"kind": "T"}), 0.5 * SP / 0.3),
    ("L29", lambda: place(ZoneKind.NO_OVERTAKING, 300.0, 350.0), SP),
    # The ego is back at 30 m/s; it crosses a lane of 3.5 m in 3 s.
    (
        "O17",
        lambda: place(ZoneKind.PEDESTRIAN_CROSSING, 566.0, 570.0),
        math.hypot(1.0, 30.0 / (3.5 / 3.0)) * SP,
    ),
    # 1 s of 30 m/s is more than 2 s of 10 m/s, and 1 s of 50 m/s less than 2 s of 30 m/s.
    ("L24", lambda: returning(10.0), math.sqrt(2.0) * math.hypot(SP, SV)),
    ("L24", lambda: returning(30.0), math.hypot(math.sqrt(2.0) * SP, 2.0 * SV)),
    # At 30 m/s against 20 m/s, in the opposing lane from frame 76 to 334, which is 12.9 s.
    (
        "L25",
        lambda: rural(meeting(60.0)),
        math.hypot(math.sqrt(2.0) * SP, 13.9 * SV, SV, 50.0 / (3.5 / 3.0) * SP),
    ),
    # The vehicle behind the gap drives 20 m/s, the one ahead of the gap 24 m/s.
    (
        "L27",
        lambda: rural(Track(s=143.8, speed=24.0)),
        math.hypot(math.sqrt(2.0) * SP, (1.0 + 20.0 / DECEL) * SV, (1.0 - 24.0 / DECEL) * SV),
    ),
]
"""Code of a rule, a case, and the error that the formula gives for it."""


@pytest.mark.parametrize(("criterion", "path"), NUMBERS)
def test_a_sentence_prints_every_number_of_its_criterion(criterion, path):
    assert with_doubled_number(criterion, path).predicate() != criterion.predicate()


@pytest.mark.parametrize(("code", "make", "expected"), BY_HAND)
def test_the_error_of_a_margin_is_its_formula(code, make, expected):
    criterion, case = CRITERIA[code], make()
    finding = criterion.check(case)
    assert finding.verdict[0] in (Verdict.LEGAL, Verdict.ILLEGAL)
    error = criterion.standard_error(case, finding, ERRORS)
    assert error is not None
    assert error[0] == pytest.approx(expected, rel=2e-3)


def test_every_error_formula_is_worked_out_by_hand():
    worked_out = {type(CRITERIA[code]) for code, _, _ in BY_HAND}
    case = passing(1)
    for criterion in CRITERIA.values():
        has_formula = criterion.ERROR_FORMULA != "0"
        assert has_formula == (type(criterion) in worked_out)
        if not has_formula:
            assert criterion.standard_error(case, criterion.check(case), ERRORS) is None


def test_an_error_formula_names_numbers_of_the_law_by_their_fields():
    names = {field.name for field in dataclasses.fields(BicycleDistance)}
    assert names & set(BicycleDistance.ERROR_FORMULA.split()) == {"min_gap"}


@pytest.mark.parametrize(("lanes", "expected"), [(1, Verdict.ILLEGAL), (2, Verdict.LEGAL)])
def test_a_law_sets_the_number_of_lanes_to_the_left_for_passing(lanes, expected):
    criterion = PassingSide(max_lanes_left=lanes)
    case = passing(2, events=BESIDE | {"original_lane": 0})
    assert criterion.check(case).verdict[0] == expected
    assert ("one lane" if lanes == 1 else "2 lanes") in criterion.predicate()


def test_a_criterion_has_the_numbers_of_its_law():
    case = passing(1, target={"accel": 0.5})
    assert TargetSpeed().check(case).margin[0] == pytest.approx(-0.2)
    generous = TargetSpeed(max_accel=quantity(0.6, "m/s^2", why="A test"))
    assert generous.check(case).margin[0] == pytest.approx(0.1)


def test_a_number_of_a_law_is_read_in_si_and_printed_as_its_source_states_it():
    speed = quantity(80.0, "km/h", "de-bkatv")
    assert speed.f32 == np.float32(80.0 / 3.6)
    assert (str(speed), speed.bare(), speed.in_unit("m/s")) == ("80 km/h", "80", "22.2 m/s")
    assert quantity(8.33, "m/s", "stl-monitor").in_unit("km/h") == "30 km/h"
    with pytest.raises(KnowledgeError, match="dimension of m/s"):
        speed.in_unit("m")


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ((1.0, "m"), "missing rationale"),
        ((1.0, "m", "no-such-source"), "unknown source"),
        ((1.0, "ell", "de-bkatv"), "unit"),
    ],
)
def test_a_number_without_a_reason_a_known_source_or_a_unit_is_refused(entry, message):
    with pytest.raises(KnowledgeError, match=message):
        quantity(*entry)
