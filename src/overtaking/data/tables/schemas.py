"""The columns of every table, each declared once, in order; schemas and encoders follow from them.

Keys are the same in all tables: `simulation` is the number of a simulation in its data set,
`vehicle` the slot of a vehicle (the ego is 0), and `frame` counts from 0. Missing values are null,
never a number. States are sorted by simulation, vehicle, frame: frames of a vehicle are adjacent.
"""

from collections.abc import Collection
from functools import partial

import pyarrow as pa

from overtaking.data.tables import names
from overtaking.data.tables.columns import (
    BOOL,
    BYTE,
    DOUBLE,
    FLOAT,
    INT,
    LONG,
    SHORT,
    TEXT,
    ULONG,
    Column,
    attributes,
    column,
    declared,
)
from overtaking.model.overtake_events import NEVER
from overtaking.model.overtake_features import (
    EgoState,
    LawMarginsOnPullOut,
    LeaderState,
    LeftLane,
    OncomingState,
    PaperFeatures,
    RoadAndWeather,
)
from overtaking.model.safety_measures import MEASURED_MOMENTS, SafetyMeasures
from overtaking.model.scenario import MAX_VEHICLES
from overtaking.model.trajectories import NO_VEHICLE, Lights, States
from overtaking.model.vehicles import DriverTraits, VehicleSpecs
from overtaking.model.weather import Weather

FORMAT = "overtaking"
"""First part of the schema name in a file's metadata."""

VERSION = 1
"""Version of all schemas; it rises when a column is added, removed or changes its meaning."""

NUM_INDICATOR_BITS = int(Lights.BRAKE).bit_length() - 1
"""The lowest bits of `Lights` are the indicator's."""

_NOBODY = int(NO_VEHICLE)
_ALONG = ("x", "y", "s", "d")  # The states that come before the lane in the table.
_optional = partial(column, nullable=True)
_key = partial(column, is_key=True)

_SIMULATION = _key("simulation", LONG, "Number of the simulation in its data set")
_VEHICLE = _key("vehicle", BYTE, "Slot of the vehicle in its simulation, 0 is the ego")
_FRAME = _key("frame", INT, "Number of the frame in its simulation")


def _frame(name: str, meaning: str, attribute: str, path: str = "") -> Column:
    """A column of frames, null where the attribute is `NEVER`."""
    return _optional(name, INT, meaning, path=path, present=attribute, nothing=int(NEVER))


def _percept(index: int, who: str, whose: str) -> list[Column]:
    """Columns of one neighbour at a decision: the belief of the ego, and the true values."""
    believed = partial(_optional, present="percepts.is_detected")
    true = partial(_optional, present="percepts.slot", nothing=_NOBODY)
    by_ego = f"as the ego believed it; null unless {who}_is_detected"
    in_truth = "as it was; null if there was none"
    return attributes(
        "percepts",
        true("vehicle", BYTE, f"Slot of {whose}", path="slot"),
        column("is_detected", BOOL, f"Whether the ego had noticed {whose}"),
        believed("gap", INT, f"Bumper gap {by_ego}", "mm"),
        believed("closing_speed", INT, f"Speed of approach {by_ego}", "mm/s"),
        true("true_gap", INT, f"Bumper gap {in_truth}", "mm"),
        true("true_closing_speed", INT, f"Speed of approach {in_truth}", "mm/s"),
        prefix=f"{who}_",
        index=index,
    )


def _believed(index: int, who: str, whose: str) -> list[Column]:
    """Columns of one vehicle: the belief of the driver at the last decision to pull out."""
    seen = partial(_optional, present="beliefs.is_detected")
    return attributes(
        "beliefs",
        _optional(
            "is_detected", BOOL, f"Whether the driver had noticed {whose}", present="beliefs.exists"
        ),
        seen("gap", FLOAT, f"Gap to {whose} as the driver believed it", "m"),
        seen("closing_speed", FLOAT, "Speed of approach as the driver believed it", "m/s"),
        prefix=f"believed_{who}_",
        index=index,
        needs=("percepts",),
    )


