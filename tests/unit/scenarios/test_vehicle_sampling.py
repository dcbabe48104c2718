import dataclasses

import numpy as np
import pytest
from scipy import stats

from overtaking.knowledge.vehicle_classes import (
    COLOUR_NAMES,
    VEHICLE_CLASS_NAMES,
    colours,
    vehicle_classes,
)
from overtaking.model.vehicles import Colour, VehicleKind
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource

SMALLEST_P = 1e-3
KINDS = tuple(VehicleKind)


def of_kind(pinto, kind):
    """One field of every present vehicle of a type, by name."""
    here = pinto.vehicles.valid & (pinto.vehicles.kind == kind)
    return lambda name: getattr(pinto.vehicles, name)[here]


def test_names_and_codes_of_types_and_colours_agree():
    assert tuple(kind.code for kind in VehicleKind) == VEHICLE_CLASS_NAMES
    assert tuple(colour.name.lower() for colour in Colour) == COLOUR_NAMES


def test_types_come_as_often_as_their_weights_say(pinto):
    others = pinto.vehicles.valid.copy()
    others[:, 0] = False
    assert stats.chisquare(np.bincount(pinto.vehicles.kind[others])).pvalue > SMALLEST_P
    egos = np.bincount(pinto.vehicles.kind[:, 0], minlength=7)
    assert stats.chisquare(egos[:5]).pvalue > SMALLEST_P
    assert egos[5:].sum() == 0


def test_the_leader_is_of_any_type(pinto):
    assert stats.chisquare(np.bincount(pinto.vehicles.kind[:, 1])).pvalue > SMALLEST_P


def test_weights_change_types_and_colours(town06):
    chosen = load_specification(
        "pinto2023-physical",
        {"traffic.types": "{T = 1, S = 3}", "traffic.ego_types": "V", "traffic.colours": "red"},
    )
    vehicles = ScenarioSource(chosen, town06, seed=1).sample(np.arange(5_000)).vehicles
    others = vehicles.kind[:, 1:][vehicles.valid[:, 1:]]
    counts = np.bincount(others, minlength=7)
    expected = others.size * np.array([0.75, 0.25])
    assert stats.chisquare(counts[[0, 4]], expected).pvalue > SMALLEST_P
    assert np.all(vehicles.kind[:, 0] == VehicleKind.VAN)
    assert np.all(vehicles.colour == Colour.RED)


def test_all_colours_are_equally_likely_and_have_their_contrast(pinto):
    colour = pinto.vehicles.colour[pinto.vehicles.valid]
    assert stats.chisquare(np.bincount(colour)).pvalue > SMALLEST_P
    contrasts = np.array([one.contrast.number for one in colours().values()], np.float32)
    np.testing.assert_array_equal(pinto.vehicles.contrast, contrasts[pinto.vehicles.colour])


@pytest.mark.parametrize("kind", KINDS)
def test_length_and_mass_are_truncated_normal(pinto, kind):
    field = of_kind(pinto, kind)
    known = vehicle_classes()[kind.code]
    for name in ("length", "mass"):
        entry = getattr(known, name)
        values = field(name)
        assert values.min() == pytest.approx(entry.low, rel=1e-6)
        assert values.max() == pytest.approx(entry.high, rel=1e-6)
        inside = values[(values > entry.low + 1e-3) & (values < entry.high - 1e-3)]
        low, high = ((end - entry.number) / entry.sigma for end in (entry.low, entry.high))
        standard = stats.truncnorm(low, high).cdf
        assert stats.kstest((inside - entry.number) / entry.sigma, standard).pvalue > SMALLEST_P


def test_length_mass_and_wear_are_independent(pinto):
    field = of_kind(pinto, VehicleKind.MEDIUM_CAR)
    drawn = [field(name) for name in ("length", "mass", "wind_centre_ratio", "tyre_wear")]
    correlation = np.corrcoef(np.stack(drawn)) - np.eye(4)
    assert np.abs(correlation).max() < 5 / np.sqrt(drawn[0].size)


