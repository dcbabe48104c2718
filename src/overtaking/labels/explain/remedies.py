"""What would have kept each rule but those about gaps, which are in `gaps`."""

from collections.abc import Callable

import numpy as np

from overtaking.core.elementary import F32, as_f32
from overtaking.labels.explain import gaps
from overtaking.labels.explain.breach import Change, Quantity, Remedy, Scene
from overtaking.labels.instants import Index
from overtaking.labels.law.alongside import alongside, lane_index
from overtaking.labels.law.frames import is_two_way
from overtaking.labels.law.lanes import left_widths
from overtaking.labels.law.sight import passing_sight
from overtaking.labels.law.speeds import speed_limits
from overtaking.world.constants import known
from overtaking.world.friction import stoppable_speed

_SAME = 1e-3
"""Margins that differ by less are one [m]."""


def pass_in_next_lane(scene: Scene) -> tuple[Remedy, ...]:
    """L1: in the lane next to that of the target, on its left."""
    frames = _alongside(scene)
    own, other = (
        lane_index(of.lane)[0, frames].astype(int) for of in (scene.case.signals, scene.case.target)
    )
    entered = np.maximum(other, lane_index(scene.case.events.original_lane)[0])
    too_far = own - entered > 1
    lanes = np.where(too_far, own - entered, own - other)
    worst = int(np.where(too_far, lanes - 1, 1 - lanes).argmax())
    change = Change(
        quantity=Quantity.LANES_LEFT,
        actual=float(lanes[worst]),
        needed=1.0,
        frame=int(frames[worst]),
        vehicle=scene.target,
    )
    return ((change,),)


def off_the_line(scene: Scene) -> tuple[Remedy, ...]:
    """L2: so much farther from the line."""
    change = Change(quantity=Quantity.CLEARANCE, actual=scene.margin, needed=0.0)
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
        actual=width,
        needed=width - scene.margin,
        frame=scene.first,
    )
    return ((change,),)


def target_off_the_line(scene: Scene) -> tuple[Remedy, ...]:
    """L17: the target on its own side of the road."""
    change = Change(
        quantity=Quantity.CLEARANCE,
        actual=scene.margin,
        needed=0.0,
        frame=scene.first,
        vehicle=scene.target,
    )
    return ((change,),)


def slow_lanes(scene: Scene) -> tuple[Remedy, ...]:
    """L20: in the faster of the two slowest lanes."""
    lanes = lane_index(scene.case.signals.lane)[0, scene.frames]
    worst = int(lanes.argmax())
    return _lane(int(lanes[worst]), int(known("law.trucks.lanes")) - 1, int(scene.frames[worst]))


def next_slower_lane(scene: Scene) -> tuple[Remedy, ...]:
    """L21: one lane to the right, where there was room."""
    lane = int(scene.case.signals.lane[0, scene.first])
    return _lane(lane, lane - 1, scene.first)


def _lane(actual: int, needed: int, frame: int) -> tuple[Remedy, ...]:
    change = Change(
        quantity=Quantity.LANE,
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
        actual=float(gaps[nearest]),
        needed=needed,
        frame=int(frames[nearest]),
        vehicle=scene.target,
    )


def _alongside(scene: Scene) -> Index:
    """Frames of the breach in which ego and target overlap along the road."""
    return scene.within(alongside(scene.case).frames)


def not_too_fast(scene: Scene) -> tuple[Remedy, ...]:
    """L12: at the limit."""
    frame = int(scene.frames[scene.case.signals.speed[0, scene.frames].argmax()])
    return _at(scene, frame, speed_limits(scene.case)[1][0])


def not_too_slow(scene: Scene) -> tuple[Remedy, ...]:
    """L13: at the lowest speed of motorways."""
    lowest = known("law.minimum.speed")
    margins = scene.case.signals.speed[0, scene.frames] - lowest
    return _at(scene, int(scene.frames[scene.worst(margins)]), lowest)


def stop_for_the_lit(scene: Scene) -> tuple[Remedy, ...]:
    """L14: at the speed from which one stops where lit vehicles are seen."""
    return _stop(scene, scene.case.signals.sight_lit)


def stop_for_the_unlit(scene: Scene) -> tuple[Remedy, ...]:
    """L14s: at the speed from which one stops where unlit obstacles are seen."""
    return _stop(scene, scene.case.signals.sight_unlit)


def _stop(scene: Scene, sight: F32) -> tuple[Remedy, ...]:
    """The friction is that at the actual speed; a slower vehicle has no less."""
    seen, frames = scene.case.signals, scene.frames
    grip = np.maximum(seen.friction[0, frames], known("friction.table.floor"))
    decel = known("friction.table.usable_share") * known("model.nature.gravity") * grip
    reaction = as_f32(known("law.sight.reaction_time"))
    allowed = stoppable_speed(sight[0, frames], reaction, decel)
    worst = int((seen.speed[0, frames] - allowed).argmax())
    return _at(scene, int(frames[worst]), allowed[worst])


