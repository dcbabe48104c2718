"""Criteria about the lamps and the indicators of the ego.

A `Case` is a batch of simulations with one ego each. An event is a frame of each simulation,
`NEVER` (-1) without it; a span is the first and the last frame of a stretch of time. `judged_span`
lasts from 3 s before the attempt to overtake to 3 s after the return; without an attempt it has all
driven frames. The docstring of the package `criteria` explains these terms in full,
`rule.Criterion` describes the methods.
"""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import I32, U8, IndexArray, Mask
from overtaking.knowledge.quantities import Quantity
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
from overtaking.labels.law.numbers import quantity
from overtaking.labels.law.remedies import (
    BreachContext,
    Remedy,
    RemedyQuantity,
    change_by_margin,
)
from overtaking.labels.law.rule import Criterion
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

_HIGH_BEAM = int(Lights.HIGH_BEAM)
_LOW_OR_HIGH_BEAM = int(Lights.LOW_BEAM) | _HIGH_BEAM
_REAR_FOG_LAMP = int(Lights.REAR_FOG)


@dataclass(frozen=True, slots=True, kw_only=True)
class IndicatorUse(Criterion):
    """The indicator is on around both line crossings: out of the lane, and back into it.

    Attributes:
        time_before: Time before the crossing for which the indicator must be on.
        time_after: Time after the crossing for which it must stay on.
    """

    time_before: Quantity = quantity(
        2.0, "s", why="A choice; drivers around need some time to see the signal and to react"
    )
    time_after: Quantity = quantity(
        1.0, "s", why="A choice; the signal stays on while the body crosses the line"
    )
    unit: str = "s"

    @property
    def required_inputs(self) -> frozenset[str]:
        """The indicators."""
        return frozenset(["indicators"])

    def predicate(self) -> str:
        """Both crossings, and the margin."""
        return (
            f"From {self.time_before} before to {self.time_after} after line_crossed: left "
            "indicator on. The same with the right one around the first corner over the line "
            "back. The margin is the time without it."
        )

    def check(self, case: Case) -> Finding:
        """The time without the indicator, summed over both crossings, is the breach."""
        road = case.trajectories.road
        crossing, return_crossing = case.events.line_crossed, _first_frame_over_return_line(case)
        unsignalled_instants = (
            self._unsignalled_instants(case, crossing, indicator_to_overtaking_side(road)),
            self._unsignalled_instants(case, return_crossing, indicator_to_kerb_side(road)),
        )
        simulation, frame = (
            np.concatenate(parts) for parts in zip(*unsignalled_instants, strict=True)
        )
        # Each crossing has a duty of its own, so a frame without the indicators of both counts
        # twice in the margin. The frames of the breach list it once.
        num_unsignalled = np.bincount(simulation, minlength=len(crossing)).astype(np.int32)
        # `breach_frames` takes each instant once, in order, but the frames of the two crossings
        # overlap in a short overtake. A pair of simulation and frame is sorted as one number:
        # sorting pairs took half of the time of all rules.
        num_frames = case.trajectories.states.lights.shape[-1]
        instants = np.sort(simulation * num_frames + frame, kind="stable")
        is_new = np.diff(instants, prepend=-1) > 0
        simulation, frame = np.divmod(instants[is_new], num_frames)
        first, last, num_run_frames = breach_frames(simulation, frame, len(crossing))
        return finding_from_margins(
            (crossing != NEVER) | (return_crossing != NEVER),
            -seconds_of(case, num_unsignalled),
            first,
            last,
            longest=num_run_frames,
        )

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """No time without the indicator."""
        return change_by_margin(breach, RemedyQuantity.UNSIGNALLED, limit=0.0)

    def _unsignalled_instants(
        self, case: Case, crossing: I32, indicator: int
    ) -> tuple[IndexArray, IndexArray]:
        """Simulation and frame of each instant, around one crossing, without the indicator.

        Args:
            case: The batch.
            crossing: Frame of the crossing, `NEVER` without one, shape (simulation,).
            indicator: Bit of the indicator in the recorded lamps.
        """
        num_frames_before = num_frames_in(case, self.time_before.f32)
        num_frames_after = num_frames_in(case, self.time_after.f32)
        first = np.maximum(crossing - num_frames_before, case.events.first)
        last = np.minimum(crossing + num_frames_after, last_driven_frame(case))
        has_crossing = crossing != NEVER
        # Without a crossing the span is 0 to `NEVER` (-1), so it is empty.
        span = FrameSpan(
            first=np.where(has_crossing, first, 0), last=np.where(has_crossing, last, NEVER)
        )
        simulation, frame = span.instants()
        lights = case.trajectories.states.lights[simulation, EGO_SLOT, frame]
        is_off = (lights & indicator) == 0
        return simulation[is_off], frame[is_off]


