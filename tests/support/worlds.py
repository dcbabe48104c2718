"""Small worlds written by hand: roads, weather, bodies and drivers with every number known."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from overtaking.knowledge.vehicle_classes import VEHICLE_CLASS_NAMES, vehicle_classes
from overtaking.model.batch import batch_fields
from overtaking.model.known_roads import known_road
from overtaking.model.road import DrivingSide, Lane, Road, RoadMark
from overtaking.model.scenario import SLOT_CAPACITIES, Scenario
from overtaking.model.vehicles import Colour, DriverTraits, VehicleSpecs
from overtaking.model.weather import NO_PRESET, Weather

FOUR_WHEELERS = ("S", "M", "L", "V", "T")

SAME_NAME = (
    "length", "width", "height", "mass", "wheelbase", "cg_height", "front_stiffness",
    "rear_stiffness", "launch_accel", "drag_area", "side_area", "rolling_resistance", "peak_decel",
    "wind_side_coefficient", "wind_centre_ratio", "front_drive_share", "track_width",
    "spray_factor", "lamp_separation",
)  # fmt: skip

CALM_DRIVER: dict[str, float] = dict.fromkeys(batch_fields(DriverTraits), 1.0) | {
    "desired_speed": 30.0, "time_gap": 1.2, "min_gap": 2.0, "accel": 1.5, "decel": 2.0,
    "reaction_time": 0.0, "caution": 0.0, "politeness": 0.2, "lane_change_threshold": 1e9,
    "keep_right_bias": 0.2, "safe_decel": 4.0, "lane_change_duration": 5.0, "min_speed_gain": 1e6,
    "patience": 1e6, "pull_out_ttc": 5.0, "gap_demand_factor": 1.0, "return_time_gap": 1.0,
    "indicator_lead_time": 0.0, "uses_indicator": 1.0, "checks_blind_spot": 1.0,
    "speed_limit_compliance": 0.0, "passing_time_factor": 0.85,
}  # fmt: skip
"""A driver who stays in lane and never overtakes, unless told otherwise."""

CLEAR: dict[str, float] = {
    "preset": float(NO_PRESET), "cloudiness": 0.0, "rain": 0.0, "puddles": 0.0, "wind": 0.0,
    "wind_direction": 0.0, "fog": 0.0, "sun_altitude": 1.0, "sun_azimuth": 1.0, "night": 0.0,
    "low_sun": 0.0,
}  # fmt: skip
"""Noon without cloud, wind or water."""


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """One vehicle of a hand-made scenario: the middle values of its class, or what differs."""

    kind: str = "M"
    s: float = 0.0
    lane: int = 0
    speed: float = 25.0
    body: dict[str, float] = field(default_factory=dict)
    driver: dict[str, float] = field(default_factory=dict)


def body_of(kind: str, **changes: float) -> dict[str, float]:
    """The middle values of a class, as `VehicleSpecs` names them."""
    one = vehicle_classes()[kind]
    body = {name: float(getattr(one, name).number) for name in SAME_NAME}
    front = one.cg_to_front_ratio.number * one.wheelbase.number
    body |= {
        "valid": 1.0,
        "kind": float(VEHICLE_CLASS_NAMES.index(kind)),
        "colour": float(Colour.GREY),
        "cg_to_front": front,
        "yaw_inertia": one.inertia_factor.number
        * body["mass"]
        * front
        * (body["wheelbase"] - front),
        "power": one.specific_power.number * body["mass"],
        "max_speed": float(one.governed_speed.number),
        "tyre_wear": 0.0,
        "contrast": 0.8,
        "two_wheeler": float(one.two_wheeler),
        "unlawful_presence": 0.0,
    }
    return body | changes


def scenario(
    *simulations: list[Vehicle],
    road: Road | None = None,
    weather: dict[str, float] | list[dict[str, float]] | None = None,
    horizon: float = 20.0,
    attempt_deadline: float = 1e4,
    frame_interval_ms: int = 50,
    seed: int = 1,
    index: list[int] | None = None,
    num_slots: int = SLOT_CAPACITIES[0],
) -> Scenario:
    """A batch, one list of vehicles a simulation, the ego first.

    Args:
        simulations: Vehicles of each simulation.
        road: `town06`, extended to 10 km, by default.
        weather: Differences from `CLEAR`, the same for all simulations or one for each.
        horizon: Duration [s].
        attempt_deadline: See `Scenario` [s].
        frame_interval_ms: See `Scenario` [ms].
        seed: See `Scenario`.
        index: Numbers of the simulations; 0, 1, 2 ... by default.
        num_slots: Slots, filled or not.
    """
    batch = len(simulations)
    skies = weather if isinstance(weather, list) else [weather or {}] * batch
    rows = [[*one, *[None] * (num_slots - len(one))] for one in simulations]
    bodies = [
        [body_of(v.kind) | v.body if v else body_of("M", valid=0.0) for v in row] for row in rows
    ]
    people = [[CALM_DRIVER | (v.driver if v else {}) for v in row] for row in rows]
    start = {
        name: np.array([[getattr(v, name) if v else 0.0 for v in row] for row in rows])
        for name in ("s", "lane", "speed")
    }
    return Scenario(
        profile="by hand",
        road=road or known_road("town06").extend_to(10_000.0),
        seed=seed,
        frame_interval_ms=frame_interval_ms,
        scenario_index=np.array(index if index is not None else range(batch), np.uint64),
        horizon=np.full(batch, horizon, np.float32),
        attempt_deadline=np.full(batch, attempt_deadline, np.float32),
        weight=np.ones(batch),
        vehicles=_filled(VehicleSpecs, bodies),
        drivers=_filled(DriverTraits, people),
        weather=_filled(Weather, [CLEAR | sky for sky in skies]),
        start_s=start["s"].astype(np.float32),
        start_lane=start["lane"].astype(np.uint8),
        start_speed=start["speed"].astype(np.float32),
    )


def wide_road(*, lanes: int = 3, width: float = 3.5, limit: float = 50.0) -> Road:
    """A straight road along x, lanes of equal width, right-hand traffic."""
    marks = {"right_mark": RoadMark.BROKEN, "left_mark": RoadMark.BROKEN}
    return Road(
        name="by hand",
        kind="motorway",
        driving_side=DrivingSide.RIGHT,
        lanes=tuple(Lane(lane_id=k - lanes, width=width, **marks) for k in range(lanes)),
        kerb_edge_d=-lanes * width,
        length=20_000.0,
        x0=0.0,
        y0=0.0,
        heading=0.0,
        speed_limit=limit,
    )


def _filled(cls: type, rows: Any) -> Any:
    """A batch whose fields are taken by name from nested lists of dictionaries."""
    columns = {}
    for each in dataclasses.fields(cls):
        values = np.array(_picked(rows, each.name), np.float64)
        columns[each.name] = values.astype(_type_of(str(each.type)))
    return cls(**columns)


def _picked(rows: Any, name: str) -> Any:
    """The value called `name` of every dictionary in nested lists."""
    return [_picked(row, name) for row in rows] if isinstance(rows, list) else rows[name]


def _type_of(annotation: str) -> type[np.generic]:
    if "Mask" in annotation or "bool" in annotation:
        return np.bool_
    return np.uint8 if "uint8" in annotation else np.float32