def _at(scene: Scene, frame: int, needed: np.floating) -> tuple[Remedy, ...]:
    actual = float(scene.case.signals.speed[0, frame])
    change = Change(quantity=Quantity.SPEED, actual=actual, needed=float(needed), frame=frame)
    return ((change,),)


def let_them_pass(scene: Scene) -> tuple[Remedy, ...]:
    """L6: the next one on the left farther away in time; 0 for one that has begun."""
    return _below(scene, Quantity.ARRIVAL, float(known("law.others.arrival")))


def target_keeps_lane(scene: Scene) -> tuple[Remedy, ...]:
    """L7: a target that does not move to the left."""
    limit = float(known("law.others.lateral_speed"))
    return _of_target(scene, Quantity.TARGET_DRIFT, limit, scene.first)


def return_sooner(scene: Scene) -> tuple[Remedy, ...]:
    """L9: out for no longer than is allowed once the return is due."""
    change = Change(
        quantity=Quantity.TIME_OUT,
        actual=float(known("law.return.within")) - scene.margin,
        needed=float(known("law.return.within")),
    )
    return ((change,),)


def see_farther(scene: Scene) -> tuple[Remedy, ...]:
    """L15 and L15s: more sight; nothing that a driver can do but wait for it."""
    needed, first = float(known("law.sight.least")), scene.case.events.attempt[0]
    if is_two_way(scene.case.trajectories.road):
        passing = float(passing_sight(scene.case)[0])
        clear = float(scene.case.signals.sight_lit[0, first]) - passing
        needed = passing if abs(clear - scene.margin) < _SAME else needed
    return _below(scene, Quantity.SIGHT, needed)


def indicate(scene: Scene) -> tuple[Remedy, ...]:
    """L18: the indicator on for the time that it was off."""
    return _total(scene, Quantity.UNSIGNALLED)


def right_lamps(scene: Scene) -> tuple[Remedy, ...]:
    """L19: the right lamps for the time in which they were wrong."""
    return _total(scene, Quantity.WRONG_LAMPS)


def target_keeps_speed(scene: Scene) -> tuple[Remedy, ...]:
    """L22: a target that accelerates less."""
    limit = float(known("law.overtaken.accel"))
    frames = scene.frames
    margins = np.float32(limit) - scene.case.target.accel[0, frames]
    worst = int(frames[scene.worst(margins)])
    return _of_target(scene, Quantity.TARGET_ACCEL, limit, worst)


def _below(scene: Scene, quantity: Quantity, least: float) -> tuple[Remedy, ...]:
    """What was less than the least that is lawful, at the start of the breach."""
    change = Change(
        quantity=quantity,
        actual=least + scene.margin,
        needed=least,
        frame=scene.first,
    )
    return ((change,),)


def _of_target(scene: Scene, quantity: Quantity, most: float, frame: int) -> tuple[Remedy, ...]:
    """What of the target was more than the most that is lawful."""
    change = Change(
        quantity=quantity,
        actual=most - scene.margin,
        needed=most,
        frame=frame,
        vehicle=scene.target,
    )
    return ((change,),)


def _total(scene: Scene, quantity: Quantity) -> tuple[Remedy, ...]:
    """A time in breach, of which there should be none."""
    return ((Change(quantity=quantity, actual=-scene.margin, needed=0.0),),)


REMEDIES: dict[str, Callable[[Scene], tuple[Remedy, ...]]] = {
    "L1": pass_in_next_lane,
    "L2": off_the_line,
    "L3": gaps.safe_distance,
    "L4": gaps.room_ahead,
    "L5": gaps.room_behind,
    "L6": let_them_pass,
    "L7": target_keeps_lane,
    "L8": gaps.safe_return,
    "L9": return_sooner,
    "L10": apart,
    "L11": apart_from_bicycle,
    "L12": not_too_fast,
    "L13": not_too_slow,
    "L14": stop_for_the_lit,
    "L14s": stop_for_the_unlit,
    "L15": see_farther,
    "L15s": see_farther,
    "L16": wider,
    "L17": target_off_the_line,
    "L18": indicate,
    "L19": right_lamps,
    "L20": slow_lanes,
    "L21": next_slower_lane,
    "L22": target_keeps_speed,
    "L23": gaps.no_obstruction,
    "L24": gaps.oncoming,
}
"""By the code of the rule; a rule of another pack that is not here has its margin and no remedy."""


def remedies_of(code: str, scene: Scene) -> tuple[Remedy, ...]:
    """What would have kept a broken rule, everything else being as it was.

    Args:
        code: Of the rule.
        scene: Its breach.

    Returns:
        Alternatives, the one that its margin measures first.
    """
    find = REMEDIES.get(code)
    return () if find is None else find(scene)
