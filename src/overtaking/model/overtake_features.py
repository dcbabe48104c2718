"""The paper's fifteen features, and the state at an overtake that begins or might."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

from overtaking.core.arrays import F32, I32, U8, Mask
from overtaking.knowledge.glossary import terms
from overtaking.model.batch import Batch, ColumnName, FieldSpec, with_field_docs
from overtaking.model.overtake_events import NEVER
from overtaking.model.safety_measures import Encounter
from overtaking.model.vehicles import VehicleKind


def _paper(code: str, unit: str = "1", **declared: Any) -> FieldSpec:
    """Declaration of a feature, with its meaning from `knowledge/data/glossary.toml`."""
    return FieldSpec(terms("features")[code].meaning, unit, column=ColumnName(code), **declared)


_weather = partial(_paper, needs=["weather"])
_of_target = partial(_paper, null_unless="has_target")
_KINDS = tuple(kind.code for kind in VehicleKind)


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class PaperFeatures(Batch):
    """Seven static and eight dynamic features; every array has shape (simulation,).

    Without a vehicle to overtake its features are 0 and `has_target` is false. Waiting time,
    overtaking time and distance are NaN where the attempt began before the recording; features of
    the target are NaN where it is not recorded in that frame. The column of a feature has the name
    that the paper gives it.
    """

    reading: Annotated[str, FieldSpec("How they were measured, `paper` or `matched`", column=None)]
    night: Annotated[Mask, _weather("DN", names=["Day", "Night"])]
    low_sun: Annotated[Mask, _weather("HL", names=["No", "Yes"])]
    ego_kind: Annotated[U8, _paper("TE", names=_KINDS)]
    target_kind: Annotated[U8, _of_target("TP", names=_KINDS)]
    has_target: Annotated[Mask, FieldSpec("Whether there is a target", column=None)]
    waiting_time: Annotated[F32, _paper("WT", "s")]
    overtaking_time: Annotated[F32, _paper("OT", "s")]
    num_vehicles: Annotated[U8, _paper("NV")]
    ego_speed: Annotated[F32, _paper("SE", "m/s")]
    target_speed: Annotated[F32, _of_target("SP", "m/s")]
    speed_difference: Annotated[F32, _of_target("DSEP", "m/s")]
    distance: Annotated[F32, _of_target("D", "m")]
    left_occupancy: Annotated[F32, _paper("OLR")]
    rain: Annotated[F32, _weather("PREC", "%")]
    wind: Annotated[F32, _weather("WIND", "%")]
    fog: Annotated[F32, _weather("FOG", "%")]
    frame: Annotated[
        I32,
        FieldSpec(
            "Frame at which they were measured, none for means over all frames",
            missing=int(NEVER),
        ),
    ]


_SIDES = ("off", "left", "right", "both")
"""Names of an indicator: bit 0 left, bit 1 right, as recorded."""
_ego = partial(FieldSpec, column=ColumnName(prefix="ego_"))


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class EgoState(Batch):
    """The ego; every array has shape (simulation,)."""

    kind: Annotated[U8, _ego("Type of the ego", needs=["kinds"], names=_KINDS)]
    speed: Annotated[F32, _ego("Its speed", "m/s")]
    accel: Annotated[F32, _ego("Its acceleration", "m/s^2")]
    available_accel: Annotated[
        F32, _ego("Largest acceleration of engine and air at that speed", "m/s^2", needs=["bodies"])
    ]
    desired_speed: Annotated[
        F32, _ego("Speed that its driver wants on a free road", "m/s", needs=["drivers"])
    ]
    waiting_time: Annotated[F32, FieldSpec("Time since it closed up", "s")]
    lateral_offset: Annotated[
        F32,
        _ego(
            "From the centre of its lane, growing to the left",
            "m",
            null_unless="surroundings.on_road",
        ),
    ]


_leader = partial(FieldSpec, column=ColumnName(prefix="leader_"), null_unless=".encounter.valid")
_passing = partial(_leader, column=ColumnName(), needs=["bodies", "weather"])


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class LeaderState(Batch):
    """The vehicle ahead in the ego's lane; every array has shape (simulation,).

    Where `encounter.valid` is false, all other fields are undefined. `overtaking_time` is the time
    until the ego is a reaction distance ahead of it at `EgoState.available_accel`, infinite if the
    ego cannot pass.
    """

    encounter: Annotated[
        Encounter, FieldSpec("the ego behind the vehicle ahead", column=ColumnName("leader"))
    ]
    kind: Annotated[U8, _leader("Type of the vehicle ahead", needs=["kinds"], names=_KINDS)]
    length: Annotated[F32, _leader("Its length", "m")]
    speed: Annotated[F32, _leader("Its speed", "m/s")]
    accel: Annotated[F32, _leader("Its acceleration", "m/s^2")]
    lateral_offset: Annotated[F32, _leader("From the centre of the lane, growing to the left", "m")]
    indicator: Annotated[U8, _leader("Its indicator", needs=["indicators"], names=_SIDES)]
    looming: Annotated[F32, _leader("Growth of its image in the eye", "rad/s")]
    has_next_leader: Annotated[
        Mask, FieldSpec("Whether there is another vehicle ahead of it in the lane", column=None)
    ]
    return_gap: Annotated[
        F32,
        FieldSpec(
            "Gap between it and the next vehicle ahead in the lane",
            "m",
            null_unless=".has_next_leader",
        ),
    ]
    overtaking_time: Annotated[
        F32, _passing("Least time to be a reaction distance ahead of it; null if never", "s")
    ]
    overtaking_distance: Annotated[F32, _passing("Way of the ego in that time", "m")]


_left = partial(FieldSpec, column=ColumnName(prefix="left_"), null_unless=".exists")


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class LeftLane(Batch):
    """The lane to the ego's left; every array has shape (simulation,).

    Occupancy and count are of the 100 m ahead and behind.
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
        F32, _left("Lengths of vehicles in 200 m of the lane to the left, over 200 m")
    ]
    count: Annotated[U8, _left("Vehicles there")]
    space_mean_speed: Annotated[F32, _left("Mean of their speeds", "m/s", null_unless=".count")]
    time_mean_speed: Annotated[
        F32, _left("Mean of the speeds past a place there", "m/s", null_unless=".count")
    ]
    crossable: Annotated[
        Mask, _left("Whether the line on the left may be crossed", needs=["marks"])
    ]


