"""From bodies and people to vehicle types of SUMO: what each of our parameters is called there.

Every vehicle has a type of its own. Following is the EIDM, lane changing SL2015; the page
`docs/how-to/run-on-sumo.md` has the table and the reasons.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32
from overtaking.core.float32_math import ZERO
from overtaking.knowledge.toml_reader import constant
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.model.vehicles import EGO_SLOT, VehicleKind
from overtaking.simulators.sumo.network import BEHIND, EDGE, OPPOSITE
from overtaking.world import road_surface, visibility
from overtaking.world.constants import model_constants
from overtaking.world.road_parameters import has_two_directions
from overtaking.world.weather_parameters import with_effective_weather


def is_wet(scenario: Scenario) -> NDArray[np.bool_]:
    """Whether the road is wet, shape (simulation,); on a dry one SUMO's friction is left alone."""
    weather = with_effective_weather(scenario).weather
    rain = road_surface.rain_rate(weather.rain) > ZERO
    return rain | (weather.puddles >= constant("weather.film.wet_deposits_percent"))


def lane_friction(scenario: Scenario) -> F32:
    """Peak friction of a half-worn car tyre on the film of each lane, (simulation, lane).

    On two-way roads that of oncoming traffic is the last.

    SUMO has one number for a lane, whatever the speed, as road sensors report it. So it is taken at
    the slowest speed of the friction table, without aquaplaning, and puddles are left out.
    """
    path = road_surface.film_path_factor(_drainage_path(scenario.road))[None, :]
    rain = road_surface.film_rain_factor(
        road_surface.rain_rate(with_effective_weather(scenario).weather.rain)
    )[:, None]
    least = np.where(is_wet(scenario), constant("weather.film.wet_film_mm"), ZERO)[:, None]
    texture = np.full_like(rain, constant("weather.film.texture_depth_mm"))
    depth = road_surface.lane_film(least, rain, path, texture)
    speed = np.full_like(depth, model_constants().friction_speeds[0])
    wear = np.full_like(depth, constant("model.believed_grip.tyre_wear"))
    return road_surface.peak_friction(model_constants(), speed, depth, wear, np.zeros_like(depth))


def _drainage_path(road: Road) -> F32:
    """How far water has run from the fast edge, the crown, to the middle of each lane [m]."""
    reach = np.abs(road.lane_centres - road.lane_boundaries[-1]).astype(np.float32)
    if has_two_directions(road):
        reach = np.append(reach, reach[-1])
    return np.maximum(reach, constant("model.water.min_drainage_path"))


def distance_error(scenario: Scenario) -> F32:
    """Coefficient of variation of judged distances, shape (simulation,) [1]."""
    day, night, fog = (constant(f"weather.errors.distance_cv_{x}") for x in ("day", "night", "fog"))
    weather = with_effective_weather(scenario).weather
    foggy = visibility.meteorological_range(weather.fog) < constant("model.perception.fog_range")
    return np.where(foggy, fog, np.where(weather.night, night, day))


Attributes = dict[str, Any]
"""Numbers or words of a vehicle type, by SUMO's names."""

CLASSES = dict.fromkeys(VehicleKind, "passenger") | {
    VehicleKind.VAN: "delivery",
    VehicleKind.TRUCK: "truck",
    VehicleKind.MOTORCYCLE: "motorcycle",
    VehicleKind.BICYCLE: "bicycle",
}
"""SUMO's `vClass` of each type of vehicle: a passenger car if no other is named."""

_SPEED_GAIN_THRESHOLD = 0.2
"""Advantage over time that makes SL2015 change to the left, over `lcSpeedGain` [s]."""

_KEEP_RIGHT_TIME = 5.0
"""Time after which SL2015 keeps right where nothing is in the way, over `lcKeepRight` [s]."""

_DECISION_TIME = 1.0
"""Time of the decision to overtake at a gain of exactly `min_speed_gain` [s]; our choice."""

_LEAST_SIGNAL_TIME = 0.5
"""Keeps `lcKeepRight` within ten times its default without a signal [s]; our choice."""

_DEPARTURE_FACTOR = 20.0
"""Speed limits over which vehicles may start: SUMO refuses a vehicle above its desired speed."""

_LEAST = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Traffic:
    """Values of a batch that all its simulations share.

    Attributes:
        scenario: The batch.
        desired_speed: Wanted on a free road, (simulation, vehicle) [m/s].
        friction: Of each lane, (simulation, lane).
        is_wet: Whether the road is wet, (simulation,).
        distance_error: Coefficient of variation of judged distances, (simulation,).
    """

    scenario: Scenario
    desired_speed: F32
    friction: F32
    is_wet: Any
    distance_error: F32

    @classmethod
    def of(cls, scenario: Scenario) -> "Traffic":
        """Work it out."""
        return cls(
            scenario=scenario,
            desired_speed=_under(scenario, np.float32(scenario.road.speed_limit)),
            friction=lane_friction(scenario),
            is_wet=is_wet(scenario),
            distance_error=distance_error(scenario),
        )


