"""Surrogate measures of safety, also against oncoming vehicles."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

from overtaking.core.arrays import F32, I32, Mask
from overtaking.model.batch import Batch, ColumnName, FieldSpec, with_field_docs

MEASURED_MOMENTS = (
    "manoeuvre",
    "attempt",
    "line_crossed",
    "overlap_begin",
    "return_begin",
    "return_end",
)
"""Moments of the measures: the whole manoeuvre, with its worst values, and fields of
`OvertakeEvents`."""

_of_two = partial(FieldSpec, null_unless=".valid")
"""Declaration of a measure of two vehicles."""

_to_front = partial(FieldSpec, column=ColumnName(prefix="front_"), null_unless="front.valid")
"""Declaration of a measure of the ego and the vehicle ahead."""


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class Encounter(Batch):
    """One vehicle behind another in a lane, one of them the ego; all arrays have one shape.

    The time of an event that never happens is infinite. Where `valid` is false, the values are
    undefined.
    """

    valid: Annotated[Mask, FieldSpec("Whether there are two vehicles", column=None)]
    gap: Annotated[F32, _of_two("Gap between the bumpers, negative alongside", "m")]
    closing_speed: Annotated[F32, _of_two("Speed at which that gap shrinks", "m/s")]
    time_gap: Annotated[
        F32, _of_two("Gap over the speed of the one behind; null if it stands", "s")
    ]
    ttc: Annotated[F32, _of_two("Time to collision at constant speeds; null if never", "s")]
    mttc: Annotated[F32, _of_two("Time to collision at constant accelerations; null if never", "s")]
    drac: Annotated[
        F32, _of_two("Deceleration that just avoids a collision; null if no braking can", "m/s^2")
    ]


_measure = partial(FieldSpec, null_unless=".exists")


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class PassingSafety(Batch):
    """Measures against the nearest oncoming vehicle; arrays have shape (simulation,).

    Where `exists` is false, on one-way roads and where the ego never entered the opposing lane, all
    other fields are undefined. Values are NaN where no vehicle came. A time to meet is a gap over
    the sum of both speeds.
    """

    exists: Annotated[Mask, FieldSpec("Whether the ego entered the opposing lane", column=None)]
    distance_out: Annotated[
        F32, _measure("Gap to the oncoming vehicle as the ego enters the opposing lane", "m")
    ]
    time_out: Annotated[
        F32, _measure("Time to meet the oncoming vehicle as the ego enters the opposing lane", "s")
    ]
    distance_abreast: Annotated[
        F32, _measure("Gap to the oncoming vehicle as ego and target begin to overlap", "m")
    ]
    time_abreast: Annotated[
        F32, _measure("Time to meet the oncoming vehicle as ego and target begin to overlap", "s")
    ]
    distance_back: Annotated[
        F32,
        _measure("Gap to the oncoming vehicle as the ego is back in its lane, or collides", "m"),
    ]
    time_back: Annotated[
        F32,
        _measure(
            "Time to meet the oncoming vehicle as the ego is back in its lane, or collides", "s"
        ),
    ]
    least_time: Annotated[F32, _measure("Least time to meet while in the opposing lane", "s")]
    sight_out: Annotated[
        F32,
        _measure(
            "Sight of air and road as the ego enters the opposing lane", "m", needs=["weather"]
        ),
    ]
    time_needed: Annotated[F32, _measure("Time in the opposing lane", "s")]
    time_available: Annotated[
        F32,
        _measure(
            "Time to meet the oncoming vehicle, or one at the limit from beyond sight",
            "s",
            needs=["weather", "speed_limit"],
        ),
    ]
    given_up: Annotated[Mask, _measure("Whether the ego fell back behind its target")]


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyMeasures(Batch):
    """Surrogate measures of safety of a batch, after the fact.

    Arrays have shape (simulation, moment) with `MEASURED_MOMENTS` as the last axis; the measures in
    `WHOLE_MANOEUVRE_MEASURES` have shape (simulation,). In the column of the manoeuvre each measure
    has its worst value: the largest closing speed and deceleration, the smallest of all others. The
    ego enters the lane on the left at `attempt` and `line_crossed`, the lane on the right at
    `return_begin`, and no lane at other moments.
    """

    frame: Annotated[
        I32,
        FieldSpec(
            "Frame of each moment, `NEVER` where it did not come; of the manoeuvre the first one",
            column=None,
        ),
    ]
    front: Annotated[Encounter, FieldSpec("the ego behind the vehicle ahead")]
    headway: Annotated[
        F32, _to_front("From front bumper to front bumper; null if the ego stands", "s")
    ]
    picud: Annotated[F32, _to_front("Gap left after sudden braking of both", "m")]
    rss_margin: Annotated[
        F32, _to_front("Gap minus the safe one of responsibility-sensitive safety", "m")
    ]
    lawful_margin: Annotated[
        F32, _to_front("Gap minus the safe distance of L3", "m", needs=["weather"])
    ]
    rear: Annotated[Encounter, FieldSpec("the vehicle behind, behind the ego")]
    entered_front: Annotated[Encounter, FieldSpec("the vehicle ahead in the lane entered")]
    entered_rear: Annotated[Encounter, FieldSpec("the vehicle behind in the lane entered")]
    stop_margin_lit: Annotated[
        F32, FieldSpec("Sight of the lit minus stopping distance", "m", needs=["weather"])
    ]
    stop_margin_unlit: Annotated[
        F32,
        FieldSpec("Sight of the unlit minus stopping distance", "m", needs=["weather", "lamps"]),
    ]
    close_share: Annotated[
        F32,
        FieldSpec("Share of the manoeuvre closer than the safe distance of L3", needs=["weather"]),
    ]
    time_exposed: Annotated[F32, FieldSpec("Time at a critical time to collision, TET", "s")]
    time_integrated: Annotated[
        F32, FieldSpec("Shortfall below the critical time to collision, integrated, TIT", "s^2")
    ]
    entry_encroachment: Annotated[
        F32,
        FieldSpec(
            "Until the vehicle behind on the left was where the ego entered; null if never", "s"
        ),
    ]
    return_encroachment: Annotated[
        F32, FieldSpec("Until the overtaken vehicle was where the ego returned; null if never", "s")
    ]
    oncoming: Annotated[PassingSafety, FieldSpec("on two-way roads", since=4)]


WHOLE_MANOEUVRE_MEASURES = (
    "close_share",
    "time_exposed",
    "time_integrated",
    "entry_encroachment",
    "return_encroachment",
    "oncoming",
)
"""The fields of `SafetyMeasures` that are measured once, over the whole manoeuvre."""
