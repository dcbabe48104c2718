"""Default values for quantities that a recording lacks, so that formulas stay finite.

A recording of real traffic shows length, width and movement of a vehicle, rarely its mass, never
its driver. `Trajectories.unknown` names the missing quantities. The default values only keep
formulas from dividing by zero; no result may depend on them. They depend on recorded quantities
alone, so that a recording from memory and from a file has the same ones.
"""

from typing import Any

import numpy as np

from overtaking.core.arrays import F32, F64, U8, Mask
from overtaking.knowledge.vehicle_classes import vehicle_classes
from overtaking.model.batch import batch_fields
from overtaking.model.vehicles import Colour, DriverTraits, VehicleKind, VehicleSpecs
from overtaking.model.weather import NO_PRESET, Weather
from overtaking.scenarios.vehicle_sampling import typical_vehicles

DEFAULT_KIND = VehicleKind.MEDIUM_CAR
"""Type of a vehicle whose type is not known."""
_HIGH_SUN = np.float32(0.8)  # Neither night nor glare.
_ABEAM = np.float32(1.57)


def kinds_by_length(length: F64 | F32, *, is_truck: Mask, is_car: Mask) -> U8:
    """Vehicle types where a source knows at most cars and trucks.

    Small, medium and large are parted half-way between the typical lengths of the three classes. A
    vehicle without a stated type is a truck from half-way between van and truck on. Vans are not
    distinguished. `may_be_kind` checks whether a length contradicts a stated type.

    Args:
        length: Shape (vehicle,) [m].
        is_truck: Whether the source calls it a truck or bus, same shape.
        is_car: Whether the source calls it a car, same shape.
    """
    small, medium, large, van, truck = (
        float(vehicle_classes()[name].length.number) for name in ("S", "M", "L", "V", "T")
    )
    car = np.select(
        [length < (small + medium) / 2.0, length < (medium + large) / 2.0],
        [VehicleKind.SMALL_CAR, VehicleKind.MEDIUM_CAR],
        VehicleKind.LARGE_CAR,
    )
    trucks = is_truck | (~is_car & (length >= (van + truck) / 2.0))
    return np.where(trucks, VehicleKind.TRUCK, car).astype(np.uint8)


def default_vehicles(valid: Mask, kind: U8, length: F32, width: F32) -> VehicleSpecs:
    """Vehicles of recorded length and width; all other quantities are typical of their class.

    Args:
        valid: Whether the slot holds a vehicle, shape (simulation, vehicle).
        kind: `VehicleKind`, same shape.
        length: Same shape [m].
        width: Same shape [m].
    """
    colour = np.full(kind.shape, Colour.GREY, np.uint8)
    bodies = typical_vehicles(kind, colour)
    return bodies.replace(valid=valid, length=length, width=width)


def default_drivers(shape: tuple[int, int]) -> DriverTraits:
    """Assumed drivers of recorded vehicles, shape (simulation, vehicle)."""
    values: dict[str, Any] = {
        name: np.zeros(shape, np.bool_) if field.is_flag else np.ones(shape, np.float32)
        for name, field in batch_fields(DriverTraits).items()
    }
    return DriverTraits(**values)


def default_weather(num_simulations: int) -> Weather:
    """A dry, clear day for recordings without weather."""
    zero = np.zeros(num_simulations, np.float32)
    is_false = np.zeros(num_simulations, np.bool_)
    percentages: dict[str, Any] = dict.fromkeys(
        ("cloudiness", "rain", "puddles", "wind", "fog"), zero
    )
    return Weather(
        preset=np.full(num_simulations, NO_PRESET, np.uint8),
        wind_direction=zero,
        sun_altitude=zero + _HIGH_SUN,
        sun_azimuth=zero + _ABEAM,
        night=is_false,
        low_sun=is_false,
        **percentages,
    )
