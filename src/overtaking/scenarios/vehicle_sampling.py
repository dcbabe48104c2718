"""Draws the vehicles themselves: type, colour, size, mass and what follows from them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, U8, Mask
from overtaking.core.native import clamp, maximum
from overtaking.core.random_numbers import Stream
from overtaking.knowledge.toml_reader import number
from overtaking.knowledge.vehicle_classes import (
    COLOUR_NAMES,
    VEHICLE_CLASS_NAMES,
    colours,
    vehicle_classes,
)
from overtaking.model.vehicles import EGO_SLOT, VehicleKind, VehicleSpecs
from overtaking.scenarios.random_draws import SampleBlock, choose_weighted, weights_of
from overtaking.scenarios.traffic_specification import PlacedTraffic
from overtaking.world.constants import model_constants

POWER_RESERVE = number("sampling.vehicles.power_reserve")
"""A bicycle that may not be on the road has this much more power than its speed costs."""

WEAR_MODE = number("sampling.vehicles.wear_mode")
"""The wear that most tyres have, 0 new to 1 bald."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnBody:
    """The drawn numbers of vehicles, shape (simulation, vehicle).

    Attributes:
        kind: Vehicle class, see `VehicleKind`.
        colour: See `Paint`.
        tyre_wear: Wear of the tyres, 0 new to 1 bald.
        has_front_drive: Whether the front wheels are driven.
        length: Length [m].
        mass: Mass [kg].
        wind_centre: Distance of the centre of wind pressure from the front, over the length.
    """

    kind: U8
    colour: U8
    tyre_wear: F32
    has_front_drive: Mask
    length: F32
    mass: F32
    wind_centre: F32


def vehicle_kinds(traffic: PlacedTraffic, u: F32) -> U8:
    """Vehicle types from uniform numbers (simulation, vehicle); the ego's have other weights."""
    kind = choose_weighted(u, weights_of(traffic.types, VEHICLE_CLASS_NAMES))
    ego = u[:, EGO_SLOT]
    kind[:, EGO_SLOT] = choose_weighted(ego, weights_of(traffic.ego_types, VEHICLE_CLASS_NAMES))
    return kind


def sample_vehicles(
    block: SampleBlock,
    kinds: Callable[[F32], U8],
    colour_weights: Mapping[str, float],
    num_slots: int,
) -> VehicleSpecs:
    """Draw a vehicle for each slot; the layout decides later which of them take part.

    Args:
        block: The simulations that are drawn together.
        kinds: Returns vehicle classes for uniform numbers (simulation, vehicle).
        colour_weights: Weights of the colours by name.
        num_slots: Vehicles that are drawn, the ego in slot 0.

    Returns:
        Vehicles, shape (simulation, vehicle), all of them valid.
    """
    stream = block.slot_streams(Stream.VEHICLE, num_slots)
    kind = kinds(stream.uniform())
    # The numbers are drawn in this order; another order would change every scenario.
    return _assemble(
        DrawnBody(
            kind=kind,
            colour=choose_weighted(stream.uniform(), weights_of(colour_weights, COLOUR_NAMES)),
            tyre_wear=_wear(stream.uniform()),
            has_front_drive=stream.uniform() < class_value("front_drive_share", kind),
            length=_sample_quantity("length", kind, stream.normal()),
            mass=_sample_quantity("mass", kind, stream.normal()),
            wind_centre=_sample_quantity("wind_centre_ratio", kind, stream.normal()),
        )
    )


def _wear(u: F32) -> F32:
    """Wear of tyres, 0 new to 1 bald, from uniform numbers: triangular, most of them half worn."""
    unit, mode = np.float32(1.0), np.float32(WEAR_MODE)
    return np.where(u < mode, np.sqrt(mode * u), unit - np.sqrt((unit - mode) * (unit - u)))


def with_able_bicycles(vehicles: VehicleSpecs, desired_speed: F32) -> VehicleSpecs:
    """The vehicles, with every bicycle able to hold the speed that it is given.

    No rider drives at 50 km/h. The study has bicycles at 50 to 120 km/h all the same, so their top
    speed and power are what this takes; they stay marked as `unlawful_presence`.

    Args:
        vehicles: Bodies, shape (simulation, vehicle).
        desired_speed: Speed that each driver wants, the same shape [m/s].
    """
    bicycle = vehicles.kind == VehicleKind.BICYCLE
    c = model_constants()
    drag = c.half_air_density * vehicles.drag_area * desired_speed * desired_speed
    rolling = vehicles.rolling_resistance * vehicles.mass * c.gravity
    share = np.float32(number("model.dynamics.power_share") / POWER_RESERVE)
    power = maximum((drag + rolling) * desired_speed / share, vehicles.power)
    max_speed = maximum(desired_speed, vehicles.max_speed)
    return vehicles.replace(
        power=np.where(bicycle, power, vehicles.power),
        max_speed=np.where(bicycle, max_speed, vehicles.max_speed),
    )


def with_semitrailers(vehicles: VehicleSpecs, pulls: NDArray[np.bool_]) -> VehicleSpecs:
    """The vehicles, some of the trucks with a semitrailer, which follows the path of its tractor.

    Args:
        vehicles: Bodies, shape (simulation, vehicle).
        pulls: Which of the trucks have one, the same shape.
    """
    pulls = pulls & (vehicles.kind == VehicleKind.TRUCK)
    mass = np.float32(number("sampling.semitrailer.mass"))
    inertia = vehicles.yaw_inertia * (mass / vehicles.mass)
    return vehicles.replace(
        yaw_inertia=np.where(pulls, inertia, vehicles.yaw_inertia),
        **{
            name: np.where(
                pulls,
                np.float32(number(f"sampling.semitrailer.{name}")),
                getattr(vehicles, name),
            )
            for name in ("length", "height", "mass", "power", "drag_area", "side_area")
        },
    )


