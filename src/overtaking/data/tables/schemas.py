"""The columns of every table, each declared once, in order; schemas and encoders follow from them.

Keys are the same in all tables: `simulation` is the number of a simulation in its data set,
`vehicle` the slot of a vehicle (the ego is 0), and `frame` counts from 0. Missing values are null,
never a number. States are sorted by simulation, vehicle, frame: frames of a vehicle are adjacent.
"""

from collections.abc import Collection
from functools import partial

import numpy as np
import pyarrow as pa

from overtaking.data.tables import names
from overtaking.data.tables.columns import TEXT, Column, columns_of, computed_column
from overtaking.model.batch import FieldSpec
from overtaking.model.overtake_features import (
    AttemptFeatures,
    BeliefsAtPullOut,
    EgoState,
    LawMarginsOnPullOut,
    LeaderState,
    LeftLane,
    OncomingState,
    PaperFeatures,
    RoadAndWeather,
)
from overtaking.model.safety_measures import MEASURED_MOMENTS, SafetyMeasures
from overtaking.model.scenario import MAX_VEHICLES, Scenario
from overtaking.model.trajectories import (
    Contacts,
    Lights,
    PerceivedVehicle,
    Percepts,
    States,
    Trajectories,
)
from overtaking.model.vehicles import DriverTraits, VehicleSpecs
from overtaking.model.verdicts import Findings, Labels
from overtaking.model.weather import Weather

FORMAT = "overtaking"
"""First part of the schema name in a file's metadata."""

VERSION = 1
"""Version of all schemas; it rises when a column is added, removed or changes its meaning."""

NUM_INDICATOR_BITS = int(Lights.BRAKE).bit_length() - 1
"""The lowest bits of `Lights` are the indicator's."""

_BEFORE_LANE = ("x", "y", "s", "d")  # The states that come before the lane in the table.
_BODY = ("kind", "colour", "length", "width")  # What is known of some recorded vehicles.
_OF_ONE_VEHICLE = ("is_detected", "gap", "closing_speed")  # Beliefs at a decision to pull out.

_optional = partial(computed_column, is_nullable=True)

_SIMULATION = computed_column(
    "simulation", np.int64, FieldSpec("Number of the simulation in its data set", is_key=True)
)
_VEHICLE = computed_column(
    "vehicle",
    np.uint8,
    FieldSpec("Slot of the vehicle in its simulation, 0 is the ego", is_key=True),
)
_FRAME = computed_column(
    "frame", np.int32, FieldSpec("Number of the frame in its simulation", is_key=True)
)
_scenario = partial(columns_of, Scenario, "scenario")
_vehicles = partial(columns_of, VehicleSpecs, "scenario.vehicles", nullable=False)
_weather = partial(FieldSpec, needs=("weather",))
_percepts = partial(columns_of, Percepts, "percepts")
_perceived = partial(_percepts, without=("kind", "time"))
_beliefs = partial(columns_of, BeliefsAtPullOut, "beliefs", only=_OF_ONE_VEHICLE, nullable=True)


def _enumeration(
    name: str,
    meaning: str,
    codes: tuple[str, ...],
    *,
    needs: tuple[str, ...] = (),
    is_nullable: bool = False,
    is_key: bool = False,
) -> Column:
    """A computed column of codes with names."""
    spec = FieldSpec(meaning, names=codes, needs=needs, is_key=is_key)
    return computed_column(name, np.uint8, spec, is_nullable=is_nullable)


