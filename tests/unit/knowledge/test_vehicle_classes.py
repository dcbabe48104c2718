"""Vehicle classes against other packages, type approval and what their numbers imply together."""

from __future__ import annotations

import math
from typing import cast

import pytest
from scipy.optimize import brentq
from scipy.stats import spearmanr
from vehiclemodels.parameters_vehicle1 import parameters_vehicle1
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.parameters_vehicle3 import parameters_vehicle3

from overtaking.core.units import kmh_from_mps, mps_from_kmh
from overtaking.knowledge.toml_reader import number
from overtaking.knowledge.vehicle_classes import (
    COLOUR_NAMES,
    VEHICLE_CLASS_NAMES,
    VehicleClass,
    colours,
    vehicle_classes,
)

GRAVITY = number("model.nature.gravity")
AIR_DENSITY = number("model.nature.air_density")

COMMONROAD = [parameters_vehicle1(), parameters_vehicle2(), parameters_vehicle3()]
FOUR_WHEELERS = ("S", "M", "L", "V", "T")
# What reaches the wheels of the power that is stated, while gears change.
USED_POWER = 0.9


def acceleration(vehicle: VehicleClass, speed: float) -> float:
    """Full-throttle acceleration on the flat, without wind [m/s^2]."""
    push = min(vehicle.launch_accel.number, USED_POWER * vehicle.specific_power.number / speed)
    drag = 0.5 * AIR_DENSITY * vehicle.drag_area.number * speed**2 / vehicle.mass.number
    return push - drag - GRAVITY * vehicle.rolling_resistance.number


def test_classes_come_in_the_order_of_their_codes():
    assert tuple(vehicle_classes()) == VEHICLE_CLASS_NAMES == ("S", "M", "L", "V", "T", "MC", "B")
    assert [name for name, item in vehicle_classes().items() if item.two_wheeler] == ["MC", "B"]
    assert [name for name, item in vehicle_classes().items() if not item.motorway_allowed] == ["B"]


# Computed once from the same power and drag, by hand, for 50, 80, 100 and 120 km/h.
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("S", (2.7, 1.5, 1.1, 0.7)),
        ("M", (3.7, 2.2, 1.6, 1.2)),
        ("L", (4.7, 2.8, 2.1, 1.6)),
        ("V", (2.3, 1.3, 0.9, 0.55)),
        ("T", (0.8, 0.4, 0.2, 0.0)),
        ("MC", (6.6, 6.3, 4.6, 3.4)),
    ],
)
def test_full_throttle_is_that_of_real_vehicles(name: str, expected: tuple[float, ...]):
    speeds = [mps_from_kmh(kmh) for kmh in (50.0, 80.0, 100.0, 120.0)]
    found = [acceleration(vehicle_classes()[name], speed) for speed in speeds]
    assert found == pytest.approx(expected, abs=0.06)


def test_a_cyclist_tops_out_just_below_the_speed_that_the_class_is_held_to():
    cyclist = vehicle_classes()["B"]
    top = cast("float", brentq(lambda speed: acceleration(cyclist, speed), 1.0, 100.0))
    assert kmh_from_mps(top) == pytest.approx(31.2, abs=0.1)
    assert top < cyclist.governed_speed.number < 1.05 * top


@pytest.mark.parametrize("name", ["S", "M", "L", "V", "MC"])
def test_a_vehicle_that_is_not_limited_can_go_faster_than_the_law_allows(name: str):
    vehicle = vehicle_classes()[name]
    assert acceleration(vehicle, vehicle.motorway_limit.number) > 0.4
    assert vehicle.governed_speed.number > vehicle.motorway_limit.number


def test_a_truck_is_held_at_its_legal_speed_by_its_limiter():
    truck = vehicle_classes()["T"]
    assert truck.governed_speed.number == truck.motorway_limit.number == 25.0


# Mean understeer gradient in degrees per g: front less rear cornering compliance.
@pytest.mark.parametrize(
    ("name", "gradient"), [("S", 1.6), ("M", 1.7), ("L", 1.6), ("V", 1.6), ("T", 0.9)]
)
def test_four_wheelers_understeer_mildly(name: str, gradient: float):
    vehicle = vehicle_classes()[name]
    compliance = 1.0 / vehicle.front_stiffness.number - 1.0 / vehicle.rear_stiffness.number
    assert math.degrees(compliance) == pytest.approx(gradient, abs=0.07)


@pytest.mark.parametrize("name", FOUR_WHEELERS)
def test_tyres_are_softer_than_the_sporty_ones_of_commonroad(name: str):
    vehicle = vehicle_classes()[name]
    sporty = min(-car.tire.p_ky1 for car in COMMONROAD)
    assert vehicle.front_stiffness.number < vehicle.rear_stiffness.number < sporty


