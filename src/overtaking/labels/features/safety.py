"""Surrogate measures of safety: how near it came, at its worst and at each phase."""

from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, as_f32
from overtaking.labels.features import engine
from overtaking.labels.features.encounters import Index, Side
from overtaking.labels.features.encroachment import entry_encroachment, return_encroachment
from overtaking.labels.features.engine import encounter
from overtaking.labels.features.margins import front_margins, stop_margins
from overtaking.labels.law.frames import Span, conduct
from overtaking.labels.law.stops import stop_for_lit, stop_for_unlit
from overtaking.model.batch import Batch
from overtaking.model.events import NEVER
from overtaking.model.labels import Case
from overtaking.model.safety import MOMENTS, Encounter, Safety
from overtaking.model.signals import Around

B = TypeVar("B", Encounter, "_Margins")

_ENTERED = {
    "attempt": (Around.LEFT_LEADER, Around.LEFT_FOLLOWER),
    "line_crossed": (Around.LEFT_LEADER, Around.LEFT_FOLLOWER),
    "return_begin": (Around.RIGHT_LEADER, Around.RIGHT_FOLLOWER),
}
"""Who is ahead and behind in the lane that the ego moves into."""


def safety_measures(case: Case) -> Safety:
    """The measures of a batch: over the manoeuvre, and at the events of the overtake.

    The manoeuvre is the window of the law: from 3 s before the attempt to 3 s after its end, or all
    that was driven where nothing was attempted.
    """
    span = conduct(case)
    worst = _manoeuvre(case, span)
    at_events = _at_events(case)
    start, count = np.where(span.exists, span.start, NEVER), case.signals.num_simulations
    margins = _joined(worst.margins, at_events.margins, at_events.cells, count)
    return Safety(
        frame=np.column_stack([start, _frames(case)]).astype(np.int32),
        close_share=worst.close_share,
        time_exposed=worst.time_exposed,
        time_integrated=worst.time_integrated,
        entry_encroachment=entry_encroachment(case),
        return_encroachment=return_encroachment(case),
        front=_joined(worst.front, at_events.front, at_events.cells, count),
        rear=_joined(worst.rear, at_events.rear, at_events.cells, count),
        entered_front=_joined(None, at_events.entered_front, at_events.entered_cells, count),
        entered_rear=_joined(None, at_events.entered_rear, at_events.entered_cells, count),
        **{field.name: getattr(margins, field.name) for field in fields(_Margins)},
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Margins(Batch):
    """The measures beside encounters, as in `Safety`; arrays of one shape."""

    headway: F32
    picud: F32
    rss_margin: F32
    lawful_margin: F32
    stop_margin_lit: F32
    stop_margin_unlit: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class _Events(Batch):
    """What is measured at the events that came, arrays of shape (instant,).

    Attributes:
        front: The vehicle ahead.
        rear: The vehicle behind.
        margins: Beside these.
        entered_front: The vehicle ahead in a lane that is entered, at fewer instants.
        entered_rear: The one behind in it, at the same.
        cells: Which cells of a table (simulation, moment) these are, moments adjacent.
        entered_cells: The same of those at which a lane is entered.
    """

    front: Encounter
    rear: Encounter
    margins: _Margins
    entered_front: Encounter
    entered_rear: Encounter
    cells: Index
    entered_cells: Index


@dataclass(frozen=True, slots=True, kw_only=True)
class _Worst(Batch):
    """What is measured over the manoeuvre, arrays of shape (simulation,)."""

    front: Encounter
    rear: Encounter
    margins: _Margins
    close_share: F32
    time_exposed: F32
    time_integrated: F32


def _frames(case: Case) -> NDArray[np.int32]:
    """Frames of the events, `NEVER` where they did not come, shape (simulation, event)."""
    return np.column_stack([getattr(case.events, name) for name in MOMENTS[1:]])


def _at_events(case: Case) -> _Events:
    frame = _frames(case)
    rows, event = np.nonzero(frame != NEVER)  # Most events do not come.
    frames = frame[rows, event].astype(np.intp)
    ahead, behind = _entered_places()
    enters = np.isin(MOMENTS[1:], list(_ENTERED))[event]
    entered = rows[enters], frames[enters]
    front = encounter(case, Around.LEADER, Side.AHEAD, rows, frames)
    cells = rows * len(MOMENTS) + event + 1  # The manoeuvre is the first moment.
    return _Events(
        front=front,
        rear=encounter(case, Around.FOLLOWER, Side.BEHIND, rows, frames),
        margins=_Margins(**front_margins(case, front, rows, frames), **_stops(case, rows, frames)),
        entered_front=encounter(case, ahead[event[enters]], Side.AHEAD, *entered),
        entered_rear=encounter(case, behind[event[enters]], Side.BEHIND, *entered),
        cells=cells,
        entered_cells=cells[enters],
    )


def _entered_places() -> tuple[Index, Index]:
    """Places ahead and behind in the lane that is entered, by event; any where there is none."""
    nobody = (Around.LEADER, Around.FOLLOWER)
    pairs = np.array([_ENTERED.get(name, nobody) for name in MOMENTS[1:]], np.intp)
    return pairs[:, 0], pairs[:, 1]


def _manoeuvre(case: Case, span: Span) -> _Worst:
    """The worst of each measure over the frames of a span."""
    found = engine.worst(case, span)
    interval = np.float32(case.signals.frame_interval_ms / 1000.0)
    lasted, never = np.maximum(span.stop - span.start + 1, 1), np.float32(np.inf)
    return _Worst(
        front=_encounter(found, "front"),
        rear=_encounter(found, "rear"),
        margins=_Margins(
            headway=found["headway"],
            picud=found["picud"],
            rss_margin=found["rss_margin"],
            lawful_margin=found["lawful_margin"],
            stop_margin_lit=np.where(span.exists, stop_for_lit(case).low, never),
            stop_margin_unlit=np.where(span.exists, stop_for_unlit(case).low, never),
        ),
        close_share=found["num_close"] / as_f32(lasted),
        time_exposed=found["num_critical"] * interval,
        time_integrated=found["shortfall"] * interval,
    )


def _encounter(found: dict[str, F32], side: str) -> Encounter:
    """The worst of an encounter out of all measures."""
    values: dict[str, Any] = {
        field.name: found[f"{side}.{field.name}"] for field in fields(Encounter)
    }
    values["valid"] = values["valid"] > 0
    return Encounter(**values)


def _stops(case: Case, rows: Index, frames: Index) -> dict[str, F32]:
    """Sight minus stopping distance at some instants, as in L14 and L14s."""
    seen = case.signals
    return stop_margins(
        seen.speed[rows, frames],
        seen.friction[rows, frames],
        seen.sight_lit[rows, frames],
        seen.sight_unlit[rows, frames],
    )


def _joined(worst: B | None, at_events: B, cells: Index, count: int) -> B:
    """Both in tables (simulation, moment): the manoeuvre first, then the events; 0 elsewhere."""

    def joined(name: str) -> NDArray[Any]:
        values = getattr(at_events, name)
        whole = np.zeros((count, len(MOMENTS)), values.dtype)
        whole.reshape(-1)[cells] = values
        if worst is not None:
            whole[:, 0] = getattr(worst, name)
        return whole

    return at_events.replace(**{f.name: joined(f.name) for f in fields(at_events)})
