"""Where to look for what would have kept each rule."""

from collections.abc import Callable

from overtaking.labels.explain import gaps, places, speeds, waits
from overtaking.labels.explain.breach import Scene
from overtaking.labels.explain.change import Remedy

REMEDIES: dict[str, Callable[[Scene], tuple[Remedy, ...]]] = {
    "L1": places.pass_in_next_lane,
    "L2": places.off_the_line,
    "L3": gaps.safe_distance,
    "L4": gaps.room_ahead,
    "L5": gaps.room_behind,
    "L6": waits.let_them_pass,
    "L7": waits.target_keeps_lane,
    "L8": gaps.safe_return,
    "L9": waits.return_sooner,
    "L10": places.apart,
    "L11": places.apart_from_bicycle,
    "L12": speeds.not_too_fast,
    "L13": speeds.not_too_slow,
    "L14": speeds.stop_for_the_lit,
    "L14s": speeds.stop_for_the_unlit,
    "L15": waits.see_farther,
    "L15s": waits.see_farther,
    "L16": places.wider,
    "L17": places.target_off_the_line,
    "L18": waits.indicate,
    "L19": waits.right_lamps,
    "L20": places.slow_lanes,
    "L21": places.next_slower_lane,
    "L22": waits.target_keeps_speed,
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