_RECORDED: dict[str, list[Column]] = {
    "simulations": [
        _SIMULATION,
        column("seed", ULONG, "Seed of the random numbers"),
        column(
            "scenario_index",
            ULONG,
            "Number from which the scenario was drawn",
            path="scenario.scenario_index",
        ),
        column("profile", TEXT, "Profile from which the scenario was drawn"),
        column("road", TEXT, "Name of the road; the manifest describes it"),
        column("num_vehicles", BYTE, "Number of vehicles, the ego included"),
        column("weather", LONG, "Key of its row in the weather table"),
        column("num_frames", INT, "Number of recorded frames"),
        column("frame_interval", INT, "Time between two frames", "ms"),
        *attributes(
            "scenario",
            column("horizon", FLOAT, "Longest duration", "s"),
            column("attempt_deadline", FLOAT, "Ends here if nothing was attempted", "s"),
            column("weight", DOUBLE, "Sampling weight: natural over sampled probability"),
        ),
        column("trace_hash", pa.binary(16), "128-bit hash over the recorded integers"),
        _optional("source_recording", TEXT, "Recording from which it was imported"),
    ],
    "weather": [
        _key("weather", LONG, "Key; that of the simulation it was drawn for"),
        *attributes(
            "",
            _optional("preset", TEXT, "CARLA preset, null if drawn freely"),
            *declared("scenario.weather", Weather, without=["preset"]),
            column("rain", FLOAT, "Rain rate", "mm/h"),
            column(
                "water_film",
                FLOAT,
                "Water above the texture of the slowest lane, outside puddles",
                "m",
            ),
            column(
                "friction", FLOAT, "Peak friction of a half-worn car tyre at 100 km/h on that film"
            ),
            column("wind", FLOAT, "Mean speed of the wind", "m/s"),
            column("optical_range", FLOAT, "Meteorological optical range of the fog", "m"),
            column(
                "sight_unlit",
                FLOAT,
                "Distance at which a vehicle of contrast 0.5 is seen ahead, light or not",
                "m",
            ),
            column("sight_lit", FLOAT, "Distance at which rear lamps are seen", "m"),
            needs=("weather",),
        ),
    ],
    "vehicles": [
        _SIMULATION,
        _VEHICLE,
        column("role", names.ROLES, "Whether it is the overtaking vehicle under study"),
        *attributes(
            "scenario.vehicles",
            column(
                "kind",
                names.KINDS,
                "Small, medium or large car, van, truck, motorcycle, bicycle",
                needs=["kinds"],
            ),
            column("colour", names.COLOURS, "Colour of the body", needs=["bodies"]),
        ),
        *declared("scenario.vehicles", VehicleSpecs, only=["length", "width"]),
        *declared(
            "scenario.vehicles",
            VehicleSpecs,
            without=["valid", "kind", "colour", "length", "width"],
            needs=["bodies"],
        ),
        *declared("scenario.drivers", DriverTraits, needs=["drivers"]),
        *attributes(
            "scenario",
            column("start_s", FLOAT, "Position along the road before the first step", "m"),
            column("start_lane_id", SHORT, "OpenDRIVE id of the lane it starts in"),
            column("start_speed", FLOAT, "Speed before the first step", "m/s"),
        ),
        *attributes(
            "contacts",
            column("vehicle", BYTE, "Slot it first collided with", path="partner"),
            column("time", INT, "Instant of that contact", "ms"),
            column("impulse", INT, "Impulse of that contact", "N s", needs=["impulse"]),
            column(
                "closing_speed",
                INT,
                "Speed of approach along the contact normal",
                "mm/s",
                needs=["impulse"],
            ),
            prefix="contact_",
            nullable=True,
            present="contacts.partner",
            nothing=_NOBODY,
        ),
    ],
    "frames": [
        _SIMULATION,
        _FRAME,
        column("time", INT, "Time since the first frame", "ms"),
        _optional("lane_id", SHORT, "OpenDRIVE id of the ego's lane"),
        _optional("speed_limit", DOUBLE, "Limit in the ego's lane", "m/s", needs=["speed_limit"]),
        _optional(
            "right_line", names.MARKS, "Line on the right of the ego's lane", needs=["marks"]
        ),
        _optional("left_line", names.MARKS, "Line on the left of the ego's lane", needs=["marks"]),
        _optional("lane_width", DOUBLE, "Width of the ego's lane", "m"),
        _optional("right_lane_id", SHORT, "Lane right of the ego's"),
        _optional("right_lane_width", DOUBLE, "Width of that lane", "m"),
        _optional("left_lane_id", SHORT, "Lane left of the ego's"),
        _optional("left_lane_width", DOUBLE, "Width of that lane", "m"),
        _optional(
            "collided_with",
            BYTE,
            "Slot that the ego has collided with so far",
            present="collided_with",
            nothing=_NOBODY,
        ),
        column(
            "lane_change_begins",
            BOOL,
            "Whether the ego begins to pull out or to return in this frame",
            needs=["stage"],
        ),
        column("stage", names.STAGES, "What the ego is doing, as it sees it", needs=["stage"]),
    ],
    "states": [
        _SIMULATION,
        _VEHICLE,
        _FRAME,
        *declared("states", States, only=_ALONG),
        _optional("lane_id", SHORT, "OpenDRIVE id of its lane"),
        *declared("states", States, without=_ALONG, nullable=False),  # But see `schema_of`.
        column("indicator", names.INDICATORS, "Direction indicator", needs=["indicators"]),
        column(
            "lights", BYTE, "Lights that are on, one bit each", flags=names.FLAGS, needs=["lamps"]
        ),
    ],
    "percepts": [
        _SIMULATION,
        _key("percept", INT, "Number of the percept in its simulation"),
        *attributes(
            "percepts",
            column("kind", names.MANOEUVRE_KINDS, "What was decided"),
            column("time", INT, "Instant of the decision", "ms"),
        ),
        *_percept(0, "leader", "the vehicle ahead"),
        *_percept(1, "new_leader", "the vehicle ahead in the lane that is entered"),
        *_percept(2, "new_follower", "the vehicle behind in the lane that is entered"),
    ],
    "actions": [
        _SIMULATION,
        _key("action", INT, "Number of the decision from which on it holds, 20 a second"),
        column("time", INT, "Instant of that decision", "ms"),
        _optional("move", names.MOVES, "Decision of another driver of the ego"),
        _optional("accel", INT, "Acceleration that it asked for", "mm/s^2"),
        _optional("lane_change", INT, "Wish for a lane: 1 the faster one, -1 the slower one"),
        _optional("wheel_angle", SHORT, "Front wheels, positive to the fast side", "0.1 mrad"),
    ],
}

