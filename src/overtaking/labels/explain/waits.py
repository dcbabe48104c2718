"""Remedies of rules about times, sight and the others: L6, L7, L9, L15, L18, L19, L22."""

import numpy as np

from overtaking.labels.explain.breach import Scene
from overtaking.labels.explain.change import Change, Quantity, Remedy
from overtaking.labels.law.frames import is_two_way
from overtaking.labels.law.l15_insufficient_sight import passing_sight
from overtaking.world.constants import known

_SAME = 1e-3
"""Margins that differ by less are one [m]."""


def let_them_pass(scene: Scene) -> tuple[Remedy, ...]:
    """L6: the next one on the left farther away in time; 0 for one that has begun."""
    return _below(scene, Quantity.ARRIVAL, "s", float(known("law.others.arrival")))


def target_keeps_lane(scene: Scene) -> tuple[Remedy, ...]:
    """L7: a target that does not move to the left."""
    limit = float(known("law.others.lateral_speed"))
    return _of_target(scene, Quantity.TARGET_DRIFT, "m/s", limit, scene.first)


def return_sooner(scene: Scene) -> tuple[Remedy, ...]:
    """L9: out for no longer than is allowed once the return is due."""
    change = Change(
        quantity=Quantity.TIME_OUT,
        unit="s",
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
    return _below(scene, Quantity.SIGHT, "m", needed)


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
    return _of_target(scene, Quantity.TARGET_ACCEL, "m/s^2", limit, worst)


def _below(scene: Scene, quantity: Quantity, unit: str, least: float) -> tuple[Remedy, ...]:
    """What was less than the least that is lawful, at the start of the breach."""
    change = Change(
        quantity=quantity,
        unit=unit,
        actual=least + scene.margin,
        needed=least,
        frame=scene.first,
    )
    return ((change,),)


def _of_target(
    scene: Scene, quantity: Quantity, unit: str, most: float, frame: int
) -> tuple[Remedy, ...]:
    """What of the target was more than the most that is lawful."""
    change = Change(
        quantity=quantity,
        unit=unit,
        actual=most - scene.margin,
        needed=most,
        frame=frame,
        vehicle=int(scene.case.target.vehicle[0]),
    )
    return ((change,),)


def _total(scene: Scene, quantity: Quantity) -> tuple[Remedy, ...]:
    """A time in breach, of which there should be none."""
    return ((Change(quantity=quantity, unit="s", actual=-scene.margin, needed=0.0),),)
