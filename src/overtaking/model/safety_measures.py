"""Surrogate measures of safety of an overtake: how near it came to a collision.

`labels.safety_features` computes a `SafetyMeasures` from the recorded states of a batch of
simulations; `Batch` is the base class of dataclasses with such arrays. Users read it as the table
`safety` of a data set, with one row for each simulation and moment. A measure of the whole
manoeuvre stands in the row of the moment "manoeuvre" and is null in the other rows.

Terms:
    ego, target: the vehicle under study, and the vehicle that it overtakes.
    left: the overtaking side.
    attempt: the overtake from the frame in which the ego begins to move to the left.
    manoeuvre: from 3 s before the attempt to 3 s after its end, or the whole simulation without an
        attempt. The times are chosen: signalling before and settling ahead of the target belong to
        the overtake.

Each `FieldSpec` declares a column of that table: a description, a unit and where the column is
null. `column=None` declares a field without a column. `null_unless` names the flag without which
there is no value: ".valid" is a field of the same class, "leader.valid" a path that begins at
`SafetyMeasures`. `needs` names properties that a recording may leave unknown; the column is then
null. NaN and infinite values, such as the time to a collision that never comes, are null in the
table. The description of a column of a nested class is the description of its own field, followed
by the description of the field that holds the class.
`with_field_docs` lists the fields in the docstring of the class.
"""

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
"""Entries of the axis `moment`. "manoeuvre" has the worst value over the whole manoeuvre; the
others are events, fields of `model.overtake_events.OvertakeEvents`:

- attempt: the ego begins to move to the left
- line_crossed: its first corner is over the line on the left
- overlap_begin: its front reaches the rear of the target
- return_begin: it begins to move back to the right
- return_end: its whole body is back in the original lane, ahead of the target
"""

_pair_measure = partial(FieldSpec, null_unless=".valid")
"""Declaration of a measure of a follower and its leader."""

_leader_measure = partial(
    FieldSpec, column=ColumnName(prefix="leader_"), null_unless="leader.valid"
)
"""Declaration of a further measure of the ego and the vehicle ahead, beside `Encounter`."""


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class Encounter(Batch):
    """A follower behind a leader, one of them the ego; all arrays have the same shape.

    Times and the deceleration belong to the follower, which has to brake. The time of an event that
    never happens is infinite. Where `valid` is false, the values are undefined. The functions of
    `world.surrogate_safety` state formulas and sources.
    """

    valid: Annotated[Mask, FieldSpec("Whether the ego has this neighbour", column=None)]
    gap: Annotated[F32, _pair_measure("Gap between the bumpers, negative alongside", "m")]
    closing_speed: Annotated[
        F32, _pair_measure("Speed at which that gap shrinks, negative while it grows", "m/s")
    ]
    time_gap: Annotated[
        F32, _pair_measure("Gap over the speed of the follower; null if the follower stands", "s")
    ]
    ttc: Annotated[F32, _pair_measure("Time to collision at constant speeds; null if never", "s")]
    mttc: Annotated[
        F32, _pair_measure("Time to collision at constant accelerations; null if never", "s")
    ]
    drac: Annotated[
        F32,
        _pair_measure("Deceleration that just avoids a collision; null if no braking can", "m/s^2"),
    ]


