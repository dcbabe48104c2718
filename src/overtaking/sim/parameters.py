"""From a scenario to the numbers that the step needs, computed once for reference and engine.

What does not change during a simulation is worked out here: forces per unit, extinction, the speed
that a driver thinks right for the sight and the grip. Inside the simulation the lateral axis points
towards the fast side, so that left-hand traffic is the mirror image of right-hand traffic.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, as_f32, exp, log, maximum, minimum, sincos
from overtaking.core.philox import Draws, Stream
from overtaking.knowledge import quantities
from overtaking.model.road import MAX_LANES, DrivingSide, Road
from overtaking.model.scenario import Scenario
from overtaking.model.trajectory import Lights
from overtaking.model.vehicles import VehicleKind
from overtaking.physics import film, friction, visibility
from overtaking.physics.constants import Constants, constants

SUBSTEPS = 5
"""Steps between two decisions."""

VEHICLE_FIELDS = (
    "valid",
    "half_length",
    "half_width",
    "tall",
    "mass",
    "inverse_mass",
    "inverse_inertia",
    "cg_front",
    "cg_rear",
    "inverse_wheelbase",
    "wheelbase",
    "cg_height",
    "front_stiffness",
    "rear_stiffness",
    "launch_force",
    "power",
    "drag",
    "rolling",
    "max_speed",
    "brake_force",
    "front_drive",
    "half_track",
    "understeer",
    "moment_angle",
    "two_wheeler",
    "side_wind",
    "wind_centre",
    "wind_arm",
    "wear",
    "truck",
    "shelters",
    "spray",
    "loom_width",
    "contrast",
    "inverse_tail_lamp",
    "inverse_head_lamp",
    "lights",
    "desired_speed",
    "pass_speed",
    "time_gap",
    "min_gap",
    "accel",
    "decel",
    "interaction",
    "overspeed_exponent",
    "hardest_decel",
    "reaction_ticks",
    "politeness",
    "threshold",
    "bias",
    "safe_decel",
    "lane_change_duration",
    "passing_gain",
    "inverse_patience",
    "pull_out_time",
    "gap_acceptance",
    "return_time_gap",
    "signal_time",
    "uses_indicator",
    "checks_blind_spot",
    "start_s",
    "start_d",
    "start_speed",
    "start_lane",
)
"""Per-vehicle parameters, in the order in which the engine receives them."""

SIMULATION_FIELDS = (
    "last_step",
    "deadline_step",
    "fog_extinction",
    "rain_extinction",
    "sight_front",
    "sight_rear",
    "lamp_threshold",
    "inverse_lit_range",
    "detection_time",
    "distance_error",
    "speed_error",
    "wind_along",
    "wind_across",
    "gust_gain",
    "gust_phase",
    "gust_length",
    "least_film",
    "film_rain",
    "texture",
    "puddle_reach",
    "puddle_film",
    "puddle_phase_1",
    "puddle_phase_2",
    "side_accel",
    "command",
)
"""Per-simulation parameters, in the order in which the engine receives them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effects:
    """Which effects of the world are switched on; all of them, except in ablations."""

    film: bool = True
    gusts: bool = True
    wake: bool = True
    range: bool = True
    delay: bool = True
    distance_error: bool = True
    looming: bool = True
    occlusion: bool = True
    mobil: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadParameters:
    """The road as the step sees it, lateral axis towards the fast side.

    Attributes:
        num_lanes: Driving lanes.
        boundaries: Lane borders from slow to fast, padded with the last, shape (MAX_LANES + 1,) [m].
        film_path: `film.film_per_path` of each lane, padded, shape (MAX_LANES,).
        side: +1 in right-hand traffic, -1 in left-hand traffic.
        x0: World x of the road's origin [m].
        y0: World y [m].
        heading: Direction of travel [rad].
        cosine: Of the heading.
        sine: Of the heading.
    """

    num_lanes: int
    boundaries: F32
    film_path: F32
    side: np.float32
    x0: np.float32
    y0: np.float32
    heading: np.float32
    cosine: np.float32
    sine: np.float32


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters:
    """All inputs of a batch.

    Attributes:
        vehicle: Shape (field, vehicle, simulation), fields as `VEHICLE_FIELDS`.
        simulation: Shape (field, simulation), fields as `SIMULATION_FIELDS`.
        road: The road.
        constants: The constants.
        seed: Key of the random numbers.
        index: Simulation numbers, shape (simulation,).
        record_every: Steps between recorded frames.
    """

    vehicle: F32
    simulation: F32
    road: RoadParameters
    constants: Constants
    seed: int
    index: NDArray[np.uint64]
    record_every: int

    @property
    def num_frames(self) -> int:
        """Frames of the longest simulation that these parameters allow."""
        last = self.simulation[SIMULATION_FIELDS.index("last_step")]
        return int(last.max()) // self.record_every + 1 if last.size else 0


