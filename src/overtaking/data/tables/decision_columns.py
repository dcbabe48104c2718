"""The columns of the table `decisions`."""

from overtaking.data.tables.columns import Enumeration
from overtaking.data.tables.measured import BOOL, BYTE, DOUBLE, Measured, encounter, measured
from overtaking.model.vehicles import VehicleKind

KINDS = Enumeration(names=tuple(kind.name for kind in VehicleKind))
INDICATORS = Enumeration(names=("off", "left", "right", "both"))

_AHEAD = "ahead.encounter.valid"
_BELIEVED = (
    ("ahead", "the vehicle ahead"),
    ("front", "the vehicle ahead on the left"),
    ("rear", "the vehicle behind on the left"),
)

_EGO = (
    measured("ego_kind", "ego.kind", "1", "Type of the ego", kind=KINDS, needs=["kinds"]),
    measured("ego_speed", "ego.speed", "m/s", "Its speed"),
    measured("ego_accel", "ego.accel", "m/s^2", "Its acceleration"),
    measured(
        "ego_available_accel",
        "ego.available_accel",
        "m/s^2",
        "Largest acceleration of engine and air at that speed",
        needs=["bodies"],
    ),
    measured(
        "ego_desired_speed",
        "ego.desired_speed",
        "m/s",
        "Speed that its driver wants on a free road",
        needs=["drivers"],
    ),
    measured("waiting_time", "ego.waiting_time", "s", "Time since it closed up"),
    measured(
        "ego_lateral_offset",
        "ego.lateral_offset",
        "m",
        "From the centre of its lane, growing to the left",
        present="around.on_road",
    ),
)

_VEHICLE_AHEAD = (
    *encounter("ahead", "ahead.encounter", "the ego behind the vehicle ahead"),
    measured(
        "ahead_kind",
        "ahead.kind",
        "1",
        "Type of the vehicle ahead",
        kind=KINDS,
        present=_AHEAD,
        needs=["kinds"],
    ),
    measured("ahead_length", "ahead.length", "m", "Its length", present=_AHEAD),
    measured("ahead_speed", "ahead.speed", "m/s", "Its speed", present=_AHEAD),
    measured("ahead_accel", "ahead.accel", "m/s^2", "Its acceleration", present=_AHEAD),
    measured(
        "ahead_lateral_offset",
        "ahead.lateral_offset",
        "m",
        "From the centre of the lane, growing to the left",
        present=_AHEAD,
    ),
    measured(
        "ahead_indicator",
        "ahead.indicator",
        "1",
        "Its indicator",
        kind=INDICATORS,
        present=_AHEAD,
        needs=["indicators"],
    ),
    measured(
        "ahead_looming", "ahead.looming", "rad/s", "Growth of its image in the eye", present=_AHEAD
    ),
    measured(
        "return_gap",
        "ahead.return_gap",
        "m",
        "Gap between it and the next vehicle ahead in the lane",
        present="ahead.has_next",
    ),
    measured(
        "overtaking_time",
        "ahead.overtaking_time",
        "s",
        "Least time to be a reaction distance ahead of it; null if never",
        present=_AHEAD,
        needs=["bodies", "weather"],
    ),
    measured(
        "overtaking_distance",
        "ahead.overtaking_distance",
        "m",
        "Way of the ego in that time",
        present=_AHEAD,
        needs=["bodies", "weather"],
    ),
)

_LEFT = (
    measured("left_exists", "left.exists", "1", "Whether there is a lane to the left", kind=BOOL),
    *encounter("left_front", "left.front", "the ego behind the vehicle ahead on the left"),
    *encounter("left_rear", "left.rear", "the vehicle behind on the left, behind the ego"),
    measured(
        "left_occupancy",
        "left.occupancy",
        "1",
        "Lengths of vehicles in 200 m of the lane to the left, over 200 m",
        present="left.exists",
    ),
    measured("left_count", "left.count", "1", "Vehicles there", kind=BYTE, present="left.exists"),
    measured(
        "left_space_mean_speed",
        "left.space_mean_speed",
        "m/s",
        "Mean of their speeds",
        present="left.count",
    ),
    measured(
        "left_time_mean_speed",
        "left.time_mean_speed",
        "m/s",
        "Mean of the speeds past a place there",
        present="left.count",
    ),
    measured(
        "left_crossable",
        "left.crossable",
        "1",
        "Whether the line on the left may be crossed",
        kind=BOOL,
        present="left.exists",
        needs=["marks"],
    ),
)

