"""The seven vehicle classes and the eight colours."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from overtaking.knowledge.quantities import Quantity
from overtaking.knowledge.toml_reader import load_toml, read_record

VEHICLE_CLASS_NAMES = tuple(load_toml("vehicle_classes.toml"))
"""Class names by code; 0 to 6 are the encoding of the study `pinto-2023`."""

COLOUR_NAMES = ("yellow", "blue", "red", "green", "orange", "grey", "white", "brown")
"""Colour names by code, in the order of the study `pinto-2023`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleClass:
    """Properties of the vehicles of one class, with their spread.

    The centre of gravity lies `cg_to_front_ratio` of the wheelbase behind the front axle, written
    a, and b ahead of the rear axle. All values are SI.

    Attributes:
        name: The class in words.
        two_wheeler: Whether it leans, and moves as a point mass.
        motorway_allowed: Whether the law lets it on a motorway.
        length: Bumper to bumper [m].
        width: Of the body, without mirrors [m].
        height: Of the body, or of the rider's head [m].
        mass: With driver and load [kg].
        mass_empty: With the driver only [kg].
        wheelbase: Front to rear axle [m].
        cg_to_front_ratio: Centre of gravity behind the front axle, over the wheelbase.
        cg_height: Height of the centre of gravity at the value of `mass` [m].
        cg_height_empty: Height of the centre of gravity at `mass_empty` [m].
        inertia_factor: Yaw inertia over mass x a x b.
        front_stiffness: Cornering stiffness of the front axle over its load [1/rad].
        rear_stiffness: Cornering stiffness of the rear axle over its load [1/rad].
        front_drive_share: Part of the drive force that acts at the front axle.
        launch_accel: Largest acceleration at low speed [m/s^2].
        specific_power: Power at the wheels over `mass` [W/kg].
        drag_area: Drag coefficient times frontal area [m^2].
        side_area: Area seen from the side [m^2].
        rolling_resistance: Rolling resistance over weight.
        governed_speed: Highest speed, by limiter or by design [m/s].
        peak_decel: Hardest braking on a dry road [m/s^2].
        comfort_decel: Braking that drivers choose [m/s^2].
        wind_side_coefficient: Side force over dynamic pressure and `side_area`.
        wind_centre_ratio: Centre of wind pressure ahead of mid-wheelbase, over the wheelbase.
        spray_factor: Spray thrown up, relative to a car.
        lamp_separation: Centres of the rear position lamps; a single lamp's diameter [m].
        track_width: Centres of the front tyres; a two-wheeler's tyre width [m].
        motorway_limit: Legal speed on a Portuguese motorway [m/s].
    """

    name: str
    two_wheeler: bool
    motorway_allowed: bool
    length: Quantity
    width: Quantity
    height: Quantity
    mass: Quantity
    mass_empty: Quantity
    wheelbase: Quantity
    cg_to_front_ratio: Quantity
    cg_height: Quantity
    cg_height_empty: Quantity
    inertia_factor: Quantity
    front_stiffness: Quantity
    rear_stiffness: Quantity
    front_drive_share: Quantity
    launch_accel: Quantity
    specific_power: Quantity
    drag_area: Quantity
    side_area: Quantity
    rolling_resistance: Quantity
    governed_speed: Quantity
    peak_decel: Quantity
    comfort_decel: Quantity
    wind_side_coefficient: Quantity
    wind_centre_ratio: Quantity
    spray_factor: Quantity
    lamp_separation: Quantity
    track_width: Quantity
    motorway_limit: Quantity


@dataclass(frozen=True, slots=True, kw_only=True)
class Paint:
    """A colour of paint.

    Attributes:
        name: The colour in words.
        contrast: Of the body against a bright horizon or fog, 0 to 1.
        rgb: Red, green and blue of sRGB, 0 to 255, for pictures.
    """

    name: str
    contrast: Quantity
    rgb: tuple[int, int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class _ColourEntry:
    contrast: Quantity
    rgb: tuple[float, float, float]


@cache
def vehicle_classes() -> Mapping[str, VehicleClass]:
    """The vehicle classes by name, in the order of their codes."""
    return MappingProxyType(
        {
            name: read_record(VehicleClass, "vehicle_classes.toml", name)
            for name in VEHICLE_CLASS_NAMES
        }
    )


@cache
def colours() -> Mapping[str, Paint]:
    """The colours by name, in the order of their codes."""
    return MappingProxyType({name: _colour(name) for name in COLOUR_NAMES})


def _colour(name: str) -> Paint:
    entry = read_record(_ColourEntry, "colours.toml", name)
    red, green, blue = (int(part) for part in entry.rgb)
    return Paint(name=name, contrast=entry.contrast, rgb=(red, green, blue))