def road_parameters(road: Road) -> RoadParameters:
    """The road as the step sees it."""
    side = np.float32(1.0 if road.driving_side is DrivingSide.RIGHT else -1.0)
    borders = side * as_f32(road.boundaries)
    padded = np.concatenate(
        [borders, np.full(MAX_LANES + 1 - len(borders), borders[-1], np.float32)]
    )
    path = np.maximum(borders[-1] - (padded[1:] + padded[:-1]) * np.float32(0.5), np.float32(0.5))
    heading = np.float32(road.heading)
    sine, cosine = sincos(heading)
    return RoadParameters(
        num_lanes=road.num_lanes,
        boundaries=padded,
        film_path=film.film_per_path(path),
        side=side,
        x0=np.float32(road.x0),
        y0=np.float32(road.y0),
        heading=heading,
        cosine=np.float32(cosine),
        sine=np.float32(sine),
    )


def parameters(scenario: Scenario, effects: Effects | None = None) -> Parameters:
    """Work out everything that the step needs.

    Args:
        scenario: A batch of scenarios.
        effects: Ablations; None for the model as published.
    """
    effects = effects or Effects()
    c = _ablated(constants(), effects)
    world = _world(scenario, c, effects)
    bodies = _bodies(scenario, c, world, effects)
    people = _people(scenario, c, world, effects)
    vehicle = np.stack(
        [np.ascontiguousarray(as_f32((bodies | people)[name]).T) for name in VEHICLE_FIELDS]
    )
    return Parameters(
        vehicle=vehicle,
        simulation=np.stack([as_f32(world[name]) for name in SIMULATION_FIELDS]),
        road=road_parameters(scenario.road),
        constants=c,
        seed=scenario.seed,
        index=np.ascontiguousarray(scenario.index),
        record_every=scenario.frame_interval_ms // 10,
    )


def with_command(given: Parameters, command: int) -> Parameters:
    """The same parameters with a decision forced on every ego (see `sim.branch`)."""
    simulation = given.simulation.copy()
    simulation[SIMULATION_FIELDS.index("command")] = command
    return replace(given, simulation=simulation)


def _ablated(c: Constants, effects: Effects) -> Constants:
    changes: dict[str, float] = {}
    if not effects.gusts:
        changes["turbulence_intensity"] = 0.0
    if not effects.wake:
        changes["shelter_factor"] = 1.0
    if not effects.looming:
        changes["looming_threshold"] = 0.0
    if not effects.delay:
        changes["detection_growth"] = 0.0
    if not effects.range:
        changes |= {"sight_range": 1e6, "mirror_range": 1e6}
    return c.replace(**changes) if changes else c


def _number(file: str, name: str) -> np.float32:
    return np.float32(quantities(f"{file}.toml")[name].number)  # type: ignore[union-attr]