@pytest.mark.parametrize("name", ["S", "M", "L", "V"])
def test_cars_are_built_like_those_of_commonroad(name: str):
    vehicle = vehicle_classes()[name]
    inertia = [car.I_z / (car.m * car.a * car.b) for car in COMMONROAD]
    assert min(inertia) - 0.05 < vehicle.inertia_factor.number < max(inertia) + 0.05
    front = [car.a / (car.a + car.b) for car in COMMONROAD]
    assert min(front) - 0.06 < vehicle.cg_to_front_ratio.number < max(front) + 0.06
    track = [car.T_f for car in COMMONROAD]
    assert min(track) < vehicle.track_width.number < max(track) + 0.15
    wheelbase = [(car.a + car.b) / car.l for car in COMMONROAD]
    ratio = vehicle.wheelbase.number / vehicle.length.number
    assert min(wheelbase) - 0.01 < ratio < max(wheelbase) + 0.09


@pytest.mark.parametrize(
    ("names", "floor"), [(("S", "M", "L"), 6.43), (("V", "T"), 5.0), (("MC",), 5.8)]
)
def test_brakes_exceed_type_approval(names: tuple[str, ...], floor: float):
    for name in names:
        assert vehicle_classes()[name].peak_decel.number > floor


@pytest.mark.parametrize("name", VEHICLE_CLASS_NAMES)
def test_comfortable_braking_is_far_below_the_hardest(name: str):
    vehicle = vehicle_classes()[name]
    hardest_comfort = vehicle.comfort_decel.high
    assert isinstance(hardest_comfort, float)
    assert hardest_comfort < 0.5 * vehicle.peak_decel.number


# Frontal area over width x height, and the published range of the coefficient.
@pytest.mark.parametrize(
    ("name", "fill", "lowest", "highest"),
    [
        ("S", 0.85, 0.22, 0.40),
        ("M", 0.85, 0.22, 0.40),
        ("L", 0.85, 0.22, 0.40),
        ("V", 0.80, 0.35, 0.50),
        ("T", 1.00, 0.55, 0.80),
        ("MC", 0.70, 0.50, 1.00),
    ],
)
def test_drag_lies_within_the_published_range(
    name: str, fill: float, lowest: float, highest: float
):
    vehicle = vehicle_classes()[name]
    area = fill * vehicle.width.number * vehicle.height.number
    assert lowest <= vehicle.drag_area.number / area <= highest


@pytest.mark.parametrize("name", VEHICLE_CLASS_NAMES)
def test_sizes_fit_into_each_other(name: str):
    vehicle = vehicle_classes()[name]
    box = vehicle.length.number * vehicle.height.number
    assert 0.3 * box < vehicle.side_area.number < box
    assert vehicle.wheelbase.number < vehicle.length.number
    assert vehicle.track_width.number < vehicle.width.number
    assert 0.0 < vehicle.cg_to_front_ratio.number < 1.0
    assert vehicle.cg_height_empty.number <= vehicle.cg_height.number < vehicle.height.number
    assert vehicle.mass_empty.number == vehicle.mass.low
    assert 0.0 <= vehicle.front_drive_share.number <= 1.0


@pytest.mark.parametrize("name", FOUR_WHEELERS)
def test_rear_lamps_are_where_un_r48_wants_them(name: str):
    vehicle = vehicle_classes()[name]
    inset = (vehicle.width.number - vehicle.lamp_separation.number) / 2.0
    assert 0.0 < inset <= 0.4
    assert vehicle.lamp_separation.number >= 0.6


def test_a_loaded_truck_tips_before_it_slides_far():
    truck = vehicle_classes()["T"]
    static_stability = truck.track_width.number / (2.0 * truck.cg_height.number)
    assert static_stability == pytest.approx(0.8, abs=0.02)
    for name in ("S", "M", "L"):
        car = vehicle_classes()[name]
        assert car.track_width.number / (2.0 * car.cg_height.number) > 1.3


def test_the_motorway_limits_are_those_of_article_27():
    limits = {
        name: kmh_from_mps(item.motorway_limit.number) for name, item in vehicle_classes().items()
    }
    assert limits == pytest.approx(
        {"S": 120, "M": 120, "L": 120, "V": 110, "T": 90, "MC": 120, "B": 120}, rel=1e-12
    )


def test_only_dimensions_that_differ_within_a_class_have_a_spread():
    for vehicle in vehicle_classes().values():
        assert vehicle.length.sigma is not None
        assert vehicle.mass.sigma is not None
        assert vehicle.width.sigma is None


def luminance(rgb: tuple[int, int, int]) -> float:
    """Relative luminance of an sRGB colour (IEC 61966-2-1)."""
    parts = [part / 255.0 for part in rgb]
    linear = [
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_a_darker_colour_has_more_contrast_against_fog():
    assert tuple(colours()) == COLOUR_NAMES
    light = [luminance(colour.rgb) for colour in colours().values()]
    contrast = [colour.contrast.number for colour in colours().values()]
    assert cast("float", spearmanr(light, contrast)[0]) < -0.99
    assert (min(contrast), max(contrast)) == (0.3, 0.8)


def test_colours_are_bytes_and_differ():
    seen = [colour.rgb for colour in colours().values()]
    assert len(set(seen)) == len(seen) == 8
    assert all(0 <= part <= 255 for rgb in seen for part in rgb)
