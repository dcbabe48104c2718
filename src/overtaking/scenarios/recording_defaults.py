"""Default values for quantities that a recording lacks, so that formulas stay finite.

A recording of real traffic shows length, width and movement of a vehicle, rarely its mass, never
its driver. Importers of recordings (`recordings`, `data.tables.restore`) fill the missing fields
from here. The importers list the groups of these fields, for example "weather", in
`Trajectories.unknown`; results that need such a group are then null. The default values depend on
recorded quantities only: a recording gets the same ones when it is imported and when its data set
is read again.
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
"""Type of a vehicle without a type in a recording that states types of other vehicles, whatever its
length: a choice. Where a recording states no types, `kinds_by_length` guesses all of them."""

_SUN_ALTITUDE = np.float32(0.8)
"""Height of the sun [rad], 46 degrees, a choice: by day, and too high to dazzle drivers, because
the model has glare only below 18 degrees."""

_SUN_AZIMUTH = np.float32(1.57)
"""Direction of the sun from the direction of travel [rad], a choice: 90 degrees to the left."""


def kinds_by_length(length: F64 | F32, *, is_truck: Mask, is_car: Mask) -> U8:
    """Guess vehicle types from lengths where a source states at most "car" and "truck".

    Cars are small, medium or large, with limits half-way between the typical lengths of these
    classes. A vehicle without a stated type is a truck if it is at least as long as the mean of the
    typical lengths of van and truck, otherwise a car. The result is never a van, a motorcycle or a
    bicycle.

    Args:
        length: Length, bumper to bumper, shape (vehicle,) [m].
        is_truck: Whether the source states a truck or bus, the same shape. Both get type truck.
        is_car: Whether the source states a car, the same shape. False in both masks: no type is
            stated.

    Returns:
        Codes of `VehicleKind`, the same shape.
    """
    # In metres, because `number` is in SI units.
    small, medium, large, van, truck = (
        float(vehicle_classes()[name].length.number) for name in ("S", "M", "L", "V", "T")
    )
    car = np.select(
        [length < (small + medium) / 2.0, length < (medium + large) / 2.0],
        [VehicleKind.SMALL_CAR, VehicleKind.MEDIUM_CAR],
        VehicleKind.LARGE_CAR,
    )
    is_taken_for_truck = is_truck | (~is_car & (length >= (van + truck) / 2.0))
    return np.where(is_taken_for_truck, VehicleKind.TRUCK, car).astype(np.uint8)


def default_vehicles(valid: Mask, kind: U8, length: F32, width: F32) -> VehicleSpecs:
    """Vehicles of recorded length and width; all other quantities are typical of their class.

    Args:
        valid: Whether the slot holds a vehicle, shape (simulation, vehicle).
        kind: Codes of `VehicleKind`, same shape.
        length: Recorded length, bumper to bumper, same shape [m].
        width: Recorded width, same shape [m].
    """
    colour = np.full(kind.shape, Colour.GREY, np.uint8)  # A choice.
    vehicles = typical_vehicles(kind, colour)
    return vehicles.replace(valid=valid, length=length, width=width)


def default_drivers(shape: tuple[int, int]) -> DriverTraits:
    """Placeholders for drivers: each number is 1 in its unit, each flag is False.

    The number 1 is within the range of every trait, and no formula then divides by 0.

    Args:
        shape: Numbers of simulations and vehicles.
    """
    values: dict[str, Any] = {
        name: np.zeros(shape, np.bool_) if field.is_flag else np.ones(shape, np.float32)
        for name, field in batch_fields(DriverTraits).items()
    }
    return DriverTraits(**values)


def default_weather(num_simulations: int) -> Weather:
    """A dry, clear and calm day.

    Args:
        num_simulations: Length of the arrays, which have shape (simulation,).
    """
    zero = np.zeros(num_simulations, np.float32)
    is_false = np.zeros(num_simulations, np.bool_)
    percentages: dict[str, Any] = dict.fromkeys(
        ("cloudiness", "rain", "puddles", "wind", "fog"), zero
    )
    return Weather(
        # Not one of the named weathers of CARLA.
        preset=np.full(num_simulations, NO_PRESET, np.uint8),
        wind_direction=zero,
        sun_altitude=zero + _SUN_ALTITUDE,
        sun_azimuth=zero + _SUN_AZIMUTH,
        night=is_false,
        low_sun=is_false,
        **percentages,
    )
