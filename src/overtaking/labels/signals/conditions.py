"""What signals need of weather, road and ego, worked out once for each simulation."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.elementary import F32, as_f32, log, maximum
from overtaking.model.batch import Batch
from overtaking.model.trajectory import Trajectories
from overtaking.model.vehicles import Role, VehicleKind
from overtaking.world.conditions import outlook
from overtaking.world.constants import known
from overtaking.world.film import lane_film
from overtaking.world.lanes import road_parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions(Batch):
    """What signals need beside the recorded states.

    Attributes:
        film: Mean water film of each lane, puddles included, shape (simulation, lane), padded to
            the largest number of lanes [mm].
        wear: Tread wear of the ego, shape (simulation,).
        truck: 1 for an ego on truck tyres, same shape.
        fog_extinction: Of fog, same shape [1/m].
        rain_extinction: Of rain to an observer at rest, same shape [1/m].
        contrast_depth: Optical depth at which a vehicle of middling colour is lost, same shape.
        lamp_intensity: Of a rear lamp, same shape [cd].
        lamp_threshold: Illuminance at which it is seen, same shape [lx].
        unlit_limit: Range of the ego's own lamps by night, the limit of attention by day, same
            shape [m].
    """

    film: F32
    wear: F32
    truck: F32
    fog_extinction: F32
    rain_extinction: F32
    contrast_depth: F32
    lamp_intensity: F32
    lamp_threshold: F32
    unlit_limit: F32


def conditions(trajectories: Trajectories) -> Conditions:
    """The conditions of a batch.

    A stop is judged on the mean film of the lane: nobody knows, nor must know, which wheel will be
    in which puddle. Spray is left out, as it hides only what the vehicle that throws it up has to
    announce by its own brake lamps.
    """
    scenario = trajectories.scenario
    ahead, bodies = outlook(scenario), scenario.vehicles
    sight = ahead.sight
    return Conditions(
        film=_mean_film(ahead.film, road_parameters(scenario.road).film_path),
        wear=bodies.tyre_wear[:, Role.EGO],
        truck=as_f32(bodies.kind[:, Role.EGO] == VehicleKind.T),
        fog_extinction=sight["fog_extinction"],
        rain_extinction=sight["rain_extinction"],
        contrast_depth=sight["sight_front"] + log(known("model.speed_choice.contrast")),
        lamp_intensity=np.full_like(ahead.rain_rate, known("weather.lamps.rear_position")),
        lamp_threshold=sight["lamp_threshold"],
        unlit_limit=_unlit_limit(sight["inverse_lit_range"]),
    )


def _mean_film(water: dict[str, F32], film_path: F32) -> F32:
    """Film of each lane with the puddles spread evenly over it, (simulation, lane) [mm]."""
    film = lane_film(
        water["least_film"][:, None],
        water["film_rain"][:, None],
        film_path[None, :],
        water["texture"][:, None],
    )
    # See `film.puddle`: half the square of the threshold is the share that is under water.
    covered = np.float32(0.5) * water["puddle_reach"] * water["puddle_reach"]
    return film + (water["puddle_film"] * covered)[:, None]


def _unlit_limit(inverse_lit_range: F32) -> F32:
    """How far something unlit can be seen at best, shape (simulation,) [m]."""
    attention = known("model.perception.range")
    inverse = maximum(inverse_lit_range, np.float32(1.0) / attention)
    return np.float32(1.0) / inverse
