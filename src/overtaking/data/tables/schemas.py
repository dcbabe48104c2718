"""The columns of every table: names, types, units, meanings and versions.

Keys are the same everywhere: `simulation` is the number of a simulation in its data set, `vehicle`
the slot of a vehicle in its simulation (the ego is 0) and `frame` counts from 0. What does not
exist is null, never a number that stands for it. States are sorted by simulation, vehicle and
frame, so that the frames of one vehicle are adjacent.
"""

import pyarrow as pa

from overtaking.data.tables.columns import SUFFIXES, Enumeration, column
from overtaking.data.tables.label_schemas import LABEL_FIELDS, LABEL_KEYS
from overtaking.model.road import RoadMark
from overtaking.model.trajectory import DecisionKind, Lights, Stage
from overtaking.model.vehicles import Colour, VehicleKind

FORMAT = "overtaking"
"""What the name of a schema in a file's metadata begins with."""

VERSION = 2
"""Version of all schemas below; raised when a column is added, removed or changes its meaning."""

ROLES = Enumeration(names=("ego", "other"))
KINDS = Enumeration(names=tuple(kind.name for kind in VehicleKind))
COLOURS = Enumeration(names=tuple(colour.name.lower() for colour in Colour))
MARKS = Enumeration(names=tuple(mark.value for mark in RoadMark))
STAGES = Enumeration(names=tuple(stage.name for stage in Stage))
DECISIONS = Enumeration(names=tuple(kind.name for kind in DecisionKind))
INDICATORS = Enumeration(names=("off", "left", "right", "both"))
"""In the order of the two indicator bits of `Lights`."""

FLAGS = ("brake", "low_beam", "high_beam", "rear_fog")
"""The bits of the `lights` column: those of `Lights` above the two of the indicator."""

NEIGHBOURS = ("leader", "front", "rear")
"""Whom a percept is about: the vehicle ahead, and in the target lane those ahead and behind."""

_BODY = (
    ("length", "m", "Bumper to bumper"),
    ("width", "m", "Body without mirrors"),
    ("height", "m", "Height"),
    ("mass", "kg", "With driver and load"),
    ("wheelbase", "m", "Distance of the axles"),
    ("cg_to_front", "m", "Centre of gravity to front axle"),
    ("cg_height", "m", "Height of the centre of gravity"),
    ("yaw_inertia", "kg m^2", "About the vertical axis"),
    ("front_stiffness", "1/rad", "Cornering stiffness of the front axle per axle load"),
    ("rear_stiffness", "1/rad", "Cornering stiffness of the rear axle per axle load"),
    ("launch_accel", "m/s^2", "Largest acceleration at low speed"),
    ("power", "W", "Power at the wheels"),
    ("drag_area", "m^2", "Drag coefficient times frontal area"),
    ("side_area", "m^2", "Side area exposed to wind"),
    ("rolling_resistance", "1", "Rolling force per weight"),
    ("max_speed", "m/s", "Governor or top speed"),
    ("peak_decel", "m/s^2", "Strongest braking that the brakes allow, positive"),
    ("wind_side_coefficient", "1", "Side force coefficient on the side area"),
    ("wind_centre_ratio", "1", "Centre of wind pressure ahead of mid-wheelbase, per wheelbase"),
    ("front_drive_share", "1", "Share of the drive force at the front axle"),
    ("tyre_wear", "1", "Tread wear, 0 new to 1 worn"),
    ("track_width", "m", "Distance of left and right wheels"),
    ("spray_factor", "1", "Spray behind it relative to a car"),
    ("lamp_separation", "m", "Distance of its rear lamps"),
    ("contrast", "1", "Luminance contrast of its colour against the background by day"),
    ("two_wheeler", "", "Moves as a point mass"),
    ("unlawful_presence", "", "May not be on a motorway at all"),
)
_DERIVED = (
    ("rain", "mm/h", "Rain rate"),
    ("water_film", "m", "Water above the texture of the slowest lane, outside puddles"),
    ("friction", "1", "Peak friction of a half-worn car tyre at 100 km/h on that film"),
    ("wind", "m/s", "Mean speed of the wind"),
    ("optical_range", "m", "Meteorological optical range of the fog"),
    ("sight_unlit", "m", "Distance at which a vehicle of contrast 0.5 is seen ahead, light or not"),
    ("sight_lit", "m", "Distance at which rear lamps are seen"),
)
_DRIVER = (
    ("desired_speed", "m/s", "Speed wanted on a free road in good weather"),
    ("time_gap", "s", "Net time gap wanted behind a leader"),
    ("min_gap", "m", "Gap wanted at standstill"),
    ("accel", "m/s^2", "Everyday acceleration"),
    ("decel", "m/s^2", "Comfortable deceleration, positive"),
    ("reaction_time", "s", "From seeing to acting, good conditions"),
    ("caution", "1", "How far speed follows sight and grip, 0 not at all to 1 fully"),
    ("politeness", "1", "Politeness of the lane-change model MOBIL"),
    ("lane_change_threshold", "m/s^2", "Threshold of the lane-change model MOBIL"),
    ("right_bias", "m/s^2", "Bias of the lane-change model MOBIL towards the slow side"),
    ("safe_decel", "m/s^2", "Largest braking imposed on a new follower, positive"),
    ("lane_change_duration", "s", "Time from lane centre to lane centre"),
    ("passing_gain", "m/s", "Speed wanted above the leader's before overtaking is worth it"),
    ("patience", "s", "Time of waiting over which demands fall by a factor e"),
    (
        "pull_out_time",
        "s",
        "Time to collision with the leader at which a flying overtake pulls out",
    ),
    ("gap_acceptance", "1", "Factor on the gaps and times demanded of the target lane"),
    ("return_time_gap", "s", "Net time gap left to the overtaken vehicle before returning"),
    ("signal_time", "s", "How long the indicator is on before moving over"),
    ("uses_indicator", "", "Whether the indicator is used at all"),
    ("checks_blind_spot", "", "Whether what drives alongside is looked for"),
    ("limit_respect", "1", "Share of the speed above the limit that is given up"),
)