_RECORDED: dict[str, list[Column]] = {
    "simulations": [
        _SIMULATION,
        computed_column("seed", np.uint64, FieldSpec("Seed of the random numbers")),
        *_scenario(only=("scenario_index",)),
        computed_column("profile", TEXT, FieldSpec("Profile from which the scenario was drawn")),
        computed_column("road", TEXT, FieldSpec("Name of the road; the manifest describes it")),
        computed_column(
            "num_vehicles", np.uint8, FieldSpec("Number of vehicles, the ego included")
        ),
        computed_column("weather", np.int64, FieldSpec("Key of its row in the weather table")),
        *columns_of(Trajectories, only=("num_frames",)),
        computed_column("frame_interval", np.int32, FieldSpec("Time between two frames", "ms")),
        *_scenario(only=("horizon", "attempt_deadline", "weight")),
        computed_column(
            "trace_hash", pa.binary(16), FieldSpec("128-bit hash over the recorded integers")
        ),
        _optional("source_recording", TEXT, FieldSpec("Recording from which it was imported")),
    ],
    "weather": [
        computed_column(
            "weather",
            np.int64,
            FieldSpec("Key; that of the simulation it was drawn for", is_key=True),
        ),
        _optional("preset", TEXT, _weather("CARLA preset, null if drawn freely")),
        *columns_of(Weather, "scenario.weather", without=("preset",), needs=("weather",)),
        computed_column("rain", np.float32, _weather("Rain rate", "mm/h")),
        computed_column(
            "water_film",
            np.float32,
            _weather("Water above the texture of the slowest lane, outside puddles", "m"),
        ),
        computed_column(
            "friction",
            np.float32,
            _weather("Peak friction of a half-worn car tyre at 100 km/h on that film"),
        ),
        computed_column("wind", np.float32, _weather("Mean speed of the wind", "m/s")),
        computed_column(
            "optical_range", np.float32, _weather("Meteorological optical range of the fog", "m")
        ),
        computed_column(
            "sight_unlit",
            np.float32,
            _weather(
                "Distance at which a vehicle of contrast 0.5 is seen ahead, light or not", "m"
            ),
        ),
        computed_column(
            "sight_lit", np.float32, _weather("Distance at which rear lamps are seen", "m")
        ),
    ],
    "vehicles": [
        _SIMULATION,
        _VEHICLE,
        _enumeration("role", "Whether it is the overtaking vehicle under study", names.ROLES),
        *_vehicles(only=_BODY),
        *_vehicles(without=("valid", *_BODY), needs=("bodies",)),
        *columns_of(DriverTraits, "scenario.drivers", needs=("drivers",)),
        *_scenario(only=("start_s",)),
        computed_column(
            "start_lane_id", np.int16, FieldSpec("OpenDRIVE id of the lane it starts in")
        ),
        *_scenario(only=("start_speed",)),
        *columns_of(Contacts, "contacts", nullable=True),
    ],
    "frames": [
        _SIMULATION,
        _FRAME,
        computed_column("time", np.int32, FieldSpec("Time since the first frame", "ms")),
        _optional("lane_id", np.int16, FieldSpec("OpenDRIVE id of the ego's lane")),
        _optional(
            "speed_limit",
            np.float64,
            FieldSpec("Limit in the ego's lane", "m/s", needs=("speed_limit",)),
        ),
        _enumeration(
            "right_line",
            "Line on the right of the ego's lane",
            names.MARKS,
            needs=("marks",),
            is_nullable=True,
        ),
        _enumeration(
            "left_line",
            "Line on the left of the ego's lane",
            names.MARKS,
            needs=("marks",),
            is_nullable=True,
        ),
        _optional("lane_width", np.float64, FieldSpec("Width of the ego's lane", "m")),
        _optional("right_lane_id", np.int16, FieldSpec("Lane right of the ego's")),
        _optional("right_lane_width", np.float64, FieldSpec("Width of that lane", "m")),
        _optional("left_lane_id", np.int16, FieldSpec("Lane left of the ego's")),
        _optional("left_lane_width", np.float64, FieldSpec("Width of that lane", "m")),
        *columns_of(Trajectories, only=("collided_with",)),
        computed_column(
            "lane_change_begins",
            np.bool_,
            FieldSpec(
                "Whether the ego begins to pull out or to return in this frame", needs=("stage",)
            ),
        ),
        *columns_of(Trajectories, only=("stage",), nullable=False),
    ],
    "states": [
        _SIMULATION,
        _VEHICLE,
        _FRAME,
        *columns_of(States, "states", only=_BEFORE_LANE),
        _optional("lane_id", np.int16, FieldSpec("OpenDRIVE id of its lane")),
        # Simulations have every state; `schema_of` allows the nulls of recordings.
        *columns_of(States, "states", without=_BEFORE_LANE, nullable=False),
        _enumeration("indicator", "Direction indicator", names.INDICATORS, needs=("indicators",)),
        computed_column(
            "lights",
            np.uint8,
            FieldSpec("Lights that are on, one bit each", needs=("lamps",), flags=names.FLAGS),
        ),
    ],
    "percepts": [
        _SIMULATION,
        computed_column(
            "percept", np.int32, FieldSpec("Number of the percept in its simulation", is_key=True)
        ),
        *_percepts(only=("kind", "time")),
        *_perceived(prefix="leader_", about="the vehicle ahead", index=PerceivedVehicle.LEADER),
        *_perceived(
            prefix="new_leader_",
            about="the vehicle ahead in the lane that is entered",
            index=PerceivedVehicle.NEW_LEADER,
        ),
        *_perceived(
            prefix="new_follower_",
            about="the vehicle behind in the lane that is entered",
            index=PerceivedVehicle.NEW_FOLLOWER,
        ),
    ],
    "actions": [
        _SIMULATION,
        computed_column(
            "action",
            np.int32,
            FieldSpec("Number of the decision from which on it holds, 20 a second", is_key=True),
        ),
        computed_column("time", np.int32, FieldSpec("Instant of that decision", "ms")),
        _enumeration(
            "move", "Decision of another driver of the ego", names.MOVES, is_nullable=True
        ),
        _optional("accel", np.int32, FieldSpec("Acceleration that it asked for", "mm/s^2")),
        _optional(
            "lane_change",
            np.int32,
            FieldSpec("Wish for a lane: 1 the faster one, -1 the slower one"),
        ),
        _optional(
            "wheel_angle",
            np.int16,
            FieldSpec("Front wheels, positive to the fast side", "0.1 mrad"),
        ),
    ],
}