_opposing = partial(FieldSpec, column=ColumnName(prefix="oncoming_"), null_unless=".exists")
_oncoming = partial(_opposing, null_unless=".has_oncoming")


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class OncomingState(Batch):
    """The side of oncoming traffic; every array has shape (simulation,).

    Where `exists` is false, as on one-way roads, all other fields are undefined. Where
    `has_oncoming` is false, the fields of the oncoming vehicle are undefined.
    """

    exists: Annotated[
        Mask, FieldSpec("Whether the lane to the left is for oncoming traffic", column=None)
    ]
    has_oncoming: Annotated[Mask, FieldSpec("Whether a vehicle comes the other way", column=None)]
    kind: Annotated[
        U8, _oncoming("Type of the next oncoming vehicle", needs=["kinds"], names=_KINDS)
    ]
    gap: Annotated[F32, _oncoming("Gap to it", "m")]
    closing_speed: Annotated[F32, _oncoming("Both speeds together", "m/s")]
    time: Annotated[F32, _oncoming("Time to meet it", "s")]
    sight: Annotated[
        F32, _opposing("Distance up to which air and road show it", "m", needs=["weather"])
    ]
    crossable: Annotated[
        Mask,
        _opposing("Whether the line between the directions may be crossed", needs=["marks"]),
    ]