def _first_frame_over_return_line(case: Case) -> I32:
    """First frame of the return in which a corner crosses the line back, `NEVER` without one.

    The line back is the right border of the lane in which the return begins.
    """
    events, road = case.events, case.trajectories.road
    begin = events.return_begin
    end = np.where(events.return_end != NEVER, events.return_end, events.last)
    span = FrameSpan(first=np.where(begin != NEVER, begin, end + 1), last=end)
    # Border k is on the right of lane k. A lane code of `num_lanes` or more is a place left of the
    # driving lanes, with the last border on its right. Only code 255 is beyond the slow edge, where
    # no return begins: the ego is farthest left then.
    lane = np.minimum(at_frame(case.signals.lane, begin), road.num_lanes)
    border = (road.overtaking_sign * road.lane_boundaries).astype(np.float32)[lane]
    # The border is a lower limit of the right side: the first frame below it is the crossing.
    return minimum_to_limit(case.signals.right_edge, border, span, is_most=False).first_frame


@dataclass(frozen=True, slots=True, kw_only=True)
class Lamps(Criterion):
    """Low beam where it is dark, rear fog lamps in fog only, no high beam that dazzles.

    Attributes:
        low_beam_max_range: Meteorological range below which low beam is also due by day.
        fog_lamp_max_range: Meteorological range below which rear fog lamps are lawful, and never
            due. None: they are due below `low_beam_max_range`, and unlawful from that range on.
        high_beam_min_gap: Gap to the leader below which high beam dazzles it.
        high_beam_min_oncoming_gap: Gap to an oncoming vehicle below which high beam dazzles it.
    """

    low_beam_max_range: Quantity
    fog_lamp_max_range: Quantity | None = None
    high_beam_min_gap: Quantity
    high_beam_min_oncoming_gap: Quantity
    unit: str = "s"
    applies_without_attempt: bool = True

    @property
    def required_inputs(self) -> frozenset[str]:
        """The lamps and the weather."""
        return frozenset(["lamps", "weather"])

    def predicate(self) -> str:
        """The due lamps, the unlawful lamps, and the margin."""
        if self.fog_lamp_max_range is None:
            fog_lamps = "rear fog lamps exactly there"
        else:
            fog_lamps = f"no rear fog lamps from {self.fog_lamp_max_range} on"
        return (
            "At every frame: low or high beam at night and where the meteorological range is below "
            f"{self.low_beam_max_range}; {fog_lamps}; no high beam under {self.high_beam_min_gap} "
            f"behind the leader or under {self.high_beam_min_oncoming_gap} from an oncoming "
            "vehicle. The margin is the time in breach."
        )

    def check(self, case: Case) -> Finding:
        """The time with wrong lamps is the breach."""
        span, lights = judged_span(case), case.trajectories.states.lights[:, EGO_SLOT]
        due_lamps = self._due_lamps(case)
        simulation = np.flatnonzero(span.is_nonempty & due_lamps.may_be_wrong(lights, span))
        is_wrong = due_lamps.are_wrong(lights, simulation)
        row, frame = np.nonzero((lights[simulation] & _HIGH_BEAM) != 0)
        if row.size:
            is_wrong[row, frame] |= self._dazzles(case, simulation[row], frame)
        first, last, num_run_frames = breach_frames_in(span, simulation, is_wrong)
        num_wrong_frames = np.zeros(len(lights), np.int32)
        is_breach = is_wrong & span.mask(simulation, lights.shape[1])
        num_wrong_frames[simulation] = is_breach.sum(axis=1, dtype=np.int32)
        return finding_from_margins(
            span.is_nonempty,
            -seconds_of(case, num_wrong_frames),
            first,
            last,
            longest=num_run_frames,
        )

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """No time with wrong lamps."""
        return change_by_margin(breach, RemedyQuantity.WRONG_LAMPS, limit=0.0)

    def _due_lamps(self, case: Case) -> "_DueLamps":
        """The lamps that are due or unlawful at night or in this weather."""
        visible_range = meteorological_range(case)
        is_impaired = visible_range < self.low_beam_max_range.f32
        if self.fog_lamp_max_range is None:
            needs_fog_lamp, forbids_fog_lamp = is_impaired, ~is_impaired
        else:
            needs_fog_lamp = np.zeros(len(is_impaired), np.bool_)
            forbids_fog_lamp = visible_range >= self.fog_lamp_max_range.f32
        return _DueLamps(
            needs_beam=case.trajectories.scenario.weather.night | is_impaired,
            needs_fog_lamp=needs_fog_lamp,
            forbids_fog_lamp=forbids_fog_lamp,
        )

    def _dazzles(self, case: Case, simulation: IndexArray, frame: IndexArray) -> Mask:
        """Whether high beam would dazzle the leader or an oncoming driver, shape (instant,)."""
        leader = encounters_at(case, NeighbourRole.LEADER, simulation, frame)
        dazzles_leader = leader.valid & (leader.gap < self.high_beam_min_gap.f32)
        # `is_approaching` is true for oncoming vehicles that the ego has not yet met.
        others = other_vehicles_at(case.trajectories, frame.astype(np.int32), simulation)
        is_near = others.gap < self.high_beam_min_oncoming_gap.f32
        return dazzles_leader | (others.is_approaching & is_near).any(axis=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class _DueLamps:
    """Lamps that are due or unlawful in any traffic; arrays have shape (simulation,).

    Attributes:
        needs_beam: Whether low or high beam is due.
        needs_fog_lamp: Whether rear fog lamps are due.
        forbids_fog_lamp: Whether rear fog lamps are unlawful.
    """

    needs_beam: Mask
    needs_fog_lamp: Mask
    forbids_fog_lamp: Mask

    def may_be_wrong(self, lights: U8, span: FrameSpan) -> Mask:
        """Whether some frame of the span may have wrong lamps, shape (simulation,).

        The compiled engine quickly finds the lamps that are on in any frame and in all frames. Both
        together rule out most simulations before the lamps are read frame by frame.
        """
        ever_on, always_on = flags_any_and_all(lights, span)
        lacks_beam = self.needs_beam & ((always_on & _LOW_OR_HIGH_BEAM) == 0)
        lacks_fog_lamp = self.needs_fog_lamp & ((always_on & _REAR_FOG_LAMP) == 0)
        has_fog_lamp = self.forbids_fog_lamp & ((ever_on & _REAR_FOG_LAMP) != 0)
        has_high_beam = (ever_on & _HIGH_BEAM) != 0
        return lacks_beam | lacks_fog_lamp | has_fog_lamp | has_high_beam

    def are_wrong(self, lights: U8, simulation: IndexArray) -> Mask:
        """Whether beam or fog lamps are wrong in each frame, shape (row, time).

        Args:
            lights: Lamps of the ego, shape (simulation, time).
            simulation: Simulations to look at, shape (row,).
        """
        needs_beam, needs_fog_lamp, forbids_fog_lamp = (
            mask[simulation, None]
            for mask in (self.needs_beam, self.needs_fog_lamp, self.forbids_fog_lamp)
        )
        has_beam = (lights[simulation] & _LOW_OR_HIGH_BEAM) != 0
        has_fog_lamp = (lights[simulation] & _REAR_FOG_LAMP) != 0
        return (
            (needs_beam & ~has_beam)
            | (needs_fog_lamp & ~has_fog_lamp)
            | (forbids_fog_lamp & has_fog_lamp)
        )