_LABELS: dict[str, list[Column]] = {
    "events": [
        _SIMULATION,
        _enumeration("event", "What happened, see the page on events", names.EVENTS, is_key=True),
        computed_column("frame", np.int32, FieldSpec("First frame in which it is so")),
        computed_column("time", np.int32, FieldSpec("Time of that frame", "ms")),
        _optional("vehicle", np.uint8, FieldSpec("Slot of the vehicle that it is about")),
        _optional(
            "speed_change",
            np.float32,
            FieldSpec("Change of the ego's speed by the first contact", "m/s"),
        ),
        _optional(
            "was_intended",
            np.bool_,
            FieldSpec("Whether the ego's driver meant the attempt, if recorded"),
        ),
    ],
    "labels": [
        _SIMULATION,
        _enumeration(
            "policy",
            "Which rules decide, and what is done in doubt",
            names.POLICY_NAMES,
            is_key=True,
        ),
        *columns_of(Labels, "labels", only=("classes",)),
        *columns_of(Labels, "labels", without=("classes",)),
        computed_column("rule_set", TEXT, FieldSpec("Version of the rules")),
        computed_column(
            "balance_weight", np.float64, FieldSpec("Weight that gives back the natural rates")
        ),
    ],
    "findings": [
        _SIMULATION,
        _enumeration("rule", "Code of the rule", names.RULES, is_key=True),
        *columns_of(
            Findings,
            "findings",
            only=("verdict", "margin", "first_frame", "last_frame"),
            nullable=("margin",),
        ),
        _enumeration("article", "Article of the Highway Code", names.ARTICLES),
        *columns_of(Findings, "findings", only=("severity", "belief")),
    ],
    "features": [
        _SIMULATION,
        _enumeration(
            "reading",
            "The paper's way of measuring, or alike in every class",
            names.READINGS,
            is_key=True,
        ),
        *columns_of(
            PaperFeatures,
            units={"left_occupancy": "%"},
            nullable=("waiting_time", "overtaking_time"),
        ),
    ],
    "attempts": [
        _SIMULATION,
        *columns_of(AttemptFeatures, only=("frame",)),
        *columns_of(EgoState, "ego", nullable=True),
        *columns_of(LeaderState, "leader", nullable=True),
        *columns_of(LeftLane, "left", nullable=True),
        *columns_of(OncomingState, "oncoming", nullable=True),
        *columns_of(
            RoadAndWeather,
            "surroundings",
            nullable=True,
            dtypes={"lane_width": np.float64, "speed_limit": np.float64},
        ),
        *columns_of(LawMarginsOnPullOut, "law", nullable=True),
        *columns_of(BeliefsAtPullOut, "beliefs", only=("age",), nullable=True),
        *_beliefs(
            prefix="believed_leader_", about="the vehicle ahead", index=PerceivedVehicle.LEADER
        ),
        *_beliefs(
            prefix="believed_new_leader_",
            about="the vehicle ahead on the left",
            index=PerceivedVehicle.NEW_LEADER,
        ),
        *_beliefs(
            prefix="believed_new_follower_",
            about="the vehicle behind on the left",
            index=PerceivedVehicle.NEW_FOLLOWER,
        ),
    ],
    "safety": [
        _SIMULATION,
        _enumeration(
            "moment", "The worst of the manoeuvre, or at an event", MEASURED_MOMENTS, is_key=True
        ),
        computed_column(
            "frame", np.int32, FieldSpec("Frame of the event, or the first of the manoeuvre")
        ),
        *columns_of(SafetyMeasures, nullable=True),
    ],
}