_scene = partial(FieldSpec, needs=["weather"])


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class RoadAndWeather(Batch):
    """Road, weather and light; every array has shape (simulation,)."""

    on_road: Annotated[
        Mask,
        FieldSpec(
            "Whether the ego's centre is in a driving lane; else its lane means nothing",
            column=None,
        ),
    ]
    lane: Annotated[U8, FieldSpec("Lane, 0 the slowest", null_unless=".on_road")]
    lanes_to_left: Annotated[
        U8, FieldSpec("Driving lanes to the left of it", null_unless=".on_road")
    ]
    lane_width: Annotated[F32, FieldSpec("Its width", "m", null_unless=".on_road")]
    speed_limit: Annotated[F32, _scene("Limit as posted", "m/s", needs=["speed_limit"])]
    night: Annotated[Mask, _scene("Whether it is night")]
    low_sun: Annotated[Mask, _scene("Whether the sun stands low ahead")]
    rain: Annotated[F32, _scene("Rain rate", "mm/h")]
    optical_range: Annotated[F32, _scene("Meteorological optical range", "m")]
    wind: Annotated[F32, _scene("Mean wind speed", "m/s")]
    friction: Annotated[F32, _scene("Peak friction under the ego")]
    sight_lit: Annotated[F32, _scene("Distance at which a lit vehicle is seen", "m")]
    sight_unlit: Annotated[
        F32, _scene("Distance at which an unlit one is seen", "m", needs=["weather", "lamps"])
    ]


_law = partial(FieldSpec, column=ColumnName(prefix="law_"), needs=["weather"])


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class LawMarginsOnPullOut(Batch):
    """Margins of the law if the ego moved over now, negative in a breach; shape (simulation,).

    A margin to a vehicle is undefined without that vehicle.
    """

    leader: Annotated[
        F32,
        _law(
            "L3: gap to the vehicle ahead minus the safe distance",
            "m",
            null_unless="leader.encounter.valid",
        ),
    ]
    left_leader: Annotated[
        F32,
        _law(
            "L4 if the ego moved over now: room to the vehicle ahead on the left",
            "m",
            null_unless="left.leader.valid",
        ),
    ]
    left_follower: Annotated[
        F32,
        _law(
            "L5 if the ego moved over now: room to the vehicle behind on the left",
            "m",
            null_unless="left.follower.valid",
        ),
    ]
    speed: Annotated[
        F32,
        _law(
            "L12: limit of road and vehicle minus speed",
            "m/s",
            needs=["speed_limit", "kinds", "road_kind"],
        ),
    ]
    stop_lit: Annotated[F32, _law("L14: sight of the lit minus stopping distance", "m")]
    stop_unlit: Annotated[
        F32,
        _law("L14s: sight of the unlit minus stopping distance", "m", needs=["weather", "lamps"]),
    ]


_perceived = partial(FieldSpec, null_unless=".is_detected", needs=["percepts"])


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class BeliefsAtPullOut(Batch):
    """Beliefs of the ego's driver at its last decision to pull out.

    Arrays have shape (simulation,), or (simulation, 3) for the leader, and the leader and the
    follower in the lane on the left. Where `exists` is false, all other fields are undefined; gap
    and closing speed also where `is_detected` is.
    """

    exists: Annotated[Mask, FieldSpec("Whether there was such a decision", column=None)]
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
    gap: Annotated[F32, _perceived("Gap from bumper to bumper as the driver believed it", "m")]
    closing_speed: Annotated[F32, _perceived("Speed of approach as the driver believed it", "m/s")]


@dataclass(frozen=True, slots=True, kw_only=True)
class AttemptFeatures(Batch):
    """Features of the decision to overtake. They use nothing that happens after `frame`.

    All values are true ones, except those in `beliefs`.

    Attributes:
        frame: Frame of the attempt, or of the instant that stands for it, shape (simulation,).
        ego: The ego.
        leader: The vehicle ahead in its lane.
        left: The lane to its left.
        oncoming: The side of oncoming traffic.
        surroundings: Road, weather and light.
        law: Margins of the law for pulling out now.
        beliefs: Beliefs of the driver at the last decision to pull out.
    """

    frame: Annotated[I32, FieldSpec("Frame of the attempt, or of what stands for it")]
    ego: EgoState
    leader: LeaderState
    left: LeftLane
    oncoming: OncomingState
    surroundings: RoadAndWeather
    law: LawMarginsOnPullOut
    beliefs: BeliefsAtPullOut
