"""Features of an overtake: the fifteen of the reproduced paper, and the state at its beginning.

`labels.attempt_features` and `labels.paper_features` compute both from recorded batches.
`PaperFeatures` becomes the table `features` of a data set; the paper is `pinto-2023` in
`docs/reference/sources.md`. `AttemptFeatures` becomes the table `attempts`, which serves models of
why drivers overtake; its parts are the classes before it.

The ego is the vehicle under study, the target is the vehicle that it overtakes, and left is the
overtaking side, also in left-hand traffic. An attempt is the beginning of an overtake. A simulation
without an attempt is measured at a frame that `labels.paper_features` draws, so that at these
frames the ego has waited for as long on average as at the attempts of other simulations. Otherwise
a model could tell the two kinds of simulation apart by the waiting time alone.

Each `FieldSpec` declares a field and its column: a description for users, a unit and where the
column is null. `null_unless` is the path of a flag or a count: the column is null where it is false
or 0. ".has_oncoming" is a field of the same class; a path without a leading dot, such as
"left.leader.valid", begins at the class of the table. `needs` names properties that a recording of
real traffic may leave unknown, such as "bodies" (mass and engine of vehicles) and "percepts"
(beliefs of drivers); the column is then null. `trajectories.UNKNOWNS` lists the properties. A
margin of the law that is a distance needs the weather, because it depends on the grip of the road.
`ColumnName(prefix="ego_")` puts a prefix before the name of the field; a column whose name says
enough has no prefix. Every partial function below, such as `_leader_column`, is a `FieldSpec` with
the entries that a group of columns shares.

An `Encounter` holds gap, closing speed and times to collision of a follower and its leader, one of
which is the ego; its `valid` is false without the other vehicle. Its fields become several columns,
such as `left_leader_gap` for the field `leader` with the prefix "left_". The description of the
field is a phrase about the two vehicles, which the descriptions of these columns contain.

The time gap of 3 s below which the ego waits (`knowledge/data/event_detection.toml`) and the 200 m
of the lane to the left (`labels.snapshots`) are choices.
"""

from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

from overtaking.core.arrays import F32, I32, U8, Mask
from overtaking.knowledge.glossary import terms
from overtaking.model.batch import Batch, ColumnName, FieldSpec, with_field_docs
from overtaking.model.overtake_events import NEVER
from overtaking.model.safety_measures import Encounter
from overtaking.model.vehicles import VehicleKind


def _paper_feature(code: str, unit: str = "1", **declared: Any) -> FieldSpec:
    """Declaration of a feature of the paper.

    Args:
        code: The paper's name of the feature, such as "WT". It names the column, and the entry of
            `knowledge/data/glossary.toml` from which `terms` reads the meaning.
        unit: Unit of the field.
        **declared: Further entries of the `FieldSpec`.
    """
    return FieldSpec(terms("features")[code].meaning, unit, column=ColumnName(code), **declared)


_weather_feature = partial(_paper_feature, needs=["weather"])
_target_feature = partial(_paper_feature, null_unless="has_target")