def _under(scenario: Scenario, limit: np.float32) -> F32:
    """Speed that drivers want under a limit, (simulation, vehicle) [m/s]."""
    p = scenario.drivers
    return p.desired_speed - p.speed_limit_compliance * np.maximum(p.desired_speed - limit, ZERO)


def routes(traffic: Traffic, row: int, ahead: float = 0.0, before: float = BEHIND) -> str:
    """The content of a `.rou.xml` file: the vehicles of one simulation.

    Args:
        traffic: The batch.
        row: Which simulation of it.
        ahead: Length of the edges after s = 0 [m].
        before: Length before it [m].
    """
    scenario = traffic.scenario
    slots = np.flatnonzero(scenario.vehicles.valid[row]).tolist()
    types = "".join(_type(traffic, row, slot) for slot in slots)
    vehicles = "".join(_vehicle(scenario, row, slot, ahead, before) for slot in slots)
    ways = f'<route id="r" edges="{EDGE}"/>'
    if has_two_directions(scenario.road):
        ways += f'<route id="o" edges="{OPPOSITE}"/>'
    return f"<routes>{types}{ways}{vehicles}</routes>"


def oncoming(scenario: Scenario, row: int) -> NDArray[np.bool_]:
    """Which vehicles of a simulation start in the lane of oncoming traffic, (vehicle,)."""
    comes = scenario.start_lane[row] == scenario.road.num_lanes
    return comes & scenario.vehicles.valid[row]


def _vehicle(scenario: Scenario, row: int, slot: int, ahead: float, before: float) -> str:
    comes = bool(oncoming(scenario, row)[slot])
    start, half = (
        float(scenario.start_s[row, slot]),
        0.5 * float(scenario.vehicles.length[row, slot]),
    )
    place = ahead - (start - half) if comes else start + half + before
    lane = 0 if comes else int(scenario.start_lane[row, slot])
    # SUMO would move or refuse vehicles below its minimum gap; scenarios are kept unchanged.
    return (
        f'<vehicle id="{slot}" type="{slot}" route="{"o" if comes else "r"}" depart="0"'
        f' departPosLat="center" departLane="{lane}" departPos="{place!r}"'
        f' departSpeed="{float(scenario.start_speed[row, slot])!r}" insertionChecks="none"/>'
    )


def _type(traffic: Traffic, row: int, slot: int) -> str:
    given = (
        _body(traffic, row, slot) | _following(traffic, row, slot) | _changing(traffic, row, slot)
    )
    attributes = " ".join(f'{name}="{_text(value)}"' for name, value in given.items())
    return f'<vType id="{slot}" {attributes}/>'


def _text(value: Any) -> str:
    return value if isinstance(value, str) else repr(float(value))


def _body(traffic: Traffic, row: int, slot: int) -> Attributes:
    scenario = traffic.scenario
    v = scenario.vehicles
    top = max(float(v.max_speed[row, slot]), float(scenario.start_speed[row, slot]))
    return {
        "vClass": CLASSES[VehicleKind(int(v.kind[row, slot]))],
        "length": v.length[row, slot],
        "width": v.width[row, slot],
        "height": v.height[row, slot],
        "mass": v.mass[row, slot],
        "maxSpeed": top,  # SUMO refuses a faster start.
        "desiredMaxSpeed": top,  # Else that of the class: 20 km/h for bicycles.
    }


def _following(traffic: Traffic, row: int, slot: int) -> Attributes:
    """Parameters of the EIDM.

    Its drivers misjudge gaps by a slowly varying factor, as ours do. SUMO's devices for the state
    of drivers and for friction exist as well, but this model does not ask them.
    """
    scenario, p = traffic.scenario, traffic.scenario.drivers
    decel = float(p.decel[row, slot])
    grip = float(traffic.friction[row].mean() * model_constants().gravity)
    hardest = min(float(scenario.vehicles.peak_decel[row, slot]), grip)
    return {
        "carFollowModel": "EIDM",
        "speedFactor": _DEPARTURE_FACTOR,  # Until `speed_factor` takes its place.
        "speedDev": 0.0,
        "tau": p.time_gap[row, slot],
        "minGap": p.min_gap[row, slot],
        "accel": p.accel[row, slot],
        "decel": decel,
        "emergencyDecel": max(hardest, decel),
        "collisionMinGapFactor": 0.0,  # A collision is a contact of bodies.
        "treaction": p.reaction_time[row, slot],
        "tPersEstimate": model_constants().error_time,
        # The errors of speeds and of the pedals are SUMO's defaults.
        "sigmagap": traffic.distance_error[row],
    }


