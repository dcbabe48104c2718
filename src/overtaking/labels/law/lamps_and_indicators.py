"""Rules about lamps: L18 and L19."""

import numpy as np

from overtaking.core.arrays import I32, U8, IndexArray, Mask
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import (
    judged_span,
    last_driven_frame,
    meteorological_range,
    seconds_of,
)
from overtaking.labels.law.margins import (
    breach_frames,
    breach_frames_in,
    finding_from_margins,
    flags_any_and_all,
    minimum_to_limit,
    num_frames_in,
)
from overtaking.labels.law.numbers import amount
from overtaking.labels.law.rule import Grade, Rule
from overtaking.labels.signals import encounters_at
from overtaking.labels.snapshots import (
    FrameSpan,
    at_frame,
    indicator_to_kerb_side,
    indicator_to_overtaking_side,
    other_vehicles_at,
)
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import Lights
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import Case, Finding

HIGH_BEAM = int(Lights.HIGH_BEAM)

LOW_OR_HIGH_BEAM = int(Lights.LOW_BEAM) | HIGH_BEAM

REAR_FOG_LAMP = int(Lights.REAR_FOG)

INDICATES = (
    f"From {amount('law.signal.before')} before to {amount('law.signal.after')} after "
    "line_crossed: left indicator on. The same with the right one around the first corner over the "
    "line back. The margin is the time without it."
)

NO_DAZZLE = (
    f"no high beam under {amount('law.lamps.high_beam_behind')} behind the leader or under "
    f"{amount('law.lamps.high_beam_oncoming')} from an oncoming vehicle"
)


def _indicates(case: Case) -> Finding:
    """The indicator is on from 2 s before either line is crossed to 1 s after."""
    crossing, return_crossing = case.events.line_crossed, _first_frame_over_return_line(case)
    unlit_frames = (
        _frames_without_indicator(
            case, crossing, indicator_to_overtaking_side(case.trajectories.road)
        ),
        _frames_without_indicator(
            case, return_crossing, indicator_to_kerb_side(case.trajectories.road)
        ),
    )
    rows, frames = (np.concatenate(parts) for parts in zip(*unlit_frames, strict=True))
    time_without = seconds_of(case, np.bincount(rows, minlength=len(crossing)).astype(np.int32))
    # In a short overtake the way back begins before the way out is done: two sorted runs overlap.
    width = case.trajectories.states.lights.shape[-1]
    instants = np.sort(rows * width + frames, kind="stable")
    rows, frames = np.divmod(instants[np.diff(instants, prepend=-1) > 0], width)
    first, last, longest = breach_frames(rows, frames, len(crossing))
    return finding_from_margins(
        (crossing != NEVER) | (return_crossing != NEVER),
        -time_without,
        first,
        last,
        longest=longest,
    )


def _first_frame_over_return_line(case: Case) -> I32:
    """First frame of the return with a corner over the line back, `NEVER` without one."""
    events, road = case.events, case.trajectories.road
    begin = events.return_begin
    end = np.where(events.return_end != NEVER, events.return_end, events.last)
    span = FrameSpan(first=np.where(begin != NEVER, begin, end + 1), last=end)
    # Of the lane in which the return begins, the border on its slow side.
    lane = np.minimum(at_frame(case.signals.lane, begin), road.num_lanes)
    border = (road.overtaking_sign * road.lane_boundaries).astype(np.float32)[lane]
    return minimum_to_limit(case.signals.right_edge, border, span, is_most=False).first_frame


def _frames_without_indicator(case: Case, crossed: I32, bit: int) -> tuple[IndexArray, IndexArray]:
    """Frames around a crossing without a lamp of the ego: simulation and frame of each."""
    num_frames_before = num_frames_in(case, constant("law.signal.before"))
    num_frames_after = num_frames_in(case, constant("law.signal.after"))
    span = FrameSpan(
        first=np.where(
            crossed != NEVER, np.maximum(crossed - num_frames_before, case.events.first), 0
        ),
        last=np.where(
            crossed != NEVER, np.minimum(crossed + num_frames_after, last_driven_frame(case)), NEVER
        ),
    )
    simulation, frame = span.instants()
    is_off = (case.trajectories.states.lights[simulation, EGO_SLOT, frame] & bit) == 0
    return simulation[is_off], frame[is_off]