_KINDS = tuple(kind.code for kind in VehicleKind)
"""Names of the codes of vehicle types: S, M, L (small, medium, large car), V (van), T (truck), MC
(motorcycle), B (bicycle)."""


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class PaperFeatures(Batch):
    """Seven static and eight dynamic features; every array has shape (simulation,).

    The static features are weather, light, and the types of ego and target. `num_vehicles` includes
    the ego.

    There are two readings of the paper's definitions. In the reading "paper" an ego without an
    attempt is measured by means over all frames, so the features depend on the outcome. In the
    reading "matched", whose waiting times match, each simulation is measured at one frame: at the
    attempt, or at the frame that stands for it. Only this reading is fit to train a model. The
    readings also differ in

    - `waiting_time`: since the first frame (paper), or since the ego closed up to the target;
    - `overtaking_time`: from the attempt to the first of the return, a collision and the end of
      the recording (paper); in the other reading the end of an abort is a fourth end;
    - `speed_difference`: absolute (paper), or ego minus target;
    - `distance`: between the centres (paper), or between the bumpers of ego and target;
    - `left_occupancy`: number of vehicles in the lane to the left over the number of all vehicles
      but the ego (paper), or share of 200 m of that lane that vehicles cover.

    In simulations without a target, the features of the target are 0 and `has_target` is false.
    Waiting time, overtaking time and distance are NaN where the attempt began before the recording;
    features of the target are NaN where it is not recorded in the frame of the measurement. `frame`
    is -1 for means over all frames. Rain, wind and fog are intensities from 0 to 100 on the scale
    of the driving simulator CARLA.
    """

    reading: Annotated[str, FieldSpec("Definition in use, `paper` or `matched`", column=None)]
    night: Annotated[Mask, _weather_feature("DN", names=["Day", "Night"])]
    low_sun: Annotated[Mask, _weather_feature("HL", names=["No", "Yes"])]
    ego_kind: Annotated[U8, _paper_feature("TE", names=_KINDS)]
    target_kind: Annotated[U8, _target_feature("TP", names=_KINDS)]
    has_target: Annotated[Mask, FieldSpec("Whether there is a target", column=None)]
    waiting_time: Annotated[F32, _paper_feature("WT", "s")]
    overtaking_time: Annotated[F32, _paper_feature("OT", "s")]
    num_vehicles: Annotated[U8, _paper_feature("NV")]
    ego_speed: Annotated[F32, _paper_feature("SE", "m/s")]
    target_speed: Annotated[F32, _target_feature("SP", "m/s")]
    speed_difference: Annotated[F32, _target_feature("DSEP", "m/s")]
    distance: Annotated[F32, _target_feature("D", "m")]
    left_occupancy: Annotated[F32, _paper_feature("OLR")]
    rain: Annotated[F32, _weather_feature("PREC", "%")]
    wind: Annotated[F32, _weather_feature("WIND", "%")]
    fog: Annotated[F32, _weather_feature("FOG", "%")]
    frame: Annotated[
        I32,
        FieldSpec(
            "Frame of the measurement; null for means over all frames",
            missing=int(NEVER),
        ),
    ]


_INDICATOR_NAMES = ("off", "left", "right", "both")
"""Names of the four states of an indicator: bit 0 is the left lamp, bit 1 the right one."""

_ego_column = partial(FieldSpec, column=ColumnName(prefix="ego_"))


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class EgoState(Batch):
    """State of the ego; every array has shape (simulation,)."""

    kind: Annotated[U8, _ego_column("Type of the ego", needs=["kinds"], names=_KINDS)]
    speed: Annotated[F32, _ego_column("Speed of the ego", "m/s")]
    accel: Annotated[F32, _ego_column("Acceleration of the ego", "m/s^2")]
    available_accel: Annotated[
        F32,
        _ego_column(
            "Largest acceleration that its engine and the air resistance allow at its speed",
            "m/s^2",
            needs=["bodies"],
        ),
    ]
    desired_speed: Annotated[
        F32, _ego_column("Speed that its driver wants on a free road", "m/s", needs=["drivers"])
    ]
    waiting_time: Annotated[
        F32,
        FieldSpec("Time since the ego came closer to the target than a time gap of 3 s", "s"),
    ]
    lateral_offset: Annotated[
        F32,
        _ego_column(
            "Position of its centre across the road minus the centre of its lane, growing to the "
            "left",
            "m",
            null_unless="surroundings.on_road",
        ),
    ]