_SIMULATION = column("simulation", pa.int64(), "1", "Number of the simulation in its data set")
_VEHICLE = column("vehicle", pa.uint8(), "1", "Slot of the vehicle in its simulation, 0 is the ego")
_FRAME = column("frame", pa.int32(), "1", "Number of the frame in its simulation")


def _attributes(rows: tuple[tuple[str, str, str], ...]) -> list[pa.Field]:
    """Columns of float32, or of yes and no where the unit is empty."""
    return [
        column(name + SUFFIXES[unit], pa.float32(), unit, text)
        if unit
        else column(name, pa.bool_(), "1", text)
        for name, unit, text in rows
    ]


def _percept(who: str, whose: str) -> list[pa.Field]:
    """What the ego believed of one neighbour, and the truth beside it."""
    believed = f"as the ego believed it; null unless {who}_detected"
    true = "as it was; null if there was none"
    return [
        column(f"{who}_vehicle", pa.uint8(), "1", f"Slot of {whose}", nullable=True),
        column(f"{who}_detected", pa.bool_(), "1", f"Whether the ego had noticed {whose}"),
        column(f"{who}_gap_mm", pa.int32(), "mm", f"Bumper gap {believed}", nullable=True),
        column(
            f"{who}_closing_speed_mmps",
            pa.int32(),
            "mm/s",
            f"Speed of approach {believed}",
            nullable=True,
        ),
        column(f"{who}_true_gap_mm", pa.int32(), "mm", f"Bumper gap {true}", nullable=True),
        column(
            f"{who}_true_closing_speed_mmps",
            pa.int32(),
            "mm/s",
            f"Speed of approach {true}",
            nullable=True,
        ),
    ]


def _schema(table: str, fields: list[pa.Field]) -> pa.Schema:
    return pa.schema(fields, metadata={"schema": f"{FORMAT}.{table}", "version": str(VERSION)})


SIMULATIONS = _schema(
    "simulations",
    [
        _SIMULATION,
        column("seed", pa.uint64(), "1", "Seed of the random numbers"),
        column("index", pa.uint64(), "1", "Number from which the scenario was drawn"),
        column("profile", pa.string(), "1", "Profile from which the scenario was drawn"),
        column("road", pa.string(), "1", "Name of the road; the manifest describes it"),
        column("num_vehicles", pa.uint8(), "1", "Number of vehicles, the ego included"),
        column("weather", pa.int64(), "1", "Key of its row in the weather table"),
        column("num_frames", pa.int32(), "1", "Number of recorded frames"),
        column("frame_interval_ms", pa.int32(), "ms", "Time between two frames"),
        column("horizon_s", pa.float32(), "s", "Longest duration"),
        column("attempt_deadline_s", pa.float32(), "s", "Ends here if nothing was attempted"),
        column("weight", pa.float64(), "1", "Sampling weight: natural over sampled probability"),
        column("trace_hash", pa.binary(16), "1", "128-bit hash over the recorded integers"),
        column(
            "source_recording",
            pa.string(),
            "1",
            "Recording from which it was imported",
            nullable=True,
        ),
    ],
)

