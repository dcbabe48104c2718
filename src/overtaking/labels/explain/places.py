"""Remedies of rules about places across the road: L1, L2, L10, L11, L16, L17, L20, L21."""

import numpy as np
from numpy.typing import NDArray

from overtaking.labels.explain.breach import Index, Scene
from overtaking.labels.explain.change import Change, Quantity, Remedy
from overtaking.labels.law.alongside import alongside
from overtaking.labels.law.l16_width import left_widths
from overtaking.world.constants import known


def pass_in_next_lane(scene: Scene) -> tuple[Remedy, ...]:
    """L1: in the lane next to that of the target, on its left."""
    frames = _alongside(scene)
    own, other = (_lanes(of.lane, frames) for of in (scene.case.signals, scene.case.target))
    entered = np.maximum(other, _index(scene.case.events.original_lane)[0])
    too_far = own - entered > 1
    lanes = np.where(too_far, own - entered, own - other)
    worst = int(np.where(too_far, lanes - 1, 1 - lanes).argmax())
    change = Change(
        quantity=Quantity.LANES_LEFT,
        unit="lanes",
        actual=float(lanes[worst]),
        needed=1.0,
        frame=int(frames[worst]),
        vehicle=_target(scene),
    )
    return ((change,),)


def off_the_line(scene: Scene) -> tuple[Remedy, ...]:
    """L2: so much farther from the line."""
    change = Change(quantity=Quantity.CLEARANCE, unit="m", actual=scene.margin, needed=0.0)
    return ((change,),)


def apart(scene: Scene) -> tuple[Remedy, ...]:
    """L10: so much farther to the side."""
    return ((_apart(scene, float(known("law.side.motor"))),),)


def apart_from_bicycle(scene: Scene) -> tuple[Remedy, ...]:
    """L11: farther to the side, and no faster than at the start, whichever was broken."""
    frames, seen = _alongside(scene), scene.case.signals
    room = _apart(scene, float(known("law.side.bicycle")))
    speeds = seen.speed[0, frames]
    fastest = int(speeds.argmax())
    slower = Change(
        quantity=Quantity.SPEED,
        unit="m/s",
        actual=float(speeds[fastest]),
        needed=float(seen.speed[0, scene.case.events.attempt[0]]),
        frame=int(frames[fastest]),
    )
    lacking = ((room, room.by > 0), (slower, slower.by < 0))
    return (tuple(change for change, lacks in lacking if lacks),)


def wider(scene: Scene) -> tuple[Remedy, ...]:
    """L16: a lane on the left that is wide enough, or, of course, no overtake here."""
    widths = left_widths(scene.case.trajectories.road)
    width = float(widths[min(int(scene.case.events.original_lane[0]), len(widths) - 1)])
    change = Change(
        quantity=Quantity.WIDTH,
        unit="m",
        actual=width,
        needed=width - scene.margin,
        frame=scene.first,
    )
    return ((change,),)


def target_off_the_line(scene: Scene) -> tuple[Remedy, ...]:
    """L17: the target on its own side of the road."""
    change = Change(
        quantity=Quantity.CLEARANCE,
        unit="m",
        actual=scene.margin,
        needed=0.0,
        frame=scene.first,
        vehicle=_target(scene),
    )
    return ((change,),)


def slow_lanes(scene: Scene) -> tuple[Remedy, ...]:
    """L20: in the faster of the two slowest lanes."""
    lanes = _lanes(scene.case.signals.lane, scene.frames)
    worst = int(lanes.argmax())
    return _lane(int(lanes[worst]), int(known("law.trucks.lanes")) - 1, int(scene.frames[worst]))


def next_slower_lane(scene: Scene) -> tuple[Remedy, ...]:
    """L21: one lane to the right, where there was room."""
    lane = int(scene.case.signals.lane[0, scene.first])
    return _lane(lane, lane - 1, scene.first)


def _lane(actual: int, needed: int, frame: int) -> tuple[Remedy, ...]:
    change = Change(
        quantity=Quantity.LANE,
        unit="lanes",
        actual=float(actual),
        needed=float(needed),
        frame=frame,
    )
    return ((change,),)


def _apart(scene: Scene, needed: float) -> Change:
    frames = _alongside(scene)
    gaps = scene.case.target.lateral_gap[0, frames]
    nearest = int(gaps.argmin())
    return Change(
        quantity=Quantity.LATERAL_GAP,
        unit="m",
        actual=float(gaps[nearest]),
        needed=needed,
        frame=int(frames[nearest]),
        vehicle=_target(scene),
    )


def _alongside(scene: Scene) -> Index:
    """Frames of the breach in which ego and target overlap along the road."""
    return scene.within(alongside(scene.case).frames)


def _target(scene: Scene) -> int:
    return int(scene.case.target.vehicle[0])


def _lanes(lane: NDArray[np.uint8], frames: Index) -> NDArray[np.intp]:
    return _index(lane)[0, frames]


def _index(lane: NDArray[np.uint8]) -> NDArray[np.intp]:
    """Lane indices with -1 for what is beyond the slow edge."""
    return lane.view(np.int8).astype(np.intp)