_leader_column = partial(
    FieldSpec, column=ColumnName(prefix="leader_"), null_unless=".encounter.valid"
)
_overtaking_column = partial(_leader_column, column=ColumnName(), needs=["bodies", "weather"])
"""For columns about the overtake of the leader, which have no prefix."""


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class LeaderState(Batch):
    """State of the leader, the vehicle ahead in the ego's lane; arrays have shape (simulation,).

    Without a leader `encounter.valid` is false and all other fields are undefined.
    `overtaking_time` is the time until the ego is ahead by the distance that the leader covers in a
    reaction time (`REACTION_TIME` in `labels.law.numbers`). It assumes that the leader keeps
    its speed, and that the ego accelerates by `EgoState.available_accel` all the time. Engines
    accelerate less at higher speed, so the time is a lower bound. It is infinite if the ego cannot
    pass.
    """

    encounter: Annotated[
        Encounter, FieldSpec("the ego behind the vehicle ahead", column=ColumnName("leader"))
    ]
    kind: Annotated[U8, _leader_column("Type of the vehicle ahead", needs=["kinds"], names=_KINDS)]
    length: Annotated[F32, _leader_column("Length of the vehicle ahead", "m")]
    speed: Annotated[F32, _leader_column("Speed of the vehicle ahead", "m/s")]
    accel: Annotated[F32, _leader_column("Acceleration of the vehicle ahead", "m/s^2")]
    lateral_offset: Annotated[
        F32,
        _leader_column(
            "Position of its centre across the road minus the centre of the lane, growing to the "
            "left",
            "m",
        ),
    ]
    indicator: Annotated[
        U8,
        _leader_column(
            "Indicator of the vehicle ahead", needs=["indicators"], names=_INDICATOR_NAMES
        ),
    ]
    looming: Annotated[
        F32,
        _leader_column(
            "Rate at which the angle grows that the vehicle ahead subtends at the driver's eye",
            "rad/s",
        ),
    ]
    has_next_leader: Annotated[
        Mask, FieldSpec("Whether there is another vehicle ahead of it in the lane", column=None)
    ]
    return_gap: Annotated[
        F32,
        FieldSpec(
            "Gap between the vehicle ahead and the next one in the lane, into which the ego would "
            "return",
            "m",
            null_unless=".has_next_leader",
        ),
    ]
    overtaking_time: Annotated[
        F32,
        _overtaking_column(
            "Least time until the ego is a reaction distance ahead of the vehicle ahead; null if "
            "never",
            "s",
        ),
    ]
    overtaking_distance: Annotated[
        F32, _overtaking_column("Distance that the ego covers in the overtaking time", "m")
    ]


_left_column = partial(FieldSpec, column=ColumnName(prefix="left_"), null_unless=".exists")


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class LeftLane(Batch):
    """State of the lane to the ego's left; every array has shape (simulation,).

    Occupancy, count and mean speeds refer to the 200 m from 100 m behind the ego's centre to 100 m
    ahead of it. The time-mean speed is the sum of the squared speeds over the sum of the speeds
    (Wardrop 1952), because faster vehicles pass a detector more often. `crossable` refers to a line
    between lanes of one direction; `OncomingState.crossable` refers to the centre line.
    """

    exists: Annotated[
        Mask, FieldSpec("Whether there is a lane to the left", column=ColumnName(prefix="left_"))
    ]
    leader: Annotated[
        Encounter,
        FieldSpec(
            "the ego behind the vehicle ahead on the left", column=ColumnName(prefix="left_")
        ),
    ]
    follower: Annotated[
        Encounter,
        FieldSpec(
            "the vehicle behind on the left, behind the ego", column=ColumnName(prefix="left_")
        ),
    ]
    occupancy: Annotated[
        F32,
        _left_column("Share of the lane to the left that vehicles cover, within 100 m of the ego"),
    ]
    count: Annotated[
        U8, _left_column("Number of vehicles in the lane to the left, within 100 m of the ego")
    ]
    space_mean_speed: Annotated[
        F32, _left_column("Mean speed of these vehicles", "m/s", null_unless=".count")
    ]
    time_mean_speed: Annotated[
        F32,
        _left_column(
            "Mean speed of these vehicles as a detector beside the road measures it",
            "m/s",
            null_unless=".count",
        ),
    ]
    crossable: Annotated[
        Mask, _left_column("Whether the line on the left may be crossed", needs=["marks"])
    ]


