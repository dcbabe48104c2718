"""Rules about sight: L14 and L15, each with a strict variant for obstacles without lamps."""

from collections.abc import Callable

import numpy as np

from overtaking.core.arrays import F32, I32, IndexArray
from overtaking.core.float32_math import as_f32
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import (
    judged_span,
    manoeuvre,
    meteorological_range,
    scans,
    seconds_of,
)
from overtaking.labels.law.margins import (
    SAME_MARGIN_M,
    MarginMinimum,
    finding_of_minimum,
    finding_over_span,
    minimum_to_limit,
)
from overtaking.labels.law.measurement_errors import MeasurementErrors, deciding_frame
from overtaking.labels.law.numbers import STOPPING_REACTION_TIME, amount, bare
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.law.safe_distance import decel_with_all_grip, stopping_distance_for_sight
from overtaking.labels.snapshots import FrameSpan, at_frame
from overtaking.model.overtake_events import NEVER
from overtaking.model.verdicts import Case, Finding
from overtaking.world.sight_distance import sight_at


def _stopping(sight: str) -> Callable[[Case, Finding, MeasurementErrors], F32]:
    """Of the stopping distance where it comes nearest to the sight."""

    def standard_error(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        signals = case.signals

        def margin(rows: IndexArray, frames: IndexArray) -> F32:
            stop = stopping_distance_for_sight(
                signals.speed[rows, frames], signals.friction[rows, frames]
            )
            return getattr(signals, sight)[rows, frames] - stop

        frame = deciding_frame(judged_span(case), margin, finding)
        speed = at_frame(signals.speed, frame)
        time = STOPPING_REACTION_TIME.f32 + speed / decel_with_all_grip(
            at_frame(signals.friction, frame)
        )
        return time * np.float32(errors.speed_std)

    return standard_error


STOPPING = Spread(formula="(t + v/b) sv, in the frame of the smallest margin",
                  standard_error=_stopping("sight_lit"))  # fmt: skip

STOPPING_UNLIT = Spread(formula=STOPPING.formula, standard_error=_stopping("sight_unlit"))


def _stops_for_lit(case: Case) -> Finding:
    """The stopping distance is at most the distance at which a lit vehicle is seen."""
    return finding_of_minimum(scans(case).stop_lit, judged_span(case))


def _stops_for_unlit(case: Case) -> Finding:
    """The stopping distance is at most the distance at which an unlit obstacle is seen."""
    return finding_of_minimum(scans(case).stop_unlit, judged_span(case))


_STOP = (
    "Adapt speed to road, weather and traffic, so that the vehicle can be stopped in the free "
    "and visible space ahead."
)


def _stops_within(sight: str) -> str:
    """The predicate of a rule that requires stopping within a sight distance, for all laws."""
    return (
        f"At every frame: v t + v^2 / (2 {bare('friction.table.usable_share')} mu g) <= {sight}, "
        f"t = {STOPPING_REACTION_TIME}."
    )


STOPS_FOR_LIT = _stops_within("the distance at which a lit vehicle is seen")

STOPS_FOR_UNLIT = _stops_within("the distance at which an unlit obstacle is seen")

L14 = Rule(
    id="pt.ce.24-1@2013",
    code="L14",
    article="Article 24(1)",
    title="Stop in the visible space",
    gloss=_STOP,
    predicate=(
        f"{STOPS_FOR_LIT} A leader does not shorten the visible space: its brake lamps announce "
        "what it meets, and L3 is the rule for it."
    ),
    unit="m",
    grade=Grade.SERIOUS,
    required_inputs=frozenset(["weather"]),
    applies_without_attempt=True,
    check=_stops_for_lit,
    spread=STOPPING,
)

L14s = Rule(
    id="pt.ce.24-1.unlit@2013",
    code="L14s",
    article="Article 24(1), strictly",
    title="Stop in the visible space, for the unlit",
    gloss=_STOP,
    predicate=(
        f"{STOPS_FOR_UNLIT} A leader does not shorten the visible space: its brake lamps announce "
        "what it meets, and L3 is the rule for it."
    ),
    unit="m",
    grade=Grade.SERIOUS,
    required_inputs=frozenset(["weather", "lamps"]),
    applies_without_attempt=True,
    check=_stops_for_unlit,
    spread=STOPPING_UNLIT,
)


def _sees_through_air(case: Case) -> Finding:
    """From the start until the target is passed, air and road let one see the carriageway."""
    sight, span, road = meteorological_range(case), _until_passed(case), case.trajectories.road
    if road.is_two_way or road.course:
        sight_of_road = as_f32(sight_at(road, case.signals.s))
        return _sees(
            case, np.minimum(np.broadcast_to(sight[:, None], sight_of_road.shape), sight_of_road)
        )
    # The air is the same in all frames.
    minimum = MarginMinimum(
        min_margin=sight - constant("law.sight.least"),
        first_frame=span.first,
        last_frame=span.last,
        longest_run=span.last - span.first + 1,
    )
    return finding_of_minimum(minimum, span)


def _sees_unlit(case: Case) -> Finding:
    """From the start until the target is passed, an unlit obstacle is seen far enough away."""
    return _sees(case, case.signals.sight_unlit)


def _until_passed(case: Case) -> FrameSpan:
    """From the attempt until the target is passed, or to the end; empty without an attempt."""
    events, stop = case.events, manoeuvre(case).last
    passed = np.where(events.overlap_end != NEVER, np.minimum(events.overlap_end, stop), stop)
    return FrameSpan(first=np.where(events.has_attempt, events.attempt, passed + 1), last=passed)


def _sees(case: Case, sight: F32) -> Finding:
    """A sight (simulation, time) that is enough, at the pull-out also against oncoming traffic."""
    least, span = constant("law.sight.least"), _until_passed(case)
    if not case.trajectories.road.is_two_way:
        return finding_of_minimum(minimum_to_limit(sight, least, span, is_most=False), span)
    margin = sight - least
    row, first = np.flatnonzero(case.events.has_attempt), crossing_frame(case)
    clear = passing_sight_margin(case)[row]
    margin[row, first[row]] = np.minimum(margin[row, first[row]], clear)
    return finding_over_span(margin, span)


def crossing_frame(case: Case) -> I32:
    """When the line is crossed, or the attempt where it never is, shape (simulation,)."""
    events = case.events
    return np.where(events.line_crossed != NEVER, events.line_crossed, events.attempt)


def passing_sight_margin(case: Case) -> F32:
    """Sight distance at the line crossing minus `required_passing_sight`, shape (simulation,) [m].

    Air and road limit this sight distance. The range of attention does not: oncoming vehicles are
    lit, or visible by day, and a driver who overtakes looks as far as the overtake needs.
    """
    return available_sight(case, crossing_frame(case)) - required_passing_sight(case)


def available_sight(case: Case, frame: I32) -> F32:
    """Sight distance that air and road permit at one frame of each simulation [m]."""
    sight_of_road = as_f32(sight_at(case.trajectories.road, at_frame(case.signals.s, frame)))
    return np.minimum(meteorological_range(case), sight_of_road)


def required_passing_sight(case: Case) -> F32:
    """Sight distance that an overtake against oncoming traffic needs, shape (simulation,) [m].

    The distance that the ego and an oncoming vehicle at `assumed_oncoming_speed` drive in
    `required_clear_time`.

    Source:
        AASHTO (2018), section 3.2.4, in the form of a time on the left at both speeds.
    """
    frame = crossing_frame(case)
    ego_speed = at_frame(case.signals.speed, frame)
    return (ego_speed + assumed_oncoming_speed(case, frame)) * required_clear_time(case)


def assumed_oncoming_speed(case: Case, frame: I32) -> F32:
    """Speed that oncoming vehicles are given which the ego cannot see yet, (simulation,) [m/s].

    The highest limit of their direction from where the sight of the ego ends to the ego: they may
    drive at it somewhere on the way.
    """
    road = case.trajectories.road
    near = at_frame(case.signals.s, frame)
    far = near + available_sight(case, frame)
    highest = road.speed_limit_at(near, -1)
    sections = road.course.speed_limits_for(-1) if road.course else ()
    for station in {end for section in sections for end in (section.start, section.stop)} - {
        road.length
    }:
        passes = (near < station) & (station <= far)
        highest = np.where(passes, np.maximum(highest, road.speed_limit_at(station, -1)), highest)
    return as_f32(highest)


def required_clear_time(case: Case) -> F32:
    """Time for which the oncoming lane has to be clear, shape (simulation,) [s]."""
    events = case.events
    return_frame = np.where(events.return_end != NEVER, events.return_end, events.abort_end)
    has_returned = (events.line_crossed != NEVER) & (return_frame != NEVER)
    time_on_left = seconds_of(case, np.where(has_returned, return_frame - events.line_crossed, 0))
    return time_on_left + constant("law.sight.oncoming_margin")


def sight_error(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Error of the sight that is needed against oncoming traffic, by the ego's speed [m]."""
    if not case.trajectories.road.is_two_way:
        return np.zeros_like(finding.margin)
    decides = np.abs(passing_sight_margin(case) - finding.margin) < SAME_MARGIN_M
    return np.where(
        decides, required_clear_time(case) * np.float32(errors.speed_std), np.float32(0.0)
    )


_TIME_LEFT = f"(time on the left + {amount('law.sight.oncoming_margin')})"

_ONCOMING = Spread(
    formula=f"{_TIME_LEFT} sv where oncoming traffic decides, else 0", standard_error=sight_error
)

_SEE = (
    "Do not overtake where visibility is insufficient, that is, where the carriageway cannot be "
    f"seen over {amount('law.sight.least')}; with oncoming traffic, where it is not clear over the "
    "length that is needed."
)

_ENOUGH_SIGHT = (
    f"air and road give a sight of (v + limit) {_TIME_LEFT} or more, limit: the highest for "
    "oncoming traffic within that sight."
)

SEES_ONCOMING = (
    f"On two-way roads, at line_crossed, or at attempt if no line is crossed: {_ENOUGH_SIGHT}"
)


def _sees_until_passed(sight: str) -> str:
    """The predicate of a rule that requires a sight distance until the target is passed."""
    return (
        f"From attempt to overlap_end, or to the end: {sight}. Two-way roads, at line_crossed: "
        f"{_ENOUGH_SIGHT}"
    )


L15 = Rule(
    id="pt.ce.41-1-f@2013",
    code="L15",
    article="Articles 41(1)(f) and 19",
    title="Sufficient visibility",
    gloss=_SEE,
    predicate=_sees_until_passed(
        "the meteorological optical range and the sight that the road gives are "
        f"{amount('law.sight.least')} or more"
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    required_inputs=frozenset(["weather"]),
    check=_sees_through_air,
    spread=_ONCOMING,
)

L15s = Rule(
    id="pt.ce.41-1-f.unlit@2013",
    code="L15s",
    article="Articles 41(1)(f) and 19, strictly",
    title="Sufficient visibility, for the unlit",
    gloss=_SEE,
    predicate=_sees_until_passed(
        f"an unlit obstacle is seen at {amount('law.sight.least')} or more"
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    required_inputs=frozenset(["weather", "lamps"]),
    check=_sees_unlit,
    spread=_ONCOMING,
)