@pytest.mark.parametrize("kind", KINDS)
def test_what_follows_from_size_and_mass_is_physical(pinto, kind):
    field = of_kind(pinto, kind)
    known = vehicle_classes()[kind.code]
    assert np.all(field("wheelbase") < field("length"))
    assert np.all((field("cg_to_front") > 0) & (field("cg_to_front") < field("wheelbase")))
    to_rear = field("wheelbase") - field("cg_to_front")
    inertia = field("mass") * field("cg_to_front") * to_rear * known.inertia_factor.number
    np.testing.assert_allclose(field("yaw_inertia"), inertia, rtol=1e-5)
    assert np.all(field("cg_height") <= known.cg_height.number * (1 + 1e-6))
    assert np.all(field("cg_height") >= known.cg_height_empty.number * (1 - 1e-6))
    assert set(field("front_drive_share")) <= {0.0, 1.0}
    share = field("front_drive_share").mean()
    assert share == pytest.approx(known.front_drive_share.number, abs=0.02)
    assert np.all(field("two_wheeler") == (kind in (VehicleKind.MOTORCYCLE, VehicleKind.BICYCLE)))


def test_an_empty_truck_is_lower_than_a_loaded_one(pinto):
    field = of_kind(pinto, VehicleKind.TRUCK)
    empty = field("mass") < 7_000
    loaded = field("mass") > 12_000
    assert field("cg_height")[empty].max() < 1.05
    assert field("cg_height")[loaded].min() == pytest.approx(1.3)


def test_most_tyres_are_half_worn_and_few_are_bald(pinto):
    wear = pinto.vehicles.tyre_wear[pinto.vehicles.valid]
    assert stats.kstest(wear, stats.triang(0.35).cdf).pvalue > SMALLEST_P
    assert np.mean(wear > 0.9) < 0.05


def test_bicycles_are_unlawful_and_can_hold_the_speed_they_want(pinto):
    bicycle = pinto.vehicles.kind == VehicleKind.BICYCLE
    np.testing.assert_array_equal(pinto.vehicles.unlawful_presence, bicycle)
    speed = pinto.drivers.desired_speed[bicycle].astype(np.float64)
    assert speed.min() > 40 / 3.6
    vehicles = {
        name: getattr(pinto.vehicles, name)[bicycle].astype(np.float64)
        for name in ("power", "drag_area", "rolling_resistance", "mass", "max_speed")
    }
    drag = 0.5 * 1.20 * vehicles["drag_area"] * speed**2
    rolling = vehicles["rolling_resistance"] * vehicles["mass"] * 9.81
    assert np.all(0.9 * vehicles["power"] > (drag + rolling) * speed)
    assert np.all(vehicles["max_speed"] >= speed - 1e-4)


def test_only_bicycles_are_stronger_than_their_class(pinto):
    for kind in KINDS[:-1]:
        known = vehicle_classes()[kind.code]
        field = of_kind(pinto, kind)
        assert set(field("max_speed")) == {np.float32(known.governed_speed.number)}
        power = known.specific_power.number * known.mass.number
        np.testing.assert_allclose(field("power"), power, rtol=1e-6)


def test_empty_slots_hold_finite_numbers(pinto):
    for name in pinto.vehicles.__dataclass_fields__:
        assert np.all(np.isfinite(getattr(pinto.vehicles, name))), name
    assert np.all(pinto.vehicles.mass > 0)


def test_as_many_trucks_pull_semitrailers_as_the_profile_says():
    road, index = load_road("rural"), np.arange(400, dtype=np.uint64)
    without, some = (
        ScenarioSource(load_specification("rural", {"traffic.semitrailers": share}), road, 1)
        .sample(index)
        .vehicles
        for share in (0.0, 0.25)
    )
    trucks = some.kind == VehicleKind.TRUCK
    pulls = trucks & (some.length == 16.5)
    assert stats.binomtest(int(pulls.sum()), int(trucks.sum()), 0.25).pvalue > SMALLEST_P
    assert np.all(some.mass[pulls] == 28_000.0)
    assert np.all(some.height[pulls] == 4.0)
    # The wind pushes a loaded semitrailer less, for its mass, than a rigid truck.
    assert np.all(some.side_area[pulls] / some.mass[pulls] < 24.0 / 12_000.0)
    arms = some.yaw_inertia / some.mass
    np.testing.assert_allclose(arms[pulls], (without.yaw_inertia / without.mass)[pulls], rtol=1e-6)
    for field in dataclasses.fields(some):
        now, before = getattr(some, field.name), getattr(without, field.name)
        np.testing.assert_array_equal(now[~pulls], before[~pulls])
