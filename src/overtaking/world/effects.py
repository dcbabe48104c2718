"""Ablations: which effects of the world are switched on."""

from dataclasses import dataclass

from overtaking.world.constants import Constants

_UNLIMITED = 1e6
"""A range farther than any road is long [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effects:
    """Which effects of the world are switched on; all of them, except in ablations.

    Attributes:
        film: Water on the road.
        gusts: Turbulence, and the gusts of bridges and cuttings.
        wake: The lee of high-sided vehicles.
        range: Limits of sight by fog, rain, darkness and distance.
        delay: Reaction times and times of detection.
        distance_error: Misjudged distances.
        looming: The threshold below which an approach goes unnoticed.
        occlusion: Vehicles that hide others.
        mobil: Lane changes of the other vehicles.
    """

    film: bool = True
    gusts: bool = True
    wake: bool = True
    range: bool = True
    delay: bool = True
    distance_error: bool = True
    looming: bool = True
    occlusion: bool = True
    mobil: bool = True


def ablated(c: Constants, effects: Effects) -> Constants:
    """The constants without the effects that are switched off."""
    changes: dict[str, float] = {}
    if not effects.gusts:
        changes["turbulence_intensity"] = 0.0
    if not effects.wake:
        changes["shelter_factor"] = 1.0
    if not effects.looming:
        changes["looming_threshold"] = 0.0
    if not effects.delay:
        changes["detection_growth"] = 0.0
    if not effects.range:
        changes |= {"sight_range": _UNLIMITED, "mirror_range": _UNLIMITED}
    return c.replace(**changes) if changes else c