_passing_measure = partial(FieldSpec, null_unless=".was_in_opposing_lane")
"""Declaration of a measure that only an ego in the opposing lane has."""


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class PassingSafety(Batch):
    """Measures against the nearest oncoming vehicle; arrays have shape (simulation,).

    The ego is in the opposing lane while one of its corners is beyond the centre line.
    `was_in_opposing_lane` is false on one-way roads and for egos that never entered that lane; all
    other fields are then undefined. Gaps and times to meet are NaN where no vehicle came. A time to
    meet is the gap over the sum of both speeds; it is 0 once the two are beside each other.

    `time_available` is the shorter of two times. One is `time_to_meet_at_crossing`, if a vehicle
    came. The other is the time to meet a vehicle just out of sight, which drives at the speed
    limit.
    """

    was_in_opposing_lane: Annotated[
        Mask, FieldSpec("Whether the ego entered the opposing lane", column=None)
    ]
    gap_at_crossing: Annotated[
        F32,
        _passing_measure("Gap to the oncoming vehicle as the ego enters the opposing lane", "m"),
    ]
    time_to_meet_at_crossing: Annotated[
        F32,
        _passing_measure(
            "Time to meet the oncoming vehicle as the ego enters the opposing lane", "s"
        ),
    ]
    gap_abreast: Annotated[
        F32, _passing_measure("Gap to the oncoming vehicle as ego and target begin to overlap", "m")
    ]
    time_to_meet_abreast: Annotated[
        F32,
        _passing_measure(
            "Time to meet the oncoming vehicle as ego and target begin to overlap", "s"
        ),
    ]
    gap_at_return: Annotated[
        F32,
        _passing_measure(
            "Gap to the oncoming vehicle as the ego is back in its lane, or collides", "m"
        ),
    ]
    time_to_meet_at_return: Annotated[
        F32,
        _passing_measure(
            "Time to meet the oncoming vehicle as the ego is back in its lane, or collides", "s"
        ),
    ]
    min_time_to_meet: Annotated[
        F32, _passing_measure("Smallest time to meet while in the opposing lane", "s")
    ]
    sight_at_crossing: Annotated[
        F32,
        _passing_measure(
            "Sight that air and road allow as the ego enters the opposing lane",
            "m",
            needs=["weather"],
        ),
    ]
    time_in_opposing_lane: Annotated[F32, _passing_measure("Time in the opposing lane", "s")]
    time_available: Annotated[
        F32,
        _passing_measure(
            "Time to meet the oncoming vehicle as the ego enters the opposing lane, or a vehicle "
            "that comes into sight there at the speed limit, whichever is shorter",
            "s",
            needs=["weather", "speed_limit"],
        ),
    ]
    was_aborted: Annotated[Mask, _passing_measure("Whether the ego fell back behind its target")]


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyMeasures(Batch):
    """Surrogate measures of safety of a batch.

    Arrays have shape (simulation, moment) with `MEASURED_MOMENTS` as the last axis; the measures in
    `WHOLE_MANOEUVRE_MEASURES` have shape (simulation,). The worst value of the manoeuvre is the
    largest closing speed and deceleration, and the smallest of each other measure. Where `frame` is
    `NEVER`, the other values are undefined, and the table has no row.

    The ego enters the lane on the left at `attempt` and `line_crossed`, and the lane on the right
    at `return_begin`. At the other moments it enters no lane, so `new_leader.valid` and
    `new_follower.valid` are false.

    Stop margins are the distance at which the ego's driver sees a vehicle ahead, with lamps on or
    off, minus the ego's stopping distance. At night the sight of an unlit vehicle depends on the
    ego's headlamps.

    The accelerations and the reaction time of RSS (Shalev-Shwartz et al. 2017) are in
    `labels.law.numbers`, the constants of all other measures in `event_detection.toml` of the
    knowledge base. The constants of PICUD come from Uno et al. (2002). The 3 s of TET and TIT are
    chosen: the longest threshold that Minderhoud and Bovy (2001) compare.
    """

    frame: Annotated[
        I32,
        FieldSpec(
            "Frame of each moment, of the manoeuvre its first; `NEVER` (-1) without that event",
            column=None,
        ),
    ]
    leader: Annotated[Encounter, FieldSpec("the ego behind the vehicle ahead")]
    time_headway: Annotated[
        F32, _leader_measure("From front bumper to front bumper; null if the ego stands", "s")
    ]
    picud: Annotated[
        F32,
        _leader_measure(
            "Gap that is left when both brake at 3.3 m/s^2, the ego 1 s later, PICUD", "m"
        ),
    ]
    rss_margin: Annotated[
        F32, _leader_measure("Gap minus the safe gap of responsibility-sensitive safety, RSS", "m")
    ]
    lawful_margin: Annotated[
        F32,
        _leader_measure(
            "Gap minus the safe distance of rule L3, Article 18(1) of Portugal's Highway Code",
            "m",
            needs=["weather"],
        ),
    ]
    follower: Annotated[Encounter, FieldSpec("the vehicle behind the ego")]
    new_leader: Annotated[Encounter, FieldSpec("the vehicle ahead in the lane entered")]
    new_follower: Annotated[Encounter, FieldSpec("the vehicle behind in the lane entered")]
    stop_margin_lit: Annotated[
        F32,
        FieldSpec(
            "Sight distance of a lit vehicle ahead minus stopping distance", "m", needs=["weather"]
        ),
    ]
    stop_margin_unlit: Annotated[
        F32,
        FieldSpec(
            "Sight distance of an unlit vehicle ahead minus stopping distance",
            "m",
            needs=["weather", "lamps"],
        ),
    ]
    share_below_safe_distance: Annotated[
        F32,
        FieldSpec(
            "Share of the manoeuvre closer than the safe distance of rule L3", needs=["weather"]
        ),
    ]
    tet: Annotated[F32, FieldSpec("Time with a time to collision of at most 3 s, TET", "s")]
    tit: Annotated[
        F32, FieldSpec("Integral of 3 s minus the time to collision over this time, TIT", "s^2")
    ]
    entry_pet: Annotated[
        F32,
        FieldSpec(
            "From the ego's crossing of the line until the vehicle behind on the left reached the "
            "place where the ego's rear was, PET; null if never",
            "s",
        ),
    ]
    return_pet: Annotated[
        F32,
        FieldSpec(
            "From the end of the ego's return until the overtaken vehicle reached the place where "
            "the ego's rear was, PET; null if never",
            "s",
        ),
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
"""The fields of `SafetyMeasures` with one value for each simulation, over the whole manoeuvre."""
