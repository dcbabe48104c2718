"""Adds drivers and vehicle bodies to the traffic around the ego."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from overtaking.core.arrays import F32, U8, U64, Mask
from overtaking.core.compiled import minimum
from overtaking.core.units import mps_from_kmh
from overtaking.knowledge import number
from overtaking.model.drivers import Drivers
from overtaking.model.road import Road
from overtaking.model.vehicles import Role, VehicleSpecs
from overtaking.scenarios import flow as layout
from overtaking.scenarios.bodies import first_uniform, sample_bodies, top_speeds
from overtaking.scenarios.layout import Zone
from overtaking.scenarios.noise import REACH
from overtaking.scenarios.people import drivers_with, most_cruise, sample_traits
from overtaking.scenarios.proposal import Bend
from overtaking.scenarios.schema import Spec
from overtaking.scenarios.schema_flow import Flow

PASSING_MARGIN = number("starts.toml", "flow.passing_margin")
"""Largest speed while overtaking, over the desired speed."""

RETURN_TIME = number("starts.toml", "flow.return_time")
"""How much longer than until the last attempt the traffic lasts where there are vehicles enough: a
common overtake [s]."""

MARGIN = number("starts.toml", "flow.margin")
"""Road behind the rearmost vehicle [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """All vehicles before the first frame, shape (simulation, vehicle).

    Attributes:
        vehicles: Bodies.
        drivers: People.
        lane: Lane, 0 the slowest.
        kept: See `layout.Draft`.
        zone: Where they may start.
        deadline: A simulation without an attempt ends here, shape (simulation,) [s].
        pace: Positions [m] and speeds [m/s] from the speeds that drivers want in their weather.
        turned: Whose positions count from the end of the road, as they come the other way; None
            for nobody's.
    """

    vehicles: VehicleSpecs
    drivers: Drivers
    lane: U8
    kept: F32
    zone: Zone
    deadline: F32
    pace: Callable[[F32], tuple[F32, F32]]
    turned: Mask | None = None


def start(spec: Spec, flow: Flow, road: Road, seed: int, index: U64, bend: Bend) -> Start:
    """Traffic as it is met, the ego one of it.

    Args:
        spec: What to sample.
        flow: Its traffic.
        road: The road.
        seed: Seed of the data set.
        index: Simulation numbers, shape (simulation,).
        bend: Draws from where more happens.
    """
    own_lane = layout.own_lane(flow, seed, index)
    wish, bent = _own_wish(spec, flow, seed, index, own_lane, bend)
    until = spec.time.attempt_deadline_s + RETURN_TIME
    around = layout.surround(flow, seed, index, own_lane, wish, until, bend)
    kinds = partial(layout.kinds, flow, lane=around.lane)
    bodies = sample_bodies(kinds, flow.colours, seed, index, flow.vehicles[1])
    traits = sample_traits(spec.drivers, seed, index, bodies.kind, bent)
    wishes = layout.wishes(flow, traits["cruise_factor"], bodies.kind, around.lane)
    wishes = minimum(wishes, top_speeds()[bodies.kind])

    def pace(wanted: F32) -> tuple[F32, F32]:
        s, speed = layout.equilibrium(
            around, 0.5 * bodies.length, wanted, traits["time_gap"], traits["min_gap"]
        )
        return _on_road(s, around.valid), speed

    return Start(
        vehicles=bodies.replace(valid=around.valid),
        drivers=drivers_with(traits, wishes),
        lane=around.lane,
        kept=np.zeros_like(wishes),
        zone=_everywhere(road),
        pace=pace,
        deadline=minimum(around.time, np.float32(spec.time.attempt_deadline_s)),
    )


def road_length(spec: Spec, flow: Flow) -> float:
    """Length of a road that no vehicle leaves before the horizon [m]."""
    speeds = [mps_from_kmh(lane.speed_kmh) for lane in flow.lanes]
    faster = max(speeds) - min(speeds) + 2.0 * layout.UNCERTAINTY
    wish = max(lane.wish for lane in flow.lanes) * most_cruise(spec.drivers)
    fastest = wish * mps_from_kmh(max(flow.free_speed_kmh.values()))
    free = max(lane.density for lane in flow.lanes) / min(lane.density for lane in flow.lanes)
    longest = 1e3 * free / flow.density_per_km_lane[0]
    longest *= float(np.exp(flow.spacing_sigma * float(REACH)))
    traffic = sum(flow.sight_m) + (faster + fastest) * spec.time.horizon_s + 2.0 * longest
    return MARGIN + traffic + PASSING_MARGIN * fastest * spec.time.horizon_s


def _own_wish(
    spec: Spec, flow: Flow, seed: int, index: U64, lane: U8, bend: Bend
) -> tuple[F32, Bend]:
    """The speed that the ego wants [m/s], and what gives its temper and traits once more.

    The traffic is placed by what the ego wants, so it is drawn before the others are.
    """
    u = first_uniform(seed, index, Role.EGO)[:, None]
    kind = layout.kinds(flow, u, lane[:, None])
    drawn: dict[str, F32] = {}

    def remembered(name: str, u: F32) -> F32:
        if not name.startswith("ego_"):
            return bend(name, u)
        if name not in drawn:
            drawn[name] = bend(name, u)
        return drawn[name]

    traits = sample_traits(spec.drivers, seed, index, kind, remembered)
    wish = layout.wishes(flow, traits["cruise_factor"], kind, lane[:, None])
    return minimum(wish, top_speeds()[kind])[:, 0], remembered


def _on_road(s: F32, valid: Mask) -> F32:
    """Positions along the road with the rearmost vehicle near its begin [m]."""
    rearmost = s[:, 0]
    for slot in range(1, s.shape[1]):
        place = np.where(valid[:, slot], s[:, slot], rearmost)
        rearmost = minimum(rearmost, place)
    return s - rearmost[:, None] + np.float32(MARGIN)


def _everywhere(road: Road) -> Zone:
    """Unbounded zone: only start-safety checks move vehicles."""
    lanes = tuple(range(road.num_lanes))
    return Zone(
        low=0.0, high=road.length, ego_lanes=lanes, num_lanes=road.num_lanes, most_in_lane=255
    )
