"""Remedies of rules about the ego's speed: L12, L13, L14."""

from collections.abc import Callable

import numpy as np

from overtaking.core.elementary import F32, as_f32
from overtaking.labels.explain.breach import Scene
from overtaking.labels.explain.change import Change, Quantity, Remedy
from overtaking.labels.law.limits import speed_limits
from overtaking.model.signals import Signals
from overtaking.world.constants import known
from overtaking.world.friction import stoppable_speed


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
    return _stop(scene, lambda seen: seen.sight_lit)


def stop_for_the_unlit(scene: Scene) -> tuple[Remedy, ...]:
    """L14s: at the speed from which one stops where unlit obstacles are seen."""
    return _stop(scene, lambda seen: seen.sight_unlit)


def _stop(scene: Scene, sight: Callable[[Signals], F32]) -> tuple[Remedy, ...]:
    """The friction is that at the actual speed; a slower vehicle has no less."""
    seen, frames = scene.case.signals, scene.frames
    grip = np.maximum(seen.friction[0, frames], known("friction.table.floor"))
    decel = known("friction.table.usable_share") * known("model.nature.gravity") * grip
    reaction = as_f32(known("law.sight.reaction_time"))
    allowed = stoppable_speed(sight(seen)[0, frames], reaction, decel)
    worst = int((seen.speed[0, frames] - allowed).argmax())
    return _at(scene, int(frames[worst]), allowed[worst])


def _at(scene: Scene, frame: int, needed: np.floating) -> tuple[Remedy, ...]:
    actual = float(scene.case.signals.speed[0, frame])
    change = Change(
        quantity=Quantity.SPEED, unit="m/s", actual=actual, needed=float(needed), frame=frame
    )
    return ((change,),)