RECORDED_TABLES = tuple(_RECORDED)
"""The tables that hold recordings."""

LABEL_TABLES = tuple(_LABELS)
"""The tables that follow from those of recordings, and can be made from them anew."""

COLUMNS: dict[str, list[Column]] = _RECORDED | _LABELS
"""The columns of each table, by the name of its folder; `KEYS` and `SCHEMAS` follow from them."""

KEYS = {
    table: tuple(one.name for one in columns if one.spec.is_key)
    for table, columns in COLUMNS.items()
}
"""The columns that name a row, in the order by which the table is sorted."""

SCHEMAS: dict[str, pa.Schema] = {
    table: pa.schema(
        [one.arrow_field for one in columns],
        metadata={"schema": f"{FORMAT}.{table}", "version": str(VERSION)},
    )
    for table, columns in COLUMNS.items()
}


def schema_of(table: str, unknown: Collection[str] = (), *, recorded: bool = False) -> pa.Schema:
    """The schema of a table where some things are unknown.

    Args:
        table: Name of one of the `SCHEMAS`.
        unknown: Names of `model.trajectories.UNKNOWNS`.
        recorded: Whether it holds recordings, which have no seed.

    Returns:
        The schema as it is for simulations, with nulls allowed where they are needed.
    """
    silent = {one.name for one in COLUMNS[table] if one.is_silent(unknown)}
    if recorded and table == "simulations":
        silent.add("seed")
    if "bodies" in unknown:  # A recording, which may know the kinds of some vehicles only.
        silent |= {one.name for one in COLUMNS[table] if "kinds" in one.spec.needs}
    schema = SCHEMAS[table]
    if not silent:
        return schema
    fields = [field.with_nullable(field.nullable or field.name in silent) for field in schema]
    return pa.schema(fields, metadata=schema.metadata)


NEVER_NULL = {
    table: frozenset(
        one.name for one in columns if not (one.is_nullable or one.spec.needs or one.name == "seed")
    )
    for table, columns in COLUMNS.items()
}
"""The columns of each table that have a value in every row, in simulations and in recordings."""


def most_rows(num_steps: int, num_frames: int) -> dict[str, int]:
    """Most rows of one simulation in each table.

    Args:
        num_steps: Most steps of the engine in a simulation, each with one decision at most.
        num_frames: Most recorded frames of a simulation.
    """
    return {
        "simulations": 1,
        "weather": 1,
        "vehicles": MAX_VEHICLES,
        "frames": num_frames,
        "states": MAX_VEHICLES * num_frames,
        "percepts": num_steps,
        "actions": num_steps,
        "events": len(names.EVENTS),
        "labels": len(names.POLICY_NAMES),
        "findings": len(names.RULES),
        "features": len(names.READINGS),
        "attempts": 1,
        "safety": len(MEASURED_MOMENTS),
    }


ROWS_OF_EACH = {
    "simulations": 1,
    "weather": 1,
    "labels": len(names.POLICY_NAMES),
    "features": len(names.READINGS),
    "attempts": 1,
}
"""Rows of every simulation, for tables with the same number of rows for each."""