def speed_factor(
    traffic: Traffic, row: int, slot: int, lane: int, allowed: np.float32 | None = None
) -> float:
    """Speed wanted in a lane over the speed limit of the road [1].

    On a wet road it is lower by the share of SUMO's device for friction, which the EIDM ignores.

    Args:
        traffic: The batch.
        row: Row of the simulation in it.
        slot: Slot of the vehicle.
        lane: Where it is.
        allowed: Speed that limits allow it there, None for the limit of the road [m/s].

    Source:
        Eclipse SUMO user documentation: Simulation/Friction.
    """
    desired = traffic.desired_speed
    if allowed is not None:
        desired = _under(traffic.scenario, allowed)
    factor = float(desired[row, slot]) / traffic.scenario.road.speed_limit
    if not traffic.is_wet[row]:
        return factor
    friction = float(traffic.friction[row, lane])
    return factor * (-0.3491 * friction * friction + 0.8922 * friction + 0.4493)


def following_factor(
    traffic: Traffic, row: int, slot: int, speed: float, now: float, soon: float
) -> float:
    """Factor for which the EIDM keeps up with a speed factor that falls towards a lower limit [1].

    Above its desired speed the EIDM brakes with b (1 - (v0 / v)^(4 a / b)), too little for that. So
    it is told the desired speed for which that is the braking of our own drivers.

    Args:
        traffic: The batch.
        row: Row of the simulation in it.
        slot: Slot of the vehicle.
        speed: How fast it is [m/s].
        now: Speed factor where it is [1].
        soon: The same where it will be at the next decision [1].

    Source:
        Treiber and Kesting 2013, section 11.3.7; our drivers: `sim.reference.road_conditions`.
    """
    if soon >= now:
        return now
    c, p, limit = model_constants(), traffic.scenario.drivers, traffic.scenario.road.speed_limit
    accel, decel = float(p.accel[row, slot]), float(p.decel[row, slot])
    falls = limit * (soon - now) / float(c.decision)
    eased = falls + (limit * now - speed) * float(c.per_approach)
    if eased >= 0.0:
        return now
    share = max(1.0 + eased / decel, _LEAST)
    return min(now, speed / limit * share ** (decel / (4.0 * accel)))


def _changing(traffic: Traffic, row: int, slot: int) -> Attributes:
    """Parameters of SL2015."""
    p = traffic.scenario.drivers
    speed, accel = lateral_limits(traffic.scenario, row, slot)
    gain = max(float(p.min_speed_gain[row, slot]), _LEAST)
    indicator_lead_time = max(float(p.indicator_lead_time[row, slot]), _LEAST_SIGNAL_TIME)
    wanted = _SPEED_GAIN_THRESHOLD * float(traffic.desired_speed[row, slot])
    return {
        "laneChangeModel": "SL2015",
        "latAlignment": "center",
        "maxSpeedLat": speed,
        "lcAccelLat": accel,
        "lcSpeedGain": wanted / (gain * _DECISION_TIME),
        "lcSpeedGainLookahead": p.pull_out_ttc[row, slot],
        # With an empty lane beside it, the ego returns after the time for which it signals.
        "lcKeepRight": _KEEP_RIGHT_TIME / indicator_lead_time if slot == EGO_SLOT else 1.0,
        "lcKeepRightAcceptanceTime": constant("model.overtaking.stay_time"),
        "lcAssertive": 1.0 / max(float(p.gap_demand_factor[row, slot]), _LEAST),
        "lcTimeToImpatience": p.patience[row, slot],
        "lcCooperative": min(max(float(p.politeness[row, slot]), 0.0), 1.0),
    }


def lateral_limits(scenario: Scenario, row: int, slot: int) -> tuple[float, float]:
    """Lateral speed [m/s] and acceleration [m/s^2] with which a lane change takes as long as ours.

    SUMO accelerates, moves at constant speed and slows down again. With a third of the duration T
    for each, over a width D, that is 3 D / (2 T) and 9 D / (2 T^2), about as fast and hard as our
    quintic path (1.9 D / T and 5.8 D / T^2).
    """
    widths = [lane.width for lane in scenario.road.lanes]
    width = sum(widths) / len(widths)
    duration = max(float(scenario.drivers.lane_change_duration[row, slot]), _LEAST)
    return 1.5 * width / duration, 4.5 * width / (duration * duration)
