"""L3: keep a safe distance to the vehicle ahead."""

import numpy as np
from numpy.typing import NDArray

from overtaking.model.labels import Case
from overtaking.model.signals import Around
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.physics.constants import known
from overtaking.rules.beliefs import LEADER, belief, pull_out
from overtaking.rules.distances import margin_of_gap, sure_decel
from overtaking.rules.frames import ENDLESS, Span, always, conduct, frames_of
from overtaking.rules.rule import Check, Grade, Rule

Index = NDArray[np.intp]


def check(case: Case) -> Check:
    """The gap to the leader is lawful, but for 3 s after it cut in or all began."""
    seen, place, span = case.signals, Around.LEADER, conduct(case)
    # What came before a recording is not known: its beginning is like a cut-in.
    settled = case.events.first + _time_to_regain(case) + 1
    span = Span(start=np.maximum(span.start, settled), stop=span.stop)
    margin = margin_of_gap(
        seen.gap[:, place], seen.speed, seen.closing_speed[:, place], sure_decel(seen.friction)
    )
    np.copyto(margin, ENDLESS, where=seen.vehicle[:, place] == NO_VEHICLE)
    margin[recapturing(case)] = ENDLESS
    believed = belief(case, pull_out(case), {LEADER: margin_of_gap})
    return always(margin, span, belief=believed)


def recapturing(case: Case) -> tuple[Index, Index]:
    """Simulations and frames in which the present leader has cut in less than 3 s ago."""
    vehicle = case.signals.vehicle[:, Around.LEADER]
    row, frame = _cut_ins(case, vehicle)
    since = np.arange(_time_to_regain(case) + 1)
    frames = np.minimum(frame[:, None] + since, vehicle.shape[1] - 1)
    rows = np.broadcast_to(row[:, None], frames.shape)
    same = vehicle[rows, frames] == vehicle[row, frame][:, None]
    return rows[same], frames[same]


def _time_to_regain(case: Case) -> int:
    """Number of frames in which a distance that another has taken may be regained."""
    return frames_of(case, known("law.safe_distance.recapture"))


def _cut_ins(case: Case, vehicle: NDArray[np.uint8]) -> tuple[Index, Index]:
    """Where a vehicle from another lane has become the leader of an ego that kept its own."""
    lane = case.signals.lane
    new = (vehicle[:, 1:] != vehicle[:, :-1]) & (vehicle[:, 1:] != NO_VEHICLE)
    row, before = np.nonzero(new & (lane[:, 1:] == lane[:, :-1]))
    place = (row, vehicle[row, before + 1], before)
    came = case.trajectories.states.lane[place] != lane[row, before]
    if case.trajectories.present is not None:
        came &= case.trajectories.present[place]
    return row[came], before[came] + 1


RULE = Rule(
    id="pt.ce.18-1@2013",
    code="L3",
    law="Article 18(1)",
    title="Safe distance",
    gloss="Keep a distance to the vehicle ahead that avoids a collision if it stops or slows "
    "suddenly.",
    predicate="At every frame: gap to the leader in the ego's lane >= v t + v^2 / (2 b) - "
    "v_lead^2 / (2 b), t = 1 s, b = min(8 m/s^2, 0.9 mu g); not in the 3 s after the leader cut "
    "in or the recording began.",
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
    without_attempt=True,
    check=check,
)
