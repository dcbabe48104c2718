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
"""When measures are taken: the worst of the manoeuvre, and events by the names of `Events`."""

_of_two = partial(FieldSpec, null_unless=".valid")
"""Declaration of a measure of two vehicles."""

_to_front = partial(FieldSpec, column=ColumnName(prefix="front_"), null_unless="front.valid")
"""Declaration of a measure of the ego and the vehicle ahead."""


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class Encounter(Batch):
    """One vehicle behind another in a lane, one of them the ego; all arrays have one shape.

    What never happens has an infinite time. Where `valid` is false the values mean nothing.
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
        F32, _of_two("Deceleration that just avoids a collision; null if none does", "m/s^2")
    ]


_measure = partial(FieldSpec, null_unless=".exists")


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class PassingSafety(Batch):
    """Measures of a batch against the nearest vehicle that comes; arrays have shape (simulation,).

    Where `exists` is false the others mean nothing: on one-way roads, and where the ego never came
    to the other side. NaN where no vehicle came. A time to meet is a distance over both speeds.
    """

    exists: Annotated[Mask, FieldSpec("Whether the ego came to the other side", column=None)]
    distance_out: Annotated[
        F32, _measure("Gap to who comes as the ego comes to the other side", "m")
    ]
    time_out: Annotated[
        F32, _measure("Time to meet who comes as the ego comes to the other side", "s")
    ]
    distance_abreast: Annotated[
        F32, _measure("Gap to who comes as ego and target begin to overlap", "m")
    ]
    time_abreast: Annotated[
        F32, _measure("Time to meet who comes as ego and target begin to overlap", "s")
    ]
    distance_back: Annotated[
        F32, _measure("Gap to who comes as the ego is back on its side, or collides", "m")
    ]
    time_back: Annotated[
        F32, _measure("Time to meet who comes as the ego is back on its side, or collides", "s")
    ]
    least_time: Annotated[F32, _measure("Least time to meet while on the other side", "s")]
    sight_out: Annotated[
        F32,
        _measure(
            "Sight of air and road as the ego comes to the other side", "m", needs=["weather"]
        ),
    ]
    time_needed: Annotated[F32, _measure("Time on the other side", "s")]
    time_available: Annotated[
        F32,
        _measure(
            "Time to meet who comes, or who might come at the limit from beyond sight",
            "s",
            needs=["weather", "speed_limit"],
        ),
    ]
    given_up: Annotated[Mask, _measure("Whether the ego fell back behind its target")]


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyMeasures(Batch):
    """Surrogate measures of safety of a batch, after the fact.

    Arrays have shape (simulation, moment) with `MOMENTS` as the last axis; those of
    `MANOEUVRE_MEASURES` have shape (simulation,). In the column of the manoeuvre each measure has
    its worst value: the largest closing speed and deceleration, the smallest of all others. The
    lane that the ego enters is the one on the left at `attempt` and `line_crossed`, and the one on
    the right at `return_begin`; at other moments there is none.
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
    time_integrated: Annotated[F32, FieldSpec("What it lacks, integrated, TIT", "s^2")]
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
"""The fields of `Safety` that are measured once, over the whole manoeuvre."""