_opposing_lane_column = partial(
    FieldSpec, column=ColumnName(prefix="oncoming_"), null_unless=".exists"
)
_oncoming_column = partial(_opposing_lane_column, null_unless=".has_oncoming")


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class OncomingState(Batch):
    """State of the opposing lane; every array has shape (simulation,).

    On one-way roads `exists` is false and all other fields are undefined. Where `has_oncoming` is
    false, `kind`, `gap`, `closing_speed` and `time` are undefined.
    """

    exists: Annotated[
        Mask, FieldSpec("Whether the lane to the left is for oncoming traffic", column=None)
    ]
    has_oncoming: Annotated[Mask, FieldSpec("Whether a vehicle comes the other way", column=None)]
    kind: Annotated[
        U8, _oncoming_column("Type of the nearest oncoming vehicle", needs=["kinds"], names=_KINDS)
    ]
    gap: Annotated[
        F32, _oncoming_column("Gap between the ego and the nearest oncoming vehicle", "m")
    ]
    closing_speed: Annotated[
        F32, _oncoming_column("Speed of the ego plus speed of the nearest oncoming vehicle", "m/s")
    ]
    time: Annotated[
        F32, _oncoming_column("Time until they meet: that gap over that closing speed", "s")
    ]
    sight: Annotated[
        F32,
        _opposing_lane_column(
            "Distance at which an oncoming vehicle is visible, by weather and course of the road",
            "m",
            needs=["weather"],
        ),
    ]
    crossable: Annotated[
        Mask,
        _opposing_lane_column(
            "Whether the line between the directions may be crossed", needs=["marks"]
        ),
    ]


_weather_column = partial(FieldSpec, needs=["weather"])


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class RoadAndWeather(Batch):
    """Road, weather and light; every array has shape (simulation,)."""

    on_road: Annotated[
        Mask,
        FieldSpec(
            "Whether the ego's centre is in a driving lane; otherwise its lane is undefined",
            column=None,
        ),
    ]
    lane: Annotated[U8, FieldSpec("Index of the ego's lane, 0 the slowest", null_unless=".on_road")]
    lanes_to_left: Annotated[
        U8,
        FieldSpec(
            "Number of driving lanes of its direction to the left of the ego's lane",
            null_unless=".on_road",
        ),
    ]
    lane_width: Annotated[F32, FieldSpec("Width of the ego's lane", "m", null_unless=".on_road")]
    speed_limit: Annotated[F32, FieldSpec("Posted speed limit", "m/s", needs=["speed_limit"])]
    night: Annotated[Mask, _weather_column("Whether it is night")]
    low_sun: Annotated[Mask, _weather_column("Whether the sun stands low ahead")]
    rain: Annotated[F32, _weather_column("Rain rate", "mm/h")]
    optical_range: Annotated[F32, _weather_column("Meteorological optical range of the fog", "m")]
    wind: Annotated[F32, _weather_column("Mean wind speed", "m/s")]
    friction: Annotated[
        F32, _weather_column("Largest friction coefficient between the ego's tyres and the road")
    ]
    sight_lit: Annotated[
        F32,
        _weather_column("Distance at which the ego's driver sees a vehicle with lamps on", "m"),
    ]
    sight_unlit: Annotated[
        F32,
        _weather_column(
            "Distance at which the ego's driver sees a vehicle without lamps",
            "m",
            needs=["weather", "lamps"],
        ),
    ]


