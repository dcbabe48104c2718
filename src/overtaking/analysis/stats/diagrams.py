"""One overtake in space and time: the numbers of its two diagrams."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F64
from overtaking.model.overtake_events import NEVER, OvertakeEvents
from overtaking.model.road import RoadMark
from overtaking.model.trajectories import NO_VEHICLE, POSITION_RESOLUTION, Trajectories
from overtaking.model.vehicles import EGO_SLOT

_MS_PER_S = 1000.0

MARKS = (
    ("attempt", "a"),
    ("line_crossed", "x₁"),
    ("overlap_begin", "o₁"),
    ("overlap_end", "o₂"),
    ("return_begin", "b"),
    ("return_end", "x₂"),
    ("abort", "abort"),
    ("abort_end", "back"),
    ("collision", "collision"),
    ("road_departure", "off the road"),
    ("spin", "spins"),
)
"""Events with their symbols in the figures, in the paper's manner."""


PHASES = {
    "attempt": "pulls out",
    "line_crossed": "in the other lane",
    "return_begin": "returns",
    "return_end": "done",
    "abort": "gives up",
    "abort_end": "follows again",
    "collision": "collided",
    "road_departure": "off the road",
    "spin": "spins",
}
"""Events that begin a phase, with the name of the phase."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """A span of the simulation.

    Attributes:
        name: The action of the ego.
        begin: Start [s].
        end: End [s].
    """

    name: str
    begin: float
    end: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """One vehicle.

    Attributes:
        slot: Its number.
        is_ego: Whether it is the ego.
        is_target: Whether it is the one to overtake.
        length: Its length [m].
        width: Its width [m].
        ahead: Position of its centre along the road, less that of the mark that moves with the
            target's mean speed (or the ego's), shape (frame,) [m].
        lateral: Position across the road, from the slow edge to the fast edge, shape (frame,) [m].
    """

    slot: int
    is_ego: bool
    is_target: bool
    length: float
    width: float
    ahead: F64
    lateral: F64


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagram:
    """One simulation in space and time.

    Attributes:
        time: Time of each frame, shape (frame,) [s].
        reference_speed: Speed of the moving mark that `ahead` is measured from [m/s].
        tracks: The vehicles near the ego, the ego first, then the target.
        lines: Position across the road of each line, with whether it is solid, slow edge first [m].
        phases: The actions of the ego, in order, without gaps.
        marks: Instants of the events that happened, with their symbols [s].
        has_contact: Whether the ego collided.
    """

    time: F64
    reference_speed: float
    tracks: tuple[Track, ...]
    lines: tuple[tuple[float, bool], ...]
    phases: tuple[Phase, ...]
    marks: tuple[tuple[str, float], ...]
    has_contact: bool


def diagram(trajectories: Trajectories, events: OvertakeEvents) -> Diagram:
    """The numbers of the diagrams of one simulation.

    Args:
        trajectories: A batch of one simulation.
        events: What happened in it.
    """
    frames = int(trajectories.num_frames[0])
    time = trajectories.time_ms[:frames] / _MS_PER_S
    target = int(events.target_slot[0])
    followed = EGO_SLOT if target == NO_VEHICLE else target
    s = trajectories.states.s[0, :, :frames].astype(np.float64) * POSITION_RESOLUTION
    share = np.linspace(0.0, 1.0, frames, dtype=np.float64)
    mark = s[followed, 0] + (s[followed, -1] - s[followed, 0]) * share
    duration = float(time[-1]) if frames > 1 else 0.0
    return Diagram(
        time=time,
        reference_speed=float(s[followed, -1] - s[followed, 0]) / duration if duration else 0.0,
        tracks=tuple(
            _track(trajectories, slot, s[slot] - mark, target)
            for slot in _shown(trajectories, s, target)
        ),
        lines=_lines(trajectories),
        phases=_phases(events, time),
        marks=_marks(events, time),
        has_contact=bool(events.collision[0] != NEVER),
    )


MAX_TRACKS = 8
_NEAR = 250.0  # Metres from the ego: farther vehicles have no part in the overtake.


def _shown(trajectories: Trajectories, s: F64, target: int) -> list[int]:
    """Slots of the ego, of the target, and of those that come near the ego, the nearest first."""
    present = np.flatnonzero(trajectories.scenario.vehicles.valid[0])
    there = trajectories.state_mask[0, :, : s.shape[1]]
    nearest = np.where(there, np.abs(s - s[EGO_SLOT]), np.inf).min(axis=1)
    others = [
        int(slot)
        for slot in present[np.argsort(nearest[present], kind="stable")]
        if slot not in (EGO_SLOT, target) and nearest[slot] < _NEAR
    ]
    first = [EGO_SLOT] if target == NO_VEHICLE else [EGO_SLOT, target]
    return [*first, *others][:MAX_TRACKS]


def _track(trajectories: Trajectories, slot: int, ahead: F64, target: int) -> Track:
    """One vehicle."""
    road, vehicles = trajectories.road, trajectories.scenario.vehicles
    d = trajectories.states.d[0, slot, : len(ahead)].astype(np.float64) * POSITION_RESOLUTION
    there = trajectories.state_mask[0, slot, : len(ahead)]
    ahead, d = (np.where(there, one, np.nan) for one in (ahead, d))
    return Track(
        slot=slot,
        is_ego=slot == EGO_SLOT,
        is_target=slot == target,
        length=float(vehicles.length[0, slot]),
        width=float(vehicles.width[0, slot]),
        ahead=ahead,
        lateral=(d - road.lane_boundaries[0]) * int(road.overtaking_sign),
    )


def _lines(trajectories: Trajectories) -> tuple[tuple[float, bool], ...]:
    """Where the lines of the road are, measured from its slow edge."""
    road = trajectories.road
    across = (np.asarray(road.lane_boundaries) - road.lane_boundaries[0]) * int(
        road.overtaking_sign
    )
    marks = [
        one.left_mark if int(road.overtaking_sign) > 0 else one.right_mark
        for one in road.lanes[:-1]
    ]
    solid = (RoadMark.SOLID, RoadMark.SOLID_SOLID, RoadMark.SOLID_BROKEN)
    is_solid = [True, *(one in solid for one in marks), True]
    return tuple((float(place), known) for place, known in zip(across, is_solid, strict=True))


def _phases(events: OvertakeEvents, time: F64) -> tuple[Phase, ...]:
    """The actions of the ego, from its events; without an attempt it follows all the time."""
    starts = [("follows", int(events.first[0]))]
    starts += [
        (name, int(getattr(events, event)[0]))
        for event, name in PHASES.items()
        if getattr(events, event)[0] != NEVER
    ]
    starts.sort(key=lambda one: one[1])
    ends = [frame for _, frame in starts[1:]] + [min(int(events.last[0]), len(time) - 1)]
    return tuple(
        Phase(name=name, begin=float(time[begin]), end=float(time[max(begin, end)]))
        for (name, begin), end in zip(starts, ends, strict=True)
        if end > begin or len(starts) == 1
    )


def _marks(events: OvertakeEvents, time: F64) -> tuple[tuple[str, float], ...]:
    """The instants of the events that happened."""
    found = [(symbol, int(getattr(events, name)[0])) for name, symbol in MARKS]
    return tuple((symbol, float(time[frame])) for symbol, frame in found if frame != NEVER)
