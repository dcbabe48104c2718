"""The seven vehicle classes and the eight colours of vehicles, from two TOML files.

`scenarios` draws vehicles from the classes. `read_record` fills a dataclass from a table of a file.
A `Quantity` is a number with unit and source; its `value` is in SI units. Where the vehicles of a
class differ, it also has a standard deviation `sigma` and limits, `low` and `high`.

The file `vehicle_classes.toml` has the classes in the order of their codes 0 to 6, which the study
`pinto-2023` defined and recordings store. The code is the position in `VEHICLE_CLASS_NAMES`.
`model.vehicles` has the same codes as the enumerations `VehicleKind` and `Colour`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from overtaking.knowledge.quantities import Quantity
from overtaking.knowledge.toml_reader import load_toml, read_record

VEHICLE_CLASS_NAMES = tuple(load_toml("vehicle_classes.toml"))
"""Names of the classes in the order of their codes: S, M, L (small, medium and large car), V (van),
T (truck), MC (motorcycle) and B (bicycle)."""

COLOUR_NAMES = ("yellow", "blue", "red", "green", "orange", "grey", "white", "brown")
"""Names of the colours in the order of their codes, as the study `pinto-2023` encodes them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleClass:
    """Properties of the vehicles of one class, with their spread.

    In the entry of `inertia_factor`, a and b are the distances from the centre of gravity to the
    front and to the rear axle. "Empty" is a vehicle with its driver and no load.

    Attributes:
        name: The class in words, such as "small car".
        two_wheeler: Whether it leans. The model moves it as a point mass, without inertia and
            stiffness.
        motorway_allowed: Whether the law lets it on a motorway.
        length: Length from bumper to bumper [m].
        width: Width of the body without mirrors [m].
        height: Height of the body, or of the rider's head, above the road [m].
        mass: Mass with driver and load [kg].
        mass_empty: Mass with the driver and no load [kg].
        wheelbase: Distance from the front to the rear axle [m].
        cg_to_front_ratio: Distance of the centre of gravity from the front axle over the wheelbase.
        cg_height: Height of the centre of gravity of a vehicle with the mass `mass.value` [m].
        cg_height_empty: Height of the centre of gravity of an empty vehicle [m].
        inertia_factor: Moment of inertia about the vertical axis over mass x a x b.
        front_stiffness: Cornering stiffness of the front axle over its load [1/rad].
        rear_stiffness: Cornering stiffness of the rear axle over its load [1/rad].
        front_drive_share: Share of the drive force that acts at the front axle.
        launch_accel: Largest acceleration at low speed [m/s^2].
        specific_power: Power at the wheels over `mass.value` [W/kg].
        drag_area: Drag coefficient times frontal area [m^2].
        side_area: Area seen from the side [m^2].
        rolling_resistance: Rolling resistance over weight.
        governed_speed: Highest speed, by a limiter or by design [m/s].
        peak_decel: Hardest braking on a dry road, positive [m/s^2].
        comfort_decel: Braking that drivers choose in everyday traffic, positive [m/s^2].
        wind_side_coefficient: Side force over the product of wind pressure and `side_area`.
        wind_centre_ratio: Distance of the centre of wind pressure ahead of mid-wheelbase, over the
            wheelbase.
        spray_factor: Spray thrown up from a wet road, relative to a car.
        lamp_separation: Distance between the rear position lamps; diameter of a single lamp [m].
        track_width: Distance between the front tyres; width of a two-wheeler's tyre [m].
        motorway_limit: Speed limit of the class on Portuguese motorways [m/s]. Bicycles, which are
            not allowed there, have the limit of the road.
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
    """A colour of the body of a vehicle.

    Attributes:
        name: A name in `COLOUR_NAMES`.
        contrast: Luminance contrast of the body against a bright horizon or fog, from 0 to 1; it
            decides at which distance drivers see the vehicle in fog.
        rgb: Red, green and blue in sRGB, 0 to 255, for pictures.
    """

    name: str
    contrast: Quantity
    rgb: tuple[int, int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class _ColourEntry:
    """A table of `colours.toml`. `read_record` returns a list as floats; a `Paint` has integers."""

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
    red, green, blue = (int(channel) for channel in entry.rgb)
    return Paint(name=name, contrast=entry.contrast, rgb=(red, green, blue))
