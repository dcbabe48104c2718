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

_to_leader = partial(FieldSpec, column=ColumnName(prefix="leader_"), null_unless="leader.valid")
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


_measure = partial(FieldSpec, null_unless=".was_in_opposing_lane")


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class PassingSafety(Batch):
    """Measures against the nearest oncoming vehicle; arrays have shape (simulation,).

    Where `was_in_opposing_lane` is false, on one-way roads and where the ego never entered the
    opposing lane, all other fields are undefined. Values are NaN where no vehicle came. A time to
    meet is a gap over the sum of both speeds.
    """

    was_in_opposing_lane: Annotated[
        Mask, FieldSpec("Whether the ego entered the opposing lane", column=None)
    ]
    gap_at_crossing: Annotated[
        F32, _measure("Gap to the oncoming vehicle as the ego enters the opposing lane", "m")
    ]
    time_to_meet_at_crossing: Annotated[
        F32, _measure("Time to meet the oncoming vehicle as the ego enters the opposing lane", "s")
    ]
    gap_abreast: Annotated[
        F32, _measure("Gap to the oncoming vehicle as ego and target begin to overlap", "m")
    ]
    time_to_meet_abreast: Annotated[
        F32, _measure("Time to meet the oncoming vehicle as ego and target begin to overlap", "s")
    ]
    gap_at_return: Annotated[
        F32,
        _measure("Gap to the oncoming vehicle as the ego is back in its lane, or collides", "m"),
    ]
    time_to_meet_at_return: Annotated[
        F32,
        _measure(
            "Time to meet the oncoming vehicle as the ego is back in its lane, or collides", "s"
        ),
    ]
    min_time_to_meet: Annotated[
        F32, _measure("Smallest time to meet while in the opposing lane", "s")
    ]
    sight_at_crossing: Annotated[
        F32,
        _measure(
            "Sight of air and road as the ego enters the opposing lane", "m", needs=["weather"]
        ),
    ]
    time_in_opposing_lane: Annotated[F32, _measure("Time in the opposing lane", "s")]
    time_available: Annotated[
        F32,
        _measure(
            "Time to meet the oncoming vehicle, or one at the limit from beyond sight",
            "s",
            needs=["weather", "speed_limit"],
        ),
    ]
    was_aborted: Annotated[Mask, _measure("Whether the ego fell back behind its target")]


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
    leader: Annotated[Encounter, FieldSpec("the ego behind the vehicle ahead")]
    time_headway: Annotated[
        F32, _to_leader("From front bumper to front bumper; null if the ego stands", "s")
    ]
    picud: Annotated[F32, _to_leader("Gap left after sudden braking of both", "m")]
    rss_margin: Annotated[
        F32, _to_leader("Gap minus the safe one of responsibility-sensitive safety", "m")
    ]
    lawful_margin: Annotated[
        F32, _to_leader("Gap minus the safe distance of L3", "m", needs=["weather"])
    ]
    follower: Annotated[Encounter, FieldSpec("the vehicle behind, behind the ego")]
    new_leader: Annotated[Encounter, FieldSpec("the vehicle ahead in the lane entered")]
    new_follower: Annotated[Encounter, FieldSpec("the vehicle behind in the lane entered")]
    stop_margin_lit: Annotated[
        F32, FieldSpec("Sight of the lit minus stopping distance", "m", needs=["weather"])
    ]
    stop_margin_unlit: Annotated[
        F32,
        FieldSpec("Sight of the unlit minus stopping distance", "m", needs=["weather", "lamps"]),
    ]
    share_below_safe_distance: Annotated[
        F32,
        FieldSpec("Share of the manoeuvre closer than the safe distance of L3", needs=["weather"]),
    ]
    tet: Annotated[F32, FieldSpec("Time at a critical time to collision, TET", "s")]
    tit: Annotated[
        F32, FieldSpec("Shortfall below the critical time to collision, integrated, TIT", "s^2")
    ]
    entry_pet: Annotated[
        F32,
        FieldSpec(
            "Until the vehicle behind on the left was where the ego entered; null if never", "s"
        ),
    ]
    return_pet: Annotated[
        F32, FieldSpec("Until the overtaken vehicle was where the ego returned; null if never", "s")
    ]
    oncoming: Annotated[PassingSafety, FieldSpec("on two-way roads")]


WHOLE_MANOEUVRE_MEASURES = (
    "share_below_safe_distance",
    "tet",
    "tit",
    "entry_pet",
    "return_pet",
    "oncoming",
)
"""The fields of `SafetyMeasures` that are measured once, over the whole manoeuvre."""
