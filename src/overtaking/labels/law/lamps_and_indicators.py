"""Rules about lamps: L18 and L19."""

import numpy as np

from overtaking.core.arrays import I32, U8, IndexArray, Mask
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import conduct, driving_end, optical_range, seconds_of
from overtaking.labels.law.margins import bits_within, decided, ends_in, ends_of, frames_of, limited
from overtaking.labels.law.numbers import amount
from overtaking.labels.law.rule import Grade, Rule
from overtaking.labels.signals import encounter
from overtaking.labels.snapshots import Span, at, back_indicator, others_at, out_indicator
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import Lights
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import Case, Finding

HIGH = int(Lights.HIGH_BEAM)

BEAMS = int(Lights.LOW_BEAM) | HIGH

FOG = int(Lights.REAR_FOG)

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
    out, back = case.events.line_crossed, _return_crossed(case)
    dark = _dark(case, out, out_indicator(case)), _dark(case, back, back_indicator(case))
    rows, frames = (np.concatenate(each) for each in zip(*dark, strict=True))
    missing = seconds_of(case, np.bincount(rows, minlength=len(out)).astype(np.int32))
    # In a short overtake the way back begins before the way out is done: two sorted runs overlap.
    width = case.trajectories.states.lights.shape[-1]
    flat = np.sort(rows * width + frames, kind="stable")
    rows, frames = np.divmod(flat[np.diff(flat, prepend=-1) > 0], width)
    first, last, longest = ends_of(rows, frames, len(out))
    return decided((out != NEVER) | (back != NEVER), -missing, first, last, longest=longest)


def _return_crossed(case: Case) -> I32:
    """First frame of the return with a corner over the line back, `NEVER` without one."""
    events, road = case.events, case.trajectories.road
    begin = events.return_begin
    end = np.where(events.return_end != NEVER, events.return_end, events.last)
    span = Span(start=np.where(begin != NEVER, begin, end + 1), stop=end)
    # Of the lane in which the return begins, the border on its slow side.
    lane = np.minimum(at(case.signals.lane, begin), road.num_lanes)
    border = (road.overtaking_sign * road.lane_boundaries).astype(np.float32)[lane]
    return limited(case.signals.right_edge, border, span, is_most=False).first


def _dark(case: Case, crossed: I32, bit: int) -> tuple[IndexArray, IndexArray]:
    """Frames around a crossing without a lamp of the ego: simulation and frame of each."""
    before = frames_of(case, constant("law.signal.before"))
    after = frames_of(case, constant("law.signal.after"))
    around = Span(
        start=np.where(crossed != NEVER, np.maximum(crossed - before, case.events.first), 0),
        stop=np.where(crossed != NEVER, np.minimum(crossed + after, driving_end(case)), NEVER),
    )
    rows, frames = around.frames()
    off = (case.trajectories.states.lights[rows, EGO_SLOT, frames] & bit) == 0
    return rows[off], frames[off]


L18 = Rule(
    id="pt.ce.21@2013",
    code="L18",
    law="Article 21",
    title="Indicate",
    gloss="Signal a lane change and the start of an overtake with due anticipation, and "
    "throughout.",
    predicate=INDICATES,
    unit="s",
    grade=Grade.LIGHT,
    needs=frozenset(["indicators"]),
    check=_indicates,
)


def _right_lamps(case: Case) -> Finding:
    """Low beam by night and in thick fog, fog lamps in that alone, no high beam that dazzles."""
    span, thick = conduct(case), optical_range(case) < constant("law.lamps.sight")
    lights = case.trajectories.states.lights[:, EGO_SLOT]
    needed = case.trajectories.scenario.weather.night | thick
    rows = np.flatnonzero(span.exists & _suspect(lights, span, needed, thick))
    wrong = needed[rows, None] & ((lights[rows] & BEAMS) == 0)
    wrong |= ((lights[rows] & FOG) != 0) != thick[rows, None]
    row, frames = np.nonzero((lights[rows] & HIGH) != 0)
    if row.size:
        wrong[row, frames] |= dazzles(case, rows[row], frames)
    first, last, longest = ends_in(span, rows, wrong)
    breach = np.zeros(len(thick), np.int32)
    breach[rows] = (wrong & span.mask(rows, lights.shape[1])).sum(axis=1, dtype=np.int32)
    return decided(span.exists, -seconds_of(case, breach), first, last, longest=longest)


def _suspect(lights: U8, span: Span, needed: Mask, thick: Mask) -> Mask:
    """Whether a frame may be wrong, from what is on ever and always, shape (simulation,)."""
    ever, always_on = bits_within(lights, span)
    dark = needed & ((always_on & BEAMS) == 0)
    fog = np.where(thick, (always_on & FOG) == 0, (ever & FOG) != 0)
    return dark | fog | ((ever & HIGH) != 0)


def dazzles(case: Case, rows: IndexArray, frames: IndexArray) -> Mask:
    """Whether high beam would dazzle a driver ahead or oncoming, at single frames."""
    ahead = encounter(case, NeighbourRole.LEADER, rows, frames)
    behind = ahead.valid & (ahead.gap < constant("law.lamps.high_beam_behind"))
    others = others_at(case, frames.astype(np.int32), rows)
    meets = others.valid & others.oncoming & (others.lead < 0)
    near = others.gap < constant("law.lamps.high_beam_oncoming")
    return behind | (meets & near).any(axis=1)


L19 = Rule(
    id="pt.ce.61@2013",
    code="L19",
    law="Articles 60 and 61",
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
    needs=frozenset(["lamps", "weather"]),
    without_attempt=True,
    check=_right_lamps,
)
