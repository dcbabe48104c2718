"""Draws vehicles: class, colour, length, mass, tyres, and all fields that follow from these.

The samplers of the three kinds of traffic call `sample_vehicles` with a function that chooses the
classes. `typical_vehicles` makes vehicles without random numbers, for recordings. Both return a
`VehicleSpecs`. *Placed traffic* is one of the three: a few vehicles in a short zone, as in the
study of Pinto, Dutra and Fonseca (2023). The others are motorways and two-way roads.

Each *vehicle class* (S, M and L for small, medium and large cars, V van, T truck,
MC motorcycle, B bicycle) has its numbers in `knowledge/data/vehicle_classes.toml`; its code is its
position in `VEHICLE_CLASS_NAMES`, the same as in `VehicleKind`.

Arrays have shape (simulation, vehicle). The position in the second axis is the *slot*; slot 0 is
the ego, the vehicle whose overtaking is studied. Numbers are computed in float32 with the functions
of `core.native`, which give the same bits on every machine.
"""

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
"""Power of a bicycle in placed traffic, over the power that its speed takes; without a reserve it
could not accelerate [1]. A choice."""

WEAR_MODE = number("sampling.vehicles.wear_mode")
"""Most frequent wear of tyres, 0 new to 1 bald. A choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnBody:
    """The drawn numbers of vehicles, from which `_complete_vehicles` computes all others.

    Attributes:
        kind: Code of the vehicle class.
        colour: Position in `COLOUR_NAMES`.
        tyre_wear: Wear of the tyres, 0 new to 1 bald.
        has_front_drive: Whether the engine drives the front wheels, otherwise the rear wheels.
        length: Length, bumper to bumper [m].
        mass: Mass with driver and load [kg].
        wind_centre_ratio: Distance of the centre of wind pressure ahead of the middle between the
            axles, over the wheelbase [1].
    """

    kind: U8
    colour: U8
    tyre_wear: F32
    has_front_drive: Mask
    length: F32
    mass: F32
    wind_centre_ratio: F32


def vehicle_kinds(traffic: PlacedTraffic, u: F32) -> U8:
    """Choose classes by the weights of placed traffic, which has other weights for the ego.

    Args:
        traffic: Section `[traffic]` of the specification.
        u: Uniform numbers in (0, 1), shape (simulation, vehicle).

    Returns:
        Codes of vehicle classes, the same shape.
    """
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
    """Draw a vehicle for each slot; the caller decides which of them take part.

    Args:
        block: The simulations that are drawn together, with their random numbers.
        kinds: Function from uniform numbers in (0, 1), shape (simulation, vehicle), to codes of
            vehicle classes of the same shape.
        colour_weights: Relative frequency of each colour by its name.
        num_slots: Number of vehicles in each simulation, the ego included.

    Returns:
        Vehicles, shape (simulation, vehicle), all of them valid.
    """
    stream = block.slot_streams(Stream.VEHICLE, num_slots)
    kind = kinds(stream.uniform())  # `kind_number` relies on this being the first number.
    # The numbers are drawn in this order; another order would change every scenario. Normal numbers
    # from `stream.normal` are limited to 2.5 standard deviations.
    return _complete_vehicles(
        DrawnBody(
            kind=kind,
            colour=choose_weighted(stream.uniform(), weights_of(colour_weights, COLOUR_NAMES)),
            tyre_wear=_tyre_wear(stream.uniform()),
            has_front_drive=stream.uniform() < class_value("front_drive_share", kind),
            length=_quantity_from_normal("length", kind, stream.normal()),
            mass=_quantity_from_normal("mass", kind, stream.normal()),
            wind_centre_ratio=_quantity_from_normal("wind_centre_ratio", kind, stream.normal()),
        )
    )


def _tyre_wear(u: F32) -> F32:
    """Wear of tyres, 0 new to 1 bald: the inverse of a triangular distribution at `u` in (0, 1).

    The distribution reaches from 0 to 1, with its peak at `WEAR_MODE`.
    """
    bald, mode = np.float32(1.0), np.float32(WEAR_MODE)
    return np.where(u < mode, np.sqrt(mode * u), bald - np.sqrt((bald - mode) * (bald - u)))


def with_able_bicycles(vehicles: VehicleSpecs, desired_speed: F32) -> VehicleSpecs:
    """The vehicles, with every bicycle able to hold its desired speed.

    The study has bicycles at 50 to 120 km/h on a motorway, which no rider reaches. The top
    speed of a bicycle is raised to its desired speed, and the power to the power for this speed.
    The flag `unlawful_presence` stays: the law bans bicycles from motorways.

    Args:
        vehicles: Vehicles, shape (simulation, vehicle).
        desired_speed: Speed that each driver wants, the same shape [m/s].
    """
    is_bicycle = vehicles.kind == VehicleKind.BICYCLE
    constants = model_constants()
    drag = constants.half_air_density * vehicles.drag_area * desired_speed * desired_speed
    rolling = vehicles.rolling_resistance * vehicles.mass * constants.gravity
    # In the model, only the part `power_share` of the power reaches the wheels.
    usable_share = np.float32(number("model.dynamics.power_share") / POWER_RESERVE)
    power = maximum((drag + rolling) * desired_speed / usable_share, vehicles.power)
    max_speed = maximum(desired_speed, vehicles.max_speed)
    return vehicles.replace(
        power=np.where(is_bicycle, power, vehicles.power),
        max_speed=np.where(is_bicycle, max_speed, vehicles.max_speed),
    )


def with_semitrailers(vehicles: VehicleSpecs, has_semitrailer: Mask) -> VehicleSpecs:
    """The vehicles, with the sizes and masses of articulated trucks where trucks have semitrailers.

    The model moves an articulated truck as one rigid body: the semitrailer follows the path of its
    tractor.

    Args:
        vehicles: Vehicles, shape (simulation, vehicle).
        has_semitrailer: Vehicles with a semitrailer, the same shape. It has no effect on vehicles
            other than trucks.
    """
    is_articulated = has_semitrailer & (vehicles.kind == VehicleKind.TRUCK)
    mass = np.float32(number("sampling.semitrailer.mass"))
    # The wheelbase stays as it is, so the yaw inertia grows with the mass alone.
    inertia = vehicles.yaw_inertia * (mass / vehicles.mass)
    return vehicles.replace(
        yaw_inertia=np.where(is_articulated, inertia, vehicles.yaw_inertia),
        **{
            name: np.where(
                is_articulated,
                np.float32(number(f"sampling.semitrailer.{name}")),
                getattr(vehicles, name),
            )
            for name in ("length", "height", "mass", "power", "drag_area", "side_area")
        },
    )


def typical_vehicles(kind: U8, colour: U8) -> VehicleSpecs:
    """Vehicles with the central values of their class, and half-worn tyres.

    Args:
        kind: Codes of vehicle classes, shape (simulation, vehicle).
        colour: Positions in `COLOUR_NAMES`, the same shape.
    """
    half = np.full(kind.shape, 0.5, np.float32)
    return _complete_vehicles(
        DrawnBody(
            kind=kind,
            colour=colour,
            tyre_wear=half,
            # Front-wheel drive if more than half of the class have it.
            has_front_drive=class_value("front_drive_share", kind) > half,
            length=class_value("length", kind),
            mass=class_value("mass", kind),
            wind_centre_ratio=class_value("wind_centre_ratio", kind),
        )
    )


def top_speeds() -> F32:
    """Highest speed of each vehicle class by its code, for drawing speeds, shape (class,) [m/s].

    Infinite for bicycles, whose speed this table does not limit. In placed traffic they hold any
    speed, because `with_able_bicycles` raises their `VehicleSpecs.max_speed`. In other traffic that
    field, the speed of a real bicycle, limits them when `sampler` places them and in motion.
    """
    speeds = _class_values("governed_speed").copy()
    speeds[VehicleKind.BICYCLE] = np.inf
    return speeds


def kind_number(block: SampleBlock, slot: int) -> F32:
    """The number that decides the class of the vehicle in a slot, shape (simulation,).

    The same number that `sample_vehicles` passes to its `kinds`, for a caller that needs the class
    of one vehicle before all are drawn.

    Args:
        block: The simulations that are drawn together.
        slot: The slot of the vehicle.
    """
    return block.stream(int(Stream.VEHICLE) + slot).uniform()


def max_length(traffic: PlacedTraffic) -> float:
    """Length of the longest vehicle that placed traffic can have [m].

    Args:
        traffic: Section `[traffic]` of the specification, with the weights of vehicle classes.
    """
    all_weights = (traffic.types, traffic.ego_types)
    names = {name for weights in all_weights for name, weight in weights.items() if weight > 0.0}
    _, longest = _class_limits("length")
    return max(float(longest[VEHICLE_CLASS_NAMES.index(name)]) for name in names)


def class_value(quantity: str, kind: U8) -> F32:
    """The central value of a quantity in the class of each vehicle.

    Args:
        quantity: Name of a field of `knowledge.vehicle_classes.VehicleClass`, such as `length`.
        kind: Codes of vehicle classes, any shape.

    Returns:
        Values in SI units, the same shape.
    """
    return _class_values(quantity)[kind]


@cache
def _class_values(quantity: str) -> F32:
    """Central value of a quantity by code of the vehicle class, shape (class,)."""
    classes = vehicle_classes().values()
    return np.array([getattr(entry, quantity).number for entry in classes], np.float32)


@cache
def _class_limits(quantity: str) -> tuple[F32, F32]:
    """Smallest and largest value that a vehicle can have, by code of the class, shape (class,)."""
    entries = [getattr(vehicle_class, quantity) for vehicle_class in vehicle_classes().values()]
    low = np.array([entry.low for entry in entries], np.float32)
    return low, np.array([entry.high for entry in entries], np.float32)


@cache
def _class_sigmas(quantity: str) -> F32:
    """Standard deviation of a quantity by code of the class, shape (class,).

    It is 0 where the file states none: all vehicles of the class then have the central value.
    """
    entries = [getattr(vehicle_class, quantity) for vehicle_class in vehicle_classes().values()]
    return np.array([entry.sigma or 0.0 for entry in entries], np.float32)


@cache
def _class_flags(name: str) -> NDArray[np.bool_]:
    """A flag of `VehicleClass` by code of the class, shape (class,)."""
    return np.array(
        [getattr(vehicle_class, name) for vehicle_class in vehicle_classes().values()], np.bool_
    )


@cache
def _colour_contrasts() -> F32:
    """Contrast against a bright horizon or fog, 0 to 1, by position in `COLOUR_NAMES`."""
    return np.array([colour.contrast.number for colour in colours().values()], np.float32)


def _quantity_from_normal(quantity: str, kind: U8, z: F32) -> F32:
    """Values of a quantity from standard normal numbers z: centre + sigma z, within its limits."""
    low, high = _class_limits(quantity)
    value = class_value(quantity, kind) + _class_sigmas(quantity)[kind] * z
    return clamp(value, low[kind], high[kind])


def _cg_height(kind: U8, mass: F32) -> F32:
    """Height of the centre of gravity, interpolated between an empty and a usual vehicle [m].

    Constant below the empty and above the usual mass.
    """
    mass_empty, usual_mass = class_value("mass_empty", kind), class_value("mass", kind)
    load_share = (mass - mass_empty) / (usual_mass - mass_empty)
    load_share = clamp(load_share, np.zeros_like(mass), np.ones_like(mass))
    low, high = class_value("cg_height_empty", kind), class_value("cg_height", kind)
    return low + load_share * (high - low)


def _complete_vehicles(body: DrawnBody) -> VehicleSpecs:
    """All fields of the vehicles, from the drawn fields and the numbers of their classes."""
    kind = body.kind
    wheelbase = class_value("wheelbase", kind)
    cg_to_front = class_value("cg_to_front_ratio", kind) * wheelbase
    # Product of the distances of the axles from the centre of gravity, a b. The yaw inertia is mass
    # times a b times a factor of the class, near 1 for cars.
    axle_distances = cg_to_front * (wheelbase - cg_to_front)
    class_fields = {
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
        yaw_inertia=class_value("inertia_factor", kind) * body.mass * axle_distances,
        # The usual mass of the class, because the load of a vehicle does not change its engine.
        power=class_value("specific_power", kind) * class_value("mass", kind),
        max_speed=class_value("governed_speed", kind),
        wind_centre_ratio=body.wind_centre_ratio,
        # Share of the engine's force on the front wheels: all or nothing.
        front_drive_share=body.has_front_drive.astype(np.float32),
        tyre_wear=body.tyre_wear,
        contrast=_colour_contrasts()[body.colour],
        two_wheeler=_class_flags("two_wheeler")[kind],
        # A property of the class, so it is also set on two-way roads, where it has no effect: no
        # rule of the law reads it, and `world.vehicle_parameters` only lets flagged vehicles hold
        # the speed at which they start.
        unlawful_presence=~_class_flags("motorway_allowed")[kind],
        **class_fields,
    )