def _world(scenario: Scenario, c: Constants, effects: Effects) -> dict[str, F32]:
    weather = scenario.weather
    zero = np.zeros(scenario.num_simulations, np.float32)
    rate = film.rain_rate(weather.rain)
    rate_on_road = rate if effects.film else zero
    puddles = weather.puddles if effects.film else zero
    wet = (rate_on_road > 0) | (puddles >= _number("weather", "film.wet_deposits_percent"))
    least = np.where(wet, _number("weather", "film.wet_film_mm"), np.float32(0.0))
    from_percent = _number("weather", "puddles.from_percent")
    deep = maximum(puddles - from_percent, zero) / (np.float32(100.0) - from_percent)
    dusk = ~weather.night & (weather.sun_altitude < np.float32(0.0))
    fields = Draws(scenario.seed, scenario.index, Stream.FIELD)
    sine, cosine = sincos(weather.wind_direction)
    speed = _number("weather", "wind.full_speed") * (weather.wind * np.float32(0.01))
    side = road_parameters(scenario.road).side
    gusty = (weather.wind >= _number("weather", "gusts.from_percent")) & effects.gusts
    ratio = (
        float(_number("weather", "gusts.smallest_ratio")),
        float(_number("weather", "gusts.largest_ratio")),
    )
    length = (
        float(_number("weather", "gusts.shortest")),
        float(_number("weather", "gusts.longest")),
    )
    world = {
        "last_step": np.rint(scenario.horizon * np.float32(100.0)),
        "deadline_step": np.rint(scenario.attempt_deadline * np.float32(100.0)),
        "wind_along": speed * cosine,
        "wind_across": side * speed * sine,
        "gust_gain": np.where(gusty, fields.uniform(*ratio), np.float32(0.0)),
        "gust_phase": fields.uniform(),
        "gust_length": fields.uniform(*length),
        "puddle_phase_1": fields.uniform(),
        "puddle_phase_2": fields.uniform(),
        "least_film": least,
        "film_rain": film.film_per_rain(rate_on_road),
        "texture": zero + _number("weather", "film.texture_depth_mm"),
        "puddle_reach": np.sqrt(
            np.float32(0.02) * _number("weather", "puddles.full_cover") * puddles
        ),
        "puddle_film": _number("weather", "puddles.max_film_mm") * deep,
        "command": zero,
        "detection_time": np.where(weather.night, np.float32(0.6), np.float32(0.4)),
    }
    world |= _sight(scenario, rate, dusk, effects)
    world["grip"] = _believed_grip(c, world)
    world["side_accel"] = minimum(
        zero + _number("model", "steering.comfort_accel"),
        _number("model", "steering.grip_share") * c.gravity * world["grip"],
    )
    world["rate"] = rate
    if not effects.delay:
        world["detection_time"] = zero
    return world


def _sight(
    scenario: Scenario, rate: F32, dusk: NDArray[np.bool_], effects: Effects
) -> dict[str, F32]:
    weather = scenario.weather
    zero = np.zeros(scenario.num_simulations, np.float32)
    threshold = visibility.contrast_threshold(weather.night, dusk, rate)
    turned = np.abs(weather.sun_azimuth)
    ahead = visibility.glare_factor(weather.sun_altitude, turned, weather.cloudiness)
    behind = visibility.glare_factor(
        weather.sun_altitude, np.abs(np.float32(3.141_592_7) - turned), weather.cloudiness
    )
    foggy = visibility.meteorological_range(weather.fog) < np.float32(1000.0)
    clear = np.where(
        weather.night,
        _number("weather", "errors.distance_cv_night"),
        _number("weather", "errors.distance_cv_day"),
    )
    wet = rate > 0
    lit = _number("weather", "headlamps.low_beam") * np.where(
        wet, _number("weather", "headlamps.wet_factor"), np.float32(1.0)
    )
    on = np.float32(1.0 if effects.range else 0.0)
    error = np.where(foggy, _number("weather", "errors.distance_cv_fog"), clear)
    return {
        "fog_extinction": on * visibility.fog_extinction(weather.fog),
        "rain_extinction": on * visibility.rain_extinction(rate),
        "sight_front": log(ahead / threshold),
        "sight_rear": log(behind / threshold),
        "lamp_threshold": on * visibility.lamp_threshold(weather.night, dusk),
        "inverse_lit_range": np.where(weather.night, on / lit, zero),
        "distance_error": error if effects.distance_error else zero,
        "speed_error": zero + _number("weather", "errors.closing_speed_cv"),
    }


def _believed_grip(c: Constants, world: dict[str, F32]) -> F32:
    """What a driver takes the friction for: that of a half-worn tyre at 90 km/h outside puddles."""
    h = maximum(world["least_film"], world["film_rain"] * np.float32(2.0) - world["texture"])
    zero = np.zeros_like(h)
    return friction.peak_friction(c, zero + np.float32(25.0), h, zero + np.float32(0.5), zero)