WEATHER = _schema(
    "weather",
    [
        column("weather", pa.int64(), "1", "Key; that of the simulation it was drawn for"),
        column("preset", pa.string(), "1", "CARLA preset, null if drawn freely", nullable=True),
        column("cloudiness_percent", pa.float32(), "%", "CARLA's cloudiness"),
        column("rain_percent", pa.float32(), "%", "CARLA's precipitation"),
        column("puddles_percent", pa.float32(), "%", "CARLA's precipitation deposits"),
        column("wind_percent", pa.float32(), "%", "CARLA's wind intensity"),
        column(
            "wind_direction_rad",
            pa.float32(),
            "rad",
            "Where the wind blows to, anticlockwise from the direction of travel",
        ),
        column("fog_percent", pa.float32(), "%", "CARLA's fog density"),
        column("sun_altitude_rad", pa.float32(), "rad", "Height of the sun above the horizon"),
        column(
            "sun_azimuth_rad", pa.float32(), "rad", "Anticlockwise from the direction of travel"
        ),
        column("night", pa.bool_(), "1", "Whether it is night"),
        column("horizon_line", pa.bool_(), "1", "Whether the sun stands low ahead"),
        *_attributes(_DERIVED),
    ],
)

VEHICLES = _schema(
    "vehicles",
    [
        _SIMULATION,
        _VEHICLE,
        column("role", ROLES, "1", "Whether it is the overtaking vehicle under study"),
        column("kind", KINDS, "1", "Small, medium or large car, van, truck, motorcycle, bicycle"),
        column("colour", COLOURS, "1", "Colour of the body"),
        *_attributes(_BODY),
        *_attributes(_DRIVER),
        column("start_s_m", pa.float32(), "m", "Position along the road before the first step"),
        column("start_lane_id", pa.int16(), "1", "OpenDRIVE id of the lane it starts in"),
        column("start_speed_mps", pa.float32(), "m/s", "Speed before the first step"),
        column("contact_vehicle", pa.uint8(), "1", "Slot it first collided with", nullable=True),
        column("contact_time_ms", pa.int32(), "ms", "Instant of that contact", nullable=True),
        column(
            "contact_impulse_newton_s", pa.int32(), "N s", "Impulse of that contact", nullable=True
        ),
        column(
            "contact_closing_speed_mmps",
            pa.int32(),
            "mm/s",
            "Speed of approach along the contact normal",
            nullable=True,
        ),
    ],
)

FRAMES = _schema(
    "frames",
    [
        _SIMULATION,
        _FRAME,
        column("time_ms", pa.int32(), "ms", "Time since the first frame"),
        column("lane_id", pa.int16(), "1", "OpenDRIVE id of the ego's lane", nullable=True),
        column("speed_limit_mps", pa.float64(), "m/s", "Limit in the ego's lane", nullable=True),
        column("right_line", MARKS, "1", "Line on the right of the ego's lane", nullable=True),
        column("left_line", MARKS, "1", "Line on the left of the ego's lane", nullable=True),
        column("lane_width_m", pa.float64(), "m", "Width of the ego's lane", nullable=True),
        column("right_lane_id", pa.int16(), "1", "Lane right of the ego's", nullable=True),
        column("right_lane_width_m", pa.float64(), "m", "Width of that lane", nullable=True),
        column("left_lane_id", pa.int16(), "1", "Lane left of the ego's", nullable=True),
        column("left_lane_width_m", pa.float64(), "m", "Width of that lane", nullable=True),
        column(
            "collided_with",
            pa.uint8(),
            "1",
            "Slot that the ego has collided with so far",
            nullable=True,
        ),
        column(
            "overtaking",
            pa.bool_(),
            "1",
            "Whether the ego begins to pull out or to return in this frame",
        ),
        column("stage", STAGES, "1", "What the ego is doing, as it sees it"),
    ],
)

