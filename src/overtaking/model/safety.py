"""How near an overtake came to a collision: surrogate measures of safety.

A new measure is a field here and a formula in `labels.features`. The columns of the table follow.
"""

from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask
from overtaking.model.batch import Batch
from overtaking.model.values import documented, meant

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


_of_two = partial(meant, present=".valid")
"""Metadata of a measure of two vehicles."""

_to_front = partial(meant, column="front_{}", present="front.valid")
"""Metadata of a measure of the ego and the vehicle ahead."""


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Encounter(Batch):
    """One vehicle behind another in a lane, one of them the ego; all arrays have one shape.

    What never happens has an infinite time. Where `valid` is false the values mean nothing.
    """

    valid: Mask = field(metadata=meant("Whether there are two vehicles", column=None))
    gap: F32 = field(metadata=_of_two("Gap between the bumpers, negative alongside", "m"))
    closing_speed: F32 = field(metadata=_of_two("Speed at which that gap shrinks", "m/s"))
    time_gap: F32 = field(
        metadata=_of_two("Gap over the speed of the one behind; null if it stands", "s")
    )
    ttc: F32 = field(metadata=_of_two("Time to collision at constant speeds; null if never", "s"))
    mttc: F32 = field(
        metadata=_of_two("Time to collision at constant accelerations; null if never", "s")
    )
    drac: F32 = field(
        metadata=_of_two("Deceleration that just avoids a collision; null if none does", "m/s^2")
    )


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Safety(Batch):
    """Surrogate measures of safety of a batch, after the fact.

    Arrays have shape (simulation, moment) with `MOMENTS` as the last axis; those of
    `MANOEUVRE_MEASURES` have shape (simulation,). In the column of the manoeuvre each measure has
    its worst value: the largest closing speed and deceleration, the smallest of all others. The
    lane that the ego enters is the one on the left at `attempt` and `line_crossed`, and the one on
    the right at `return_begin`; at other moments there is none.
    """

    frame: I32 = field(
        metadata=meant(
            "Frame of each moment, `NEVER` where it did not come; of the manoeuvre the first one",
            column=None,
        )
    )
    front: Encounter = field(metadata=meant("the ego behind the vehicle ahead"))
    headway: F32 = field(
        metadata=_to_front("From front bumper to front bumper; null if the ego stands", "s")
    )
    picud: F32 = field(metadata=_to_front("Gap left after sudden braking of both", "m"))
    rss_margin: F32 = field(
        metadata=_to_front("Gap minus the safe one of responsibility-sensitive safety", "m")
    )
    lawful_margin: F32 = field(
        metadata=_to_front("Gap minus the safe distance of L3", "m", needs=["weather"])
    )
    rear: Encounter = field(metadata=meant("the vehicle behind, behind the ego"))
    entered_front: Encounter = field(metadata=meant("the vehicle ahead in the lane entered"))
    entered_rear: Encounter = field(metadata=meant("the vehicle behind in the lane entered"))
    stop_margin_lit: F32 = field(
        metadata=meant("Sight of the lit minus stopping distance", "m", needs=["weather"])
    )
    stop_margin_unlit: F32 = field(
        metadata=meant(
            "Sight of the unlit minus stopping distance", "m", needs=["weather", "lamps"]
        )
    )
    close_share: F32 = field(
        metadata=meant(
            "Share of the manoeuvre closer than the safe distance of L3", needs=["weather"]
        )
    )
    time_exposed: F32 = field(metadata=meant("Time at a critical time to collision, TET", "s"))
    time_integrated: F32 = field(metadata=meant("What it lacks, integrated, TIT", "s^2"))
    entry_encroachment: F32 = field(
        metadata=meant(
            "Until the vehicle behind on the left was where the ego entered; null if never", "s"
        )
    )
    return_encroachment: F32 = field(
        metadata=meant("Until the overtaken vehicle was where the ego returned; null if never", "s")
    )


MANOEUVRE_MEASURES = (
    "close_share",
    "time_exposed",
    "time_integrated",
    "entry_encroachment",
    "return_encroachment",
)
"""The fields of `Safety` that are measured once, over the whole manoeuvre."""