def _bodies(
    scenario: Scenario, c: Constants, world: dict[str, F32], effects: Effects
) -> dict[str, F32]:
    v, weather = scenario.vehicles, scenario.weather
    per_sim = lambda value: value[:, None]  # noqa: E731
    truck = (v.kind == VehicleKind.T).astype(np.float32)
    high = (v.kind == VehicleKind.T) | (v.kind == VehicleKind.V)
    cg_rear = v.wheelbase - v.cg_to_front
    night = per_sim(weather.night)
    lit = night | per_sim(world["rate"] > 0) | (per_sim(world["fog_extinction"]) > np.float32(0.03))
    tail = _number("weather", "lamps.rear_position")
    dark = np.float32(1e9)
    bicycle = v.kind == VehicleKind.B
    fog_lamp = per_sim(world["fog_extinction"]) > np.float32(0.03)
    lights = np.where(lit & ~bicycle, np.float32(int(Lights.LOW_BEAM)), np.float32(0.0))
    lights = lights + np.where(
        fog_lamp & ~bicycle, np.float32(int(Lights.REAR_FOG)), np.float32(0.0)
    )
    fog_intensity = _number("weather", "lamps.rear_fog")
    intensity = np.where(fog_lamp, fog_intensity, tail)
    return {
        "valid": v.valid,
        "half_length": np.float32(0.5) * v.length,
        "half_width": np.float32(0.5) * v.width,
        "tall": high & effects.occlusion,
        "mass": v.mass,
        "inverse_mass": np.float32(1.0) / v.mass,
        "inverse_inertia": np.float32(1.0) / v.yaw_inertia,
        "cg_front": v.cg_to_front,
        "cg_rear": cg_rear,
        "wheelbase": v.wheelbase,
        "inverse_wheelbase": np.float32(1.0) / v.wheelbase,
        "cg_height": v.cg_height,
        "front_stiffness": v.front_stiffness,
        "rear_stiffness": v.rear_stiffness,
        "launch_force": v.mass * v.launch_accel,
        "power": _number("model", "dynamics.power_share") * v.power,
        "drag": c.half_air_density * v.drag_area,
        "rolling": v.rolling_resistance * v.mass * c.gravity,
        "max_speed": v.max_speed,
        "brake_force": v.mass * v.peak_decel,
        "front_drive": v.front_drive_share,
        "half_track": np.float32(0.5) * v.track_width,
        "understeer": (np.float32(1.0) / v.front_stiffness - np.float32(1.0) / v.rear_stiffness)
        / c.gravity,
        "moment_angle": _moment_angle(scenario, c),
        "two_wheeler": v.two_wheeler,
        "side_wind": c.half_air_density * v.side_area * v.wind_side_coefficient,
        "wind_centre": v.wind_centre_ratio * v.wheelbase,
        "wind_arm": np.float32(0.5) * (v.cg_to_front - cg_rear),
        "wear": v.tyre_wear,
        "truck": truck,
        "shelters": high,
        "spray": v.spray_factor,
        "loom_width": np.where(night, v.lamp_separation, v.width),
        "contrast": log(v.contrast),
        "inverse_tail_lamp": np.where(lit & ~bicycle, np.float32(1.0) / intensity, dark),
        "inverse_head_lamp": np.where(lit & ~bicycle, np.float32(0.002), dark),
        "lights": lights,
        "start_s": scenario.start_s,
        "start_d": _lane_centre(scenario),
        "start_speed": scenario.start_speed,
        "start_lane": scenario.start_lane,
    }


def _moment_angle(scenario: Scenario, c: Constants) -> F32:
    """Wheel angle that balances a yaw moment on a straight course, (1/C_f + 1/C_r) / l [rad/(N m)]."""
    v = scenario.vehicles
    cg_rear = v.wheelbase - v.cg_to_front
    front = v.front_stiffness * v.mass * c.gravity * cg_rear / v.wheelbase
    rear = v.rear_stiffness * v.mass * c.gravity * v.cg_to_front / v.wheelbase
    return (np.float32(1.0) / front + np.float32(1.0) / rear) / v.wheelbase


def _lane_centre(scenario: Scenario) -> F32:
    borders = road_parameters(scenario.road).boundaries
    lane = np.minimum(scenario.start_lane, MAX_LANES - 1).astype(np.int64)
    return np.float32(0.5) * (borders[lane] + borders[lane + 1])