STATES = _schema(
    "states",
    [
        _SIMULATION,
        _VEHICLE,
        _FRAME,
        column("x_mm", pa.int32(), "mm", "OpenDRIVE x of the bounding-box centre"),
        column("y_mm", pa.int32(), "mm", "OpenDRIVE y of the bounding-box centre, right-handed"),
        column("s_mm", pa.int32(), "mm", "Position along the road"),
        column("d_mm", pa.int32(), "mm", "Position across the road, positive to the left"),
        column("lane_id", pa.int16(), "1", "OpenDRIVE id of its lane", nullable=True),
        column("speed_mmps", pa.int32(), "mm/s", "Speed, never negative"),
        column("heading_100urad", pa.int16(), "0.1 mrad", "Heading, anticlockwise from world x"),
        column("wheel_angle_100urad", pa.int16(), "0.1 mrad", "Front wheels, positive to the left"),
        column("accel_lon_mmps2", pa.int16(), "mm/s^2", "Acceleration forwards, contacts excluded"),
        column("accel_lat_mmps2", pa.int16(), "mm/s^2", "Acceleration to the left"),
        column("yaw_rate_100uradps", pa.int16(), "0.1 mrad/s", "Turning rate, anticlockwise"),
        column("indicator", INDICATORS, "1", "Direction indicator"),
        column("lights", pa.uint8(), "1", "Lights that are on, one bit each", flags=FLAGS),
    ],
)

PERCEPTS = _schema(
    "percepts",
    [
        _SIMULATION,
        column("decision", pa.int32(), "1", "Number of the decision in its simulation"),
        column("kind", DECISIONS, "1", "What was decided"),
        column("time_ms", pa.int32(), "ms", "Instant of the decision"),
        *_percept("leader", "the vehicle ahead"),
        *_percept("front", "the vehicle ahead in the target lane"),
        *_percept("rear", "the vehicle behind in the target lane"),
    ],
)

_RECORDED: dict[str, pa.Schema] = {
    "simulations": SIMULATIONS,
    "weather": WEATHER,
    "vehicles": VEHICLES,
    "frames": FRAMES,
    "states": STATES,
    "percepts": PERCEPTS,
}

RECORDED_TABLES = tuple(_RECORDED)
"""The tables that hold recordings; the others, `LABEL_TABLES`, follow from them."""

SCHEMAS: dict[str, pa.Schema] = _RECORDED | {
    table: _schema(table, fields) for table, fields in LABEL_FIELDS.items()
}
"""Every table by the name of its folder."""

KEYS: dict[str, tuple[str, ...]] = {
    "simulations": ("simulation",),
    "weather": ("weather",),
    "vehicles": ("simulation", "vehicle"),
    "frames": ("simulation", "frame"),
    "states": ("simulation", "vehicle", "frame"),
    "percepts": ("simulation", "decision"),
    **LABEL_KEYS,
}
"""The columns that name a row, in the order by which the table is sorted."""

BODY_FIELDS = tuple((name, name + SUFFIXES.get(unit, "")) for name, unit, _ in _BODY)
"""Attributes of `VehicleSpecs` with the columns that hold them."""

DRIVER_FIELDS = tuple((name, name + SUFFIXES.get(unit, "")) for name, unit, _ in _DRIVER)
"""Attributes of `Drivers` with the columns that hold them."""

WEATHER_FIELDS = (
    ("cloudiness", "cloudiness_percent"),
    ("rain", "rain_percent"),
    ("puddles", "puddles_percent"),
    ("wind", "wind_percent"),
    ("wind_direction", "wind_direction_rad"),
    ("fog", "fog_percent"),
    ("sun_altitude", "sun_altitude_rad"),
    ("sun_azimuth", "sun_azimuth_rad"),
    ("night", "night"),
    ("horizon_line", "horizon_line"),
)
"""Attributes of `Weather` with the columns that hold them."""

STATE_FIELDS = (
    ("x", "x_mm"),
    ("y", "y_mm"),
    ("s", "s_mm"),
    ("d", "d_mm"),
    ("speed", "speed_mmps"),
    ("heading", "heading_100urad"),
    ("wheel_angle", "wheel_angle_100urad"),
    ("accel_lon", "accel_lon_mmps2"),
    ("accel_lat", "accel_lat_mmps2"),
    ("yaw_rate", "yaw_rate_100uradps"),
)
"""Attributes of `States` that are stored as they are, with the columns that hold them."""

NUM_INDICATOR_BITS = int(Lights.BRAKE).bit_length() - 1
"""The lowest bits of `Lights` are the indicator's."""
