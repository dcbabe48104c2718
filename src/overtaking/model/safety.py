"""How near an overtake came to a collision: surrogate measures of safety."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask
from overtaking.model.batch import Batch

I32 = NDArray[np.int32]

MOMENTS = (
    "manoeuvre",
    "attempt",
    "line_crossed",
    "overlap_begin",
    "return_begin",
    "return_end",
)
"""When measures are taken: the worst of the manoeuvre, and events by the names of `Events`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Encounter(Batch):
    """One vehicle behind another in a lane, one of them the ego; all arrays have one shape.

    What never happens takes an infinite time. Where `valid` is false the values mean nothing.

    Attributes:
        valid: Whether there are two.
        gap: Between their bumpers, negative alongside [m].
        closing_speed: Speed at which the gap shrinks [m/s].
        time_gap: Until the one behind reaches the rear bumper ahead, at its speed [s].
        ttc: Time to collision at constant speeds [s].
        mttc: Time to collision at constant accelerations [s].
        drac: Deceleration of the one behind that just avoids a collision [m/s^2].
    """

    valid: Mask
    gap: F32
    closing_speed: F32
    time_gap: F32
    ttc: F32
    mttc: F32
    drac: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class Safety(Batch):
    """Surrogate measures of safety of a batch, after the fact.

    Arrays have shape (simulation, moment) with `MOMENTS` as the last axis, or (simulation,). In the
    column of the manoeuvre each measure has its worst value: the largest closing speed and
    deceleration, the smallest of all others.

    Attributes:
        frame: Frame of each moment, `NEVER` where it did not come; of the manoeuvre the first one.
        front: The ego behind the vehicle ahead in its lane.
        rear: The vehicle behind in the ego's lane, behind the ego.
        entered_front: The ego behind the vehicle ahead in the lane that it moves into: on the left
            at `attempt` and `line_crossed`, on the right at `return_begin`, else none.
        entered_rear: The vehicle behind in that lane, behind the ego.
        headway: From front bumper to front bumper, to the vehicle ahead in the lane [s].
        picud: Gap to it that is left after sudden braking of both [m].
        rss_margin: Gap to it minus the safe one of responsibility-sensitive safety [m].
        lawful_margin: Gap to it minus the safe distance of L3 [m].
        stop_margin_lit: Distance at which a lit vehicle is seen minus the stopping distance [m].
        stop_margin_unlit: The same for an unlit one [m].
        close_share: Share of the manoeuvre with less than the safe distance of L3, (simulation,).
        time_exposed: Time of the manoeuvre at a critical time to collision, (simulation,) [s].
        time_integrated: Integral of what it lacks to the threshold in that time, (simulation,)
            [s^2].
        entry_encroachment: From the ego's crossing the line to the arrival of the vehicle behind
            where the ego's rear bumper was, infinite if it does not arrive, (simulation,) [s].
        return_encroachment: The same of the overtaken vehicle from `return_end`, (simulation,) [s].
    """

    frame: I32
    front: Encounter
    rear: Encounter
    entered_front: Encounter
    entered_rear: Encounter
    headway: F32
    picud: F32
    rss_margin: F32
    lawful_margin: F32
    stop_margin_lit: F32
    stop_margin_unlit: F32
    close_share: F32
    time_exposed: F32
    time_integrated: F32
    entry_encroachment: F32
    return_encroachment: F32