def _people(
    scenario: Scenario, c: Constants, world: dict[str, F32], effects: Effects
) -> dict[str, F32]:
    p, v = scenario.drivers, scenario.vehicles
    per_sim = lambda value: value[:, None]  # noqa: E731
    slow_reaction = np.where(per_sim(scenario.weather.night), np.float32(1.2), np.float32(1.0))
    hazy = (per_sim(world["fog_extinction"]) > np.float32(0.003)) | (
        per_sim(world["rate"]) > np.float32(7.6)
    )
    reaction = p.reaction_time * slow_reaction * np.where(hazy, np.float32(1.1), np.float32(1.0))
    ticks = minimum(
        np.rint(reaction * np.float32(20.0)),
        _number("model", "perception.history") + reaction * np.float32(0.0),
    )
    desired = minimum(adapted_speed(scenario, c, world), v.max_speed)
    hardest = minimum(
        v.peak_decel, _number("model", "following.grip_share") * c.gravity * per_sim(world["grip"])
    )
    never = np.float32(1e9)
    return {
        "desired_speed": desired,
        "pass_speed": minimum(desired * np.float32(1.1), v.max_speed),
        "time_gap": p.time_gap,
        "min_gap": p.min_gap,
        "accel": p.accel,
        "decel": p.decel,
        "interaction": np.float32(0.5) / np.sqrt(p.accel * p.decel),
        "overspeed_exponent": np.float32(4.0) * p.accel / p.decel,
        "hardest_decel": hardest,
        "reaction_ticks": ticks if effects.delay else np.zeros_like(ticks),
        "politeness": p.politeness,
        "threshold": p.lane_change_threshold
        if effects.mobil
        else np.full_like(p.lane_change_threshold, never),
        "bias": p.right_bias,
        "safe_decel": p.safe_decel,
        "lane_change_duration": maximum(
            p.lane_change_duration, _quickest_change(scenario, world)[:, None]
        ),
        "passing_gain": p.passing_gain,
        "inverse_patience": np.float32(1.0) / p.patience,
        "pull_out_time": p.pull_out_time,
        "gap_acceptance": p.gap_acceptance,
        "return_time_gap": p.return_time_gap,
        "signal_time": p.signal_time,
        "uses_indicator": p.uses_indicator,
        "checks_blind_spot": p.checks_blind_spot,
    }


def _quickest_change(scenario: Scenario, world: dict[str, F32]) -> F32:
    """Shortest lane change that the believed grip allows, (simulation,) [s].

    The quintic path peaks at 5.77 D / T^2; 0.7 of the lateral acceleration that the driver would use at
    most leaves room for keeping the lane.
    """
    borders = road_parameters(scenario.road).boundaries
    width = borders[1] - borders[0]
    return np.sqrt(np.float32(5.77) * width / (np.float32(0.7) * world["side_accel"]))


def _calm_speed(scenario: Scenario) -> F32:
    """Speed that a fully cautious driver keeps in strong wind, (simulation,) [m/s]."""
    gust = _number("weather", "wind.peak_factor") * _number("weather", "wind.full_speed")
    gust = gust * (scenario.weather.wind * np.float32(0.01))
    limited = gust > _number("weather", "wind.restricted_gust")
    return np.where(limited, _number("weather", "wind.restricted_speed"), np.float32(1e3))


def adapted_speed(scenario: Scenario, c: Constants, world: dict[str, F32]) -> F32:
    """Speed that each driver wants in this weather and light, (simulation, vehicle) [m/s].

    A cautious driver slows for heavy rain as measured on motorways (10 to 19 km/h above 6.4 mm/h), for
    strong wind to the speed that exposed bridges ask for, and to a speed from which the vehicle stops
    within sight of a lit one; a careless one does not.
    """
    p = scenario.drivers
    rate = world["rate"]
    heavy = minimum(
        maximum((rate - np.float32(6.4)) / np.float32(43.6), rate * np.float32(0.0)),
        rate * np.float32(0.0) + np.float32(1.0),
    )
    slower = np.where(
        rate > np.float32(6.4), np.float32(2.8) + np.float32(2.5) * heavy, np.float32(0.0)
    )
    extinction = world["fog_extinction"] + np.float32(2.0) * world["rain_extinction"]
    by_contrast = visibility.contrast_range(
        extinction, exp(world["sight_front"]) * np.float32(0.5), np.ones_like(extinction)
    )
    tail = _number("weather", "lamps.rear_position")
    by_lamp = visibility.lamp_range(
        extinction,
        tail + extinction * np.float32(0.0),
        maximum(world["lamp_threshold"], np.float32(1e-12)),
    )
    seen = np.where(scenario.weather.night, by_lamp, maximum(by_contrast, by_lamp))
    decel = np.float32(0.8) * c.gravity * world["grip"]
    safe = friction.stoppable_speed(seen, np.full_like(seen, np.float32(1.2)), decel)
    safe = minimum(safe, _calm_speed(scenario))[:, None]
    limit = np.float32(scenario.road.speed_limit)
    wanted = p.desired_speed - (np.float32(1.0) * p.limit_respect) * maximum(
        p.desired_speed - limit, p.desired_speed * np.float32(0.0)
    )
    excess = maximum(wanted - slower[:, None] - safe, wanted * np.float32(0.0))
    return wanted - p.caution * (slower[:, None] + excess)