_law_column = partial(FieldSpec, column=ColumnName(prefix="law_"), needs=["weather"])


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class LawMarginsOnPullOut(Batch):
    """Margins of the law if the ego pulled out now; every array has shape (simulation,).

    L3 to L14s are rules of the Portuguese pack in `docs/reference/rules.md`. A margin is negative
    in a breach and 0 at the limit of the law. The safe distance (L3) lets a vehicle stop behind a
    leader that brakes suddenly. Margins of a gap are undefined without the other vehicle.
    """

    leader: Annotated[
        F32,
        _law_column(
            "L3: gap to the vehicle ahead minus the safe distance",
            "m",
            null_unless="leader.encounter.valid",
        ),
    ]
    left_leader: Annotated[
        F32,
        _law_column(
            "L4 if the ego moved over now: gap to the vehicle ahead on the left minus the gap that "
            "is safe and avoids a time to collision below 3 s",
            "m",
            null_unless="left.leader.valid",
        ),
    ]
    left_follower: Annotated[
        F32,
        _law_column(
            "L5 if the ego moved over now: gap to the vehicle behind on the left minus the gap "
            "that is safe and avoids abrupt braking",
            "m",
            null_unless="left.follower.valid",
        ),
    ]
    speed: Annotated[
        F32,
        _law_column(
            "L12: speed limit of road and vehicle minus speed of the ego",
            "m/s",
            needs=["speed_limit", "kinds", "road_kind"],
        ),
    ]
    stop_lit: Annotated[
        F32,
        _law_column("L14: sight distance to a lit vehicle minus stopping distance", "m"),
    ]
    stop_unlit: Annotated[
        F32,
        _law_column(
            "L14s: sight distance to an unlit vehicle minus stopping distance",
            "m",
            needs=["weather", "lamps"],
        ),
    ]


_belief_column = partial(FieldSpec, null_unless=".is_detected", needs=["percepts"])


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class BeliefsAtPullOut(Batch):
    """Beliefs of the simulated driver at its last decision to pull out, in or before the frame.

    `exists` and `age` have shape (simulation,). The other arrays have shape (simulation, 3): the
    leader, then the leader and the follower in the lane on the left. `data.tables.schemas` makes a
    column for each of the three, with the prefixes "believed_leader_", "believed_new_leader_" and
    "believed_new_follower_". Where `exists` is false, all other fields are undefined; `gap` and
    `closing_speed` also where `is_detected` is false.
    """

    exists: Annotated[
        Mask, FieldSpec("Whether the driver had decided to pull out before", column=None)
    ]
    age: Annotated[
        F32,
        FieldSpec(
            "Time since the last decision to pull out",
            "s",
            column=ColumnName(prefix="believed_"),
            null_unless=".exists",
            needs=["percepts"],
        ),
    ]
    is_detected: Annotated[
        Mask,
        FieldSpec(
            "Whether the driver had noticed the vehicle", null_unless=".exists", needs=["percepts"]
        ),
    ]
    gap: Annotated[F32, _belief_column("Gap between the bumpers as the driver believed it", "m")]
    closing_speed: Annotated[F32, _belief_column("Closing speed as the driver believed it", "m/s")]


@dataclass(frozen=True, slots=True, kw_only=True)
class AttemptFeatures(Batch):
    """State of the traffic at the decision to overtake.

    A model of the decision must not see its consequences, so nothing here depends on later frames.
    Except for `beliefs`, all values are true values, which the driver may have misjudged.

    Attributes:
        frame: Frame of the attempt, or the frame that stands for it, shape (simulation,).
        ego: State of the ego.
        leader: State of the vehicle ahead in its lane.
        left: State of the lane to its left.
        oncoming: State of the opposing lane.
        surroundings: Road, weather and light.
        law: Margins of the law if the ego pulled out in this frame.
        beliefs: Beliefs of the driver at its last decision to pull out.
    """

    frame: Annotated[I32, FieldSpec("Frame of the attempt, or the frame that stands for it")]
    ego: EgoState
    leader: LeaderState
    left: LeftLane
    oncoming: OncomingState
    surroundings: RoadAndWeather
    law: LawMarginsOnPullOut
    beliefs: BeliefsAtPullOut