_AROUND = (
    measured(
        "lane", "around.lane", "1", "Lane, 0 the slowest", kind=BYTE, present="around.on_road"
    ),
    measured(
        "lanes_to_left",
        "around.lanes_to_left",
        "1",
        "Driving lanes to the left of it",
        kind=BYTE,
        present="around.on_road",
    ),
    measured(
        "lane_width", "around.lane_width", "m", "Its width", kind=DOUBLE, present="around.on_road"
    ),
    measured(
        "speed_limit",
        "around.speed_limit",
        "m/s",
        "Limit as posted",
        kind=DOUBLE,
        needs=["speed_limit"],
    ),
    measured("night", "around.night", "1", "Whether it is night", kind=BOOL, needs=["weather"]),
    measured(
        "low_sun",
        "around.low_sun",
        "1",
        "Whether the sun stands low ahead",
        kind=BOOL,
        needs=["weather"],
    ),
    measured("rain", "around.rain", "mm/h", "Rain rate", needs=["weather"]),
    measured(
        "optical_range",
        "around.optical_range",
        "m",
        "Meteorological optical range",
        needs=["weather"],
    ),
    measured("wind", "around.wind", "m/s", "Mean wind speed", needs=["weather"]),
    measured("friction", "around.friction", "1", "Peak friction under the ego", needs=["weather"]),
    measured(
        "sight_lit",
        "around.sight_lit",
        "m",
        "Distance at which a lit vehicle is seen",
        needs=["weather"],
    ),
    measured(
        "sight_unlit",
        "around.sight_unlit",
        "m",
        "Distance at which an unlit one is seen",
        needs=["weather", "lamps"],
    ),
)

_LAW = (
    measured(
        "law_follow",
        "law.follow",
        "m",
        "L3: gap to the vehicle ahead minus the safe distance",
        present=_AHEAD,
        needs=["weather"],
    ),
    measured(
        "law_entry_front",
        "law.entry_front",
        "m",
        "L4 if the ego moved over now: room to the vehicle ahead on the left",
        present="left.front.valid",
        needs=["weather"],
    ),
    measured(
        "law_entry_rear",
        "law.entry_rear",
        "m",
        "L5 if the ego moved over now: room to the vehicle behind on the left",
        present="left.rear.valid",
        needs=["weather"],
    ),
    measured(
        "law_speed",
        "law.speed",
        "m/s",
        "L12: limit of road and vehicle minus speed",
        needs=["speed_limit", "kinds", "road_kind"],
    ),
    measured(
        "law_stop_lit",
        "law.stop_lit",
        "m",
        "L14: sight of the lit minus stopping distance",
        needs=["weather"],
    ),
    measured(
        "law_stop_unlit",
        "law.stop_unlit",
        "m",
        "L14s: sight of the unlit minus stopping distance",
        needs=["weather", "lamps"],
    ),
)


def _believed(place: int, who: str, name: str) -> tuple[Measured, ...]:
    """What the driver believed of one vehicle."""
    start = f"believed_{who}"
    return (
        measured(
            f"{start}_detected",
            "believed.detected",
            "1",
            f"Whether the driver had noticed {name}",
            kind=BOOL,
            place=place,
            present="believed.exists",
            needs=["percepts"],
        ),
        measured(
            f"{start}_gap",
            "believed.gap",
            "m",
            f"Gap to {name} as the driver believed it",
            place=place,
            present="believed.detected",
            needs=["percepts"],
        ),
        measured(
            f"{start}_closing_speed",
            "believed.closing_speed",
            "m/s",
            "Speed of approach as the driver believed it",
            place=place,
            present="believed.detected",
            needs=["percepts"],
        ),
    )


DECISION_COLUMNS: tuple[Measured, ...] = (
    *_EGO,
    *_VEHICLE_AHEAD,
    *_LEFT,
    *_AROUND,
    *_LAW,
    measured(
        "believed_age",
        "believed.age",
        "s",
        "Time since the last decision to pull out",
        present="believed.exists",
        needs=["percepts"],
    ),
    *(one for place, (who, name) in enumerate(_BELIEVED) for one in _believed(place, who, name)),
)
"""All but the keys and the frame."""
