"""L2: do not tread on or cross a continuous line."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask, as_f32
from overtaking.labels.law.engine import highest, lowest
from overtaking.labels.law.frames import Span, conduct, ends_in, is_two_way
from overtaking.labels.law.rule import Check, Grade, Rule, decided, inapplicable
from overtaking.model.labels import Case, Severity, Verdict
from overtaking.model.road import DrivingSide, Road, RoadMark
from overtaking.world.constants import known

_CLOSED = frozenset(
    [RoadMark.SOLID, RoadMark.SOLID_SOLID, RoadMark.SOLID_BROKEN, RoadMark.CURB, RoadMark.GRASS]
)
"""What must not be trodden on, as seen from the lane: of a mixed line the nearer one rules."""


def check(case: Case) -> Check:
    """No corner of the ego is beyond a line that is continuous for it."""
    road, span = case.trajectories.road, conduct(case)
    if not (closed := closed_borders(road)):
        return inapplicable(case.signals.num_simulations)
    tolerance = known("law.line.tolerance")
    clear = [_lowest_clearance(case, span, k, sides) for k, sides in closed.items()]
    low = np.minimum.reduce(clear) + tolerance
    rows = np.flatnonzero(span.exists & (low < 0))
    broken = [_clearance(case, rows, k, sides) + tolerance < 0 for k, sides in closed.items()]
    first, last = ends_in(span, rows, np.logical_or.reduce(broken))
    found = decided(span.exists, low, first, last)
    return found.replace(severity=_severity(found, clear[-1] + tolerance < 0, road))


def closed_borders(road: Road) -> dict[int, tuple[bool, bool]]:
    """The borders with a line that is continuous from the right, from the left, or from both."""
    kept = {}
    for k in range(road.num_lanes + 1):
        from_right = k > 0 and _fast_mark(road, k - 1) in _CLOSED
        from_left = k < road.num_lanes and _slow_mark(road, k) in _CLOSED
        if from_right or from_left:
            kept[k] = (from_right, from_left)
    return kept


def _borders(road: Road) -> NDArray[np.float32]:
    """Lane borders on the axis that grows to the left, from slow to fast [m]."""
    return as_f32(road.side * road.boundaries)


def _fast_mark(road: Road, lane: int) -> RoadMark:
    one = road.lanes[lane]
    return one.left_mark if road.driving_side is DrivingSide.RIGHT else one.right_mark


def _slow_mark(road: Road, lane: int) -> RoadMark:
    one = road.lanes[lane]
    return one.right_mark if road.driving_side is DrivingSide.RIGHT else one.left_mark


def _lowest_clearance(case: Case, span: Span, k: int, sides: tuple[bool, bool]) -> F32:
    """Smallest distance of the ego's body from border k in a span, shape (simulation,) [m]."""
    seen, road = case.signals, case.trajectories.road
    if k == 0:
        return lowest(seen.right_reach, span) - _borders(road)[0]
    if k == road.num_lanes:
        return _borders(road)[k] - highest(seen.left_reach, span)
    return lowest(_clearance(case, np.arange(seen.num_simulations), k, sides), span)


def _clearance(case: Case, rows: NDArray[np.intp], k: int, sides: tuple[bool, bool]) -> F32:
    """Distance of the ego's body from border k, negative where it treads on it, (row, time) [m].

    Beyond an edge of the road it stays negative. A line that may be crossed from one side is looked
    at only while the ego comes from the other.
    """
    seen, road = case.signals, case.trajectories.road
    on_right = _borders(road)[k] - seen.left_reach[rows]
    on_left = seen.right_reach[rows] - _borders(road)[k]
    if k == 0:
        return on_left
    if k == road.num_lanes:
        return on_right
    clear = np.maximum(on_right, on_left)
    from_right, from_left = sides
    if from_right and from_left:
        return clear
    came_from_right = _came_from_right(on_right >= 0, on_left >= 0)
    return np.where(came_from_right == from_right, clear, np.abs(clear))


def _came_from_right(right: Mask, left: Mask) -> Mask:
    """Whether the ego was last wholly on the right of a border, shape (simulation, time)."""
    frame = np.arange(right.shape[1], dtype=np.int32)
    last_right = np.maximum.accumulate(np.where(right, frame, -1), axis=1)
    last_left = np.maximum.accumulate(np.where(left, frame, -1), axis=1)
    return last_right >= last_left


def _severity(found: Check, beyond_last: Mask, road: Road) -> NDArray[np.uint8]:
    """Very serious where the line separates the directions of travel (146(o)), else light."""
    between = is_two_way(road) and road.num_lanes in closed_borders(road)
    worst = np.where(beyond_last & between, Severity.VERY_SERIOUS, Severity.LIGHT)
    broken = found.verdict == Verdict.ILLEGAL
    return np.where(broken, worst, Severity.NONE).astype(np.uint8)


RULE = Rule(
    id="pt.rst.60-m1-m3@2019",
    code="L2",
    law="Regulation of signs, Article 60 (marks M1 and M3); Highway Code, Article 146(o)",
    title="Continuous line",
    gloss="A continuous line must be neither trodden on nor crossed; of a continuous and a broken"
    " line side by side the one nearer to the driver rules.",
    predicate="At every frame: no corner of the ego is more than 0.05 m over a line that is "
    "continuous for the lane it comes from, nor over a kerb or grass.",
    unit="m",
    grade=Grade.BY_BREACH,
    source="pt-signs-2019",
    needs=frozenset(["marks"]),
    without_attempt=True,
    check=check,
)