_LABELS: dict[str, list[Column]] = {
    "events": [
        _SIMULATION,
        _key("event", names.EVENTS, "What happened, see the page on events"),
        column("frame", INT, "First frame in which it is so"),
        column("time", INT, "Time of that frame", "ms"),
        _optional("vehicle", BYTE, "Slot of the vehicle that it is about"),
        _optional("speed_change", FLOAT, "Change of the ego's speed by the first contact", "m/s"),
        _optional("was_intended", BOOL, "Whether the ego's driver meant the attempt, if recorded"),
    ],
    "labels": [
        _SIMULATION,
        _key("policy", names.POLICY_NAMES, "Which rules decide, and what is done in doubt"),
        *attributes(
            "labels",
            column(
                "class", names.CLASSES, "Class of the simulation under that policy", path="classes"
            ),
            column("outcome", names.OUTCOMES, "How it ended, legality aside"),
            column("detail", names.DETAILS, "How it came to that"),
            column(
                "legal_as_far_as_decidable",
                BOOL,
                "Whether no required rule is known to be broken",
                path="is_legal",
            ),
            column("num_broken", BYTE, "Required rules that are broken"),
            column("num_undecidable", BYTE, "Required rules that apply and are undecidable"),
        ),
        column("rule_set", TEXT, "Version of the rules"),
        column("balance_weight", DOUBLE, "Weight that gives back the natural rates"),
    ],
    "findings": [
        _SIMULATION,
        _key("rule", names.RULES, "Code of the rule"),
        *attributes(
            "findings",
            column("verdict", names.VERDICTS, "What it says"),
            _optional(
                "margin",
                FLOAT,
                "Distance from the border of the law in the unit of the rule, negative in a breach",
            ),
            _frame("first_frame", "First frame of the breach", "findings.first", path="first"),
            _frame("last_frame", "Last frame of the breach", "findings.last", path="last"),
            column("article", names.ARTICLES, "Article of the Highway Code"),
            column("severity", names.SEVERITIES, "Severity of the breach"),
            column("belief", names.BELIEFS, "The same judged on what the driver believed"),
        ),
    ],
    "features": [
        _SIMULATION,
        _key("reading", names.READINGS, "The paper's way of measuring, or alike in every class"),
        *declared(
            "",
            PaperFeatures,
            units={"left_occupancy": "%"},
            nullable=["waiting_time", "overtaking_time"],
        ),
        _frame("frame", "Measured in this frame, null for means", "frame"),
    ],
    "attempts": [
        _SIMULATION,
        column("frame", INT, "Frame of the attempt, or of what stands for it"),
        *declared("ego", EgoState, nullable=True),
        *declared("leader", LeaderState, nullable=True),
        *declared("left", LeftLane, nullable=True),
        *declared("oncoming", OncomingState, nullable=True),
        *declared(
            "surroundings",
            RoadAndWeather,
            nullable=True,
            kinds={"lane_width": DOUBLE, "speed_limit": DOUBLE},
        ),
        *declared("law", LawMarginsOnPullOut, nullable=True),
        _optional(
            "believed_age",
            FLOAT,
            "Time since the last decision to pull out",
            "s",
            path="beliefs.age",
            present="beliefs.exists",
            needs=["percepts"],
        ),
        *_believed(0, "leader", "the vehicle ahead"),
        *_believed(1, "new_leader", "the vehicle ahead on the left"),
        *_believed(2, "new_follower", "the vehicle behind on the left"),
    ],
    "safety": [
        _SIMULATION,
        _key("moment", MEASURED_MOMENTS, "The worst of the manoeuvre, or at an event"),
        column("frame", INT, "Frame of the event, or the first of the manoeuvre"),
        *declared("", SafetyMeasures, nullable=True),
    ],
}

RECORDED_TABLES = tuple(_RECORDED)
"""The tables that hold recordings."""

LABEL_TABLES = tuple(_LABELS)
"""The tables that follow from those of recordings, and can be made from them anew."""

COLUMNS: dict[str, list[Column]] = _RECORDED | _LABELS
"""The columns of each table, by the name of its folder; `KEYS` and `SCHEMAS` follow from them."""

KEYS = {
    table: tuple(one.name for one in columns if one.is_key) for table, columns in COLUMNS.items()
}
"""The columns that name a row, in the order by which the table is sorted."""

SCHEMAS: dict[str, pa.Schema] = {
    table: pa.schema(
        [one.field for one in columns],
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
        silent |= {one.name for one in COLUMNS[table] if "kinds" in one.needs}
    schema = SCHEMAS[table]
    if not silent:
        return schema
    fields = [field.with_nullable(field.nullable or field.name in silent) for field in schema]
    return pa.schema(fields, metadata=schema.metadata)


NEVER_NULL = {
    table: frozenset(
        one.name for one in columns if not (one.field.nullable or one.needs or one.name == "seed")
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