L18 = Rule(
    id="pt.ce.21@2013",
    code="L18",
    article="Article 21",
    title="Indicate",
    gloss="Signal a lane change and the start of an overtake with due anticipation, and "
    "throughout.",
    predicate=INDICATES,
    unit="s",
    grade=Grade.LIGHT,
    required_inputs=frozenset(["indicators"]),
    check=_indicates,
)


def _right_lamps(case: Case) -> Finding:
    """Low beam by night and in thick fog, fog lamps in that alone, no high beam that dazzles."""
    span, thick = judged_span(case), meteorological_range(case) < constant("law.lamps.sight")
    lights = case.trajectories.states.lights[:, EGO_SLOT]
    needed = case.trajectories.scenario.weather.night | thick
    rows = np.flatnonzero(span.is_nonempty & _may_have_wrong_lamps(lights, span, needed, thick))
    wrong = needed[rows, None] & ((lights[rows] & LOW_OR_HIGH_BEAM) == 0)
    wrong |= ((lights[rows] & REAR_FOG_LAMP) != 0) != thick[rows, None]
    row, frames = np.nonzero((lights[rows] & HIGH_BEAM) != 0)
    if row.size:
        wrong[row, frames] |= dazzles(case, rows[row], frames)
    first, last, longest = breach_frames_in(span, rows, wrong)
    breach = np.zeros(len(thick), np.int32)
    breach[rows] = (wrong & span.mask(rows, lights.shape[1])).sum(axis=1, dtype=np.int32)
    return finding_from_margins(
        span.is_nonempty, -seconds_of(case, breach), first, last, longest=longest
    )


def _may_have_wrong_lamps(lights: U8, span: FrameSpan, needed: Mask, thick: Mask) -> Mask:
    """Whether some frame of the span may have wrong lamps, shape (simulation,).

    The lamps that are on in any frame and in all frames are quick to find. They rule out most
    simulations before the lamps are read frame by frame.
    """
    ever, always_on = flags_any_and_all(lights, span)
    dark = needed & ((always_on & LOW_OR_HIGH_BEAM) == 0)
    fog = np.where(thick, (always_on & REAR_FOG_LAMP) == 0, (ever & REAR_FOG_LAMP) != 0)
    return dark | fog | ((ever & HIGH_BEAM) != 0)


def dazzles(case: Case, rows: IndexArray, frames: IndexArray) -> Mask:
    """Whether high beam would dazzle a driver ahead or oncoming, at single frames."""
    ahead = encounters_at(case, NeighbourRole.LEADER, rows, frames)
    behind = ahead.valid & (ahead.gap < constant("law.lamps.high_beam_behind"))
    others = other_vehicles_at(case.trajectories, frames.astype(np.int32), rows)
    meets = others.valid & others.is_oncoming & (others.ego_lead < 0)
    near = others.gap < constant("law.lamps.high_beam_oncoming")
    return behind | (meets & near).any(axis=1)


L19 = Rule(
    id="pt.ce.61@2013",
    code="L19",
    article="Articles 60 and 61",
    title="Lamps",
    gloss="Low beam from dusk to dawn and wherever visibility asks for it; no high beam when "
    f"meeting or less than {amount('law.lamps.high_beam_behind')} behind another; rear fog "
    "lamps when required and only then.",
    predicate=(
        "At every frame: low or high beam at night and where the meteorological range is below "
        f"{amount('law.lamps.sight')}; rear fog lamps exactly there; {NO_DAZZLE}. The margin is "
        "the time in breach."
    ),
    unit="s",
    grade=Grade.LIGHT,
    required_inputs=frozenset(["lamps", "weather"]),
    applies_without_attempt=True,
    check=_right_lamps,
)