def typical_vehicles(kind: U8, colour: U8) -> VehicleSpecs:
    """Vehicles as they usually are, half worn, with the drive of most of their type.

    Args:
        kind: Vehicle types, shape (simulation, vehicle).
        colour: `Paint`, same shape.
    """
    half = np.full(kind.shape, 0.5, np.float32)
    return _assemble(
        DrawnBody(
            kind=kind,
            colour=colour,
            tyre_wear=half,
            has_front_drive=class_value("front_drive_share", kind) > half,
            length=class_value("length", kind),
            mass=class_value("mass", kind),
            wind_centre=class_value("wind_centre_ratio", kind),
        )
    )


def top_speeds() -> F32:
    """Highest speed of each vehicle type, the bicycle's lifted, shape (type,) [m/s]."""
    speeds = _table("governed_speed").copy()
    speeds[VehicleKind.BICYCLE] = np.inf
    return speeds


def kind_number(block: SampleBlock, slot: int) -> F32:
    """The number that decides the class of the vehicle in a slot, shape (simulation,)."""
    return block.stream(int(Stream.VEHICLE) + slot).uniform()


def max_length(traffic: PlacedTraffic) -> float:
    """Length of the longest vehicle that the weights allow [m]."""
    weights = (traffic.types, traffic.ego_types)
    drawn = {name for group in weights for name, weight in group.items() if weight > 0.0}
    return max(float(_limits("length")[1][VEHICLE_CLASS_NAMES.index(name)]) for name in drawn)


def class_value(quantity: str, kind: U8) -> F32:
    """The value that a quantity of `knowledge.VehicleClass` has for each vehicle."""
    return _table(quantity)[kind]


@cache
def _table(quantity: str) -> F32:
    """Value of a quantity for each vehicle type, shape (type,)."""
    classes = vehicle_classes().values()
    return np.array([getattr(entry, quantity).number for entry in classes], np.float32)


@cache
def _limits(quantity: str) -> tuple[F32, F32]:
    """Smallest and largest sample of a quantity for each vehicle type."""
    entries = [getattr(vehicle_class, quantity) for vehicle_class in vehicle_classes().values()]
    low = np.array([entry.low for entry in entries], np.float32)
    return low, np.array([entry.high for entry in entries], np.float32)


@cache
def _sigma(quantity: str) -> F32:
    """Standard deviation of a quantity for each vehicle type, zero where it is fixed."""
    entries = [getattr(vehicle_class, quantity) for vehicle_class in vehicle_classes().values()]
    return np.array([entry.sigma or 0.0 for entry in entries], np.float32)


@cache
def _flags(name: str) -> NDArray[np.bool_]:
    """A yes or no of `knowledge.VehicleClass` for each vehicle type."""
    return np.array(
        [getattr(vehicle_class, name) for vehicle_class in vehicle_classes().values()], np.bool_
    )


@cache
def _contrasts() -> F32:
    return np.array([colour.contrast.number for colour in colours().values()], np.float32)


def _sample_quantity(quantity: str, kind: U8, z: F32) -> F32:
    """A sample of a quantity: value + sigma z, inside its limits."""
    low, high = _limits(quantity)
    value = class_value(quantity, kind) + _sigma(quantity)[kind] * z
    return clamp(value, low[kind], high[kind])


def _cg_height(kind: U8, mass: F32) -> F32:
    """Height of the centre of gravity, between empty and the usual load [m]."""
    empty, usual = class_value("mass_empty", kind), class_value("mass", kind)
    loaded = clamp((mass - empty) / (usual - empty), np.zeros_like(mass), np.ones_like(mass))
    low, high = class_value("cg_height_empty", kind), class_value("cg_height", kind)
    return low + loaded * (high - low)


def _assemble(body: DrawnBody) -> VehicleSpecs:
    """All fields of the vehicles, from the drawn ones and the numbers of their classes."""
    kind = body.kind
    wheelbase = class_value("wheelbase", kind)
    cg_to_front = class_value("cg_to_front_ratio", kind) * wheelbase
    arms = cg_to_front * (wheelbase - cg_to_front)
    of_class = {
        name: class_value(name, kind)
        for name in (
            "width",
            "height",
            "front_stiffness",
            "rear_stiffness",
            "launch_accel",
            "drag_area",
            "side_area",
            "rolling_resistance",
            "peak_decel",
            "wind_side_coefficient",
            "track_width",
            "spray_factor",
            "lamp_separation",
        )
    }
    return VehicleSpecs(
        valid=np.ones(kind.shape, np.bool_),
        kind=kind,
        colour=body.colour,
        length=body.length,
        mass=body.mass,
        wheelbase=wheelbase,
        cg_to_front=cg_to_front,
        cg_height=_cg_height(kind, body.mass),
        yaw_inertia=class_value("inertia_factor", kind) * body.mass * arms,
        # The load does not change the engine.
        power=class_value("specific_power", kind) * class_value("mass", kind),
        max_speed=class_value("governed_speed", kind),
        wind_centre_ratio=body.wind_centre,
        front_drive_share=body.has_front_drive.astype(np.float32),
        tyre_wear=body.tyre_wear,
        contrast=_contrasts()[body.colour],
        two_wheeler=_flags("two_wheeler")[kind],
        unlawful_presence=~_flags("motorway_allowed")[kind],
        **of_class,
    )
