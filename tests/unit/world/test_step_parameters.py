"""From a scenario to the numbers of the step: switches, speeds in bad weather, left and right."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.support.worlds import Vehicle, body_of, scenario, wide_road

from overtaking.world.constants import EnabledEffects
from overtaking.world.driver_parameters import (
    ONCOMING_JUDGEMENT_FIELDS,
    REACTION_TO_ONCOMING_FIELDS,
)
from overtaking.world.road_parameters import road_parameters
from overtaking.world.step_parameters import (
    SIMULATION_FIELDS,
    step_parameters,
    with_forced_decision,
)

if TYPE_CHECKING:
    from overtaking.model.scenario import Scenario

KMH = 1.0 / 3.6
STORM: dict[str, float] = {
    "rain": 100.0,
    "puddles": 100.0,
    "wind": 100.0,
    "fog": 80.0,
    "wind_direction": 1.0,
}


def step_fields(world: Scenario, effects: EnabledEffects | None = None) -> tuple[Any, Any]:
    """Vehicle and simulation parameters by name."""
    given = step_parameters(world, effects)
    return given.vehicles, given.simulations


def wanted(weather: dict[str, float], *, limit: float = 50.0, **driver: float) -> float:
    """Speed that a driver wants [m/s]."""
    one = Vehicle(speed=25.0, driver={"desired_speed": 40.0} | driver)
    p, _ = step_fields(scenario([one], road=wide_road(limit=limit), weather=weather))
    return float(p.desired_speed[0, 0])


def test_names_and_rows_belong_together():
    p, q = step_fields(scenario([Vehicle(kind="V", s=12.0, lane=1, speed=20.0)], weather=STORM))
    body = body_of("V")
    assert float(p.mass[0, 0]) == body["mass"]
    assert float(p.half_length[0, 0]) == pytest.approx(0.5 * body["length"])
    assert float(p.start_s[0, 0]) == 12.0
    assert float(p.start_lane[0, 0]) == 1.0
    assert float(q.last_step[0]) == 2000.0
    assert float(p.cg_front[0, 0] + p.cg_rear[0, 0]) == pytest.approx(body["wheelbase"])
    assert float(p.inverse_mass[0, 0] * p.mass[0, 0]) == pytest.approx(1.0)


def test_a_name_that_does_not_exist_is_refused():
    p, _ = step_fields(scenario([Vehicle()]))
    with pytest.raises(AttributeError):
        _ = p.colour


@pytest.mark.parametrize(
    ("effect", "field", "off"),
    [
        ("film", "film_rain_factor", 0.0),
        ("film", "min_wet_film", 0.0),
        ("film", "puddle_film", 0.0),
        ("gusts", "gust_gain", 0.0),
        ("range", "fog_extinction", 0.0),
        ("range", "rain_extinction", 0.0),
        ("delay", "detection_time", 0.0),
        ("distance_error", "distance_error", 0.0),
        ("distance_error", "speed_error", 0.0),
    ],
)
def test_an_effect_that_is_switched_off_is_gone_and_the_others_stay(
    effect: str, field: str, off: float
):
    world = scenario([Vehicle()], weather=STORM)
    _, whole = step_fields(world)
    _, without = step_fields(world, EnabledEffects(**{effect: False}))
    assert float(getattr(whole, field)[0]) != off
    assert float(getattr(without, field)[0]) == off
    untouched = {"film": "wind_across", "gusts": "film_rain_factor"}.get(effect, "gust_gain")
    assert float(getattr(without, untouched)[0]) == float(getattr(whole, untouched)[0])


def test_ablations_of_constants_touch_only_theirs():
    world = scenario([Vehicle()])
    whole = dataclasses.asdict(step_parameters(world).constants)
    for effect, name in (
        ("gusts", "turbulence_intensity"), ("wake", "shelter_factor"),
        ("looming", "looming_threshold"), ("delay", "detection_growth"),
    ):  # fmt: skip
        values = dataclasses.asdict(
            step_parameters(world, EnabledEffects(**{effect: False})).constants
        )
        assert {key for key in whole if whole[key] != values[key]} == {name}


def test_on_a_road_of_one_direction_the_fields_of_oncoming_traffic_are_zero():
    vehicles, simulations = step_fields(scenario([Vehicle()]))
    for field in REACTION_TO_ONCOMING_FIELDS:
        assert not getattr(vehicles, field).any(), field
    for field in ONCOMING_JUDGEMENT_FIELDS:
        assert not getattr(simulations, field).any(), field


def test_a_reckless_driver_does_not_slow_for_weather_and_a_cautious_one_does():
    for weather in ({"rain": 100.0}, {"fog": 95.0}):
        assert wanted(weather, caution=0.0) == pytest.approx(40.0)
        assert wanted(weather, caution=1.0) < 36.0
        half = wanted(weather, caution=0.5)
        assert half == pytest.approx(0.5 * (40.0 + wanted(weather, caution=1.0)), rel=1e-5)


@pytest.mark.parametrize(("rain", "slower_kmh"), [(30.0, 0.0), (45.0, 10.1), (100.0, 19.1)])
def test_heavy_rain_slows_by_what_was_measured_on_motorways(rain: float, slower_kmh: float):
    # 0.25 to 6.4 mm/h hardly any; above, 10 to 19 km/h. From 25 m/s sight and grip ask for no more.
    # Scale: 45 % is 6.8 mm/h.
    speed = wanted({"rain": rain}, desired_speed=22.0, caution=1.0)
    assert (22.0 - speed) / KMH == pytest.approx(slower_kmh, abs=0.3)


def test_in_thick_fog_a_cautious_driver_can_stop_within_sight():
    # 50 m: seen at contrast 0.5 after ln(10) / 0.06 = 38 m; a fog lamp is not reckoned with, 8 cd
    # shine 66 m by day at 1e-4 lx. 1.2 s of reaction, then 0.8 g of dry grip 0.875.
    speed = wanted({"fog": 100.0}, caution=1.0)
    decel = 0.8 * 0.875 * 9.81
    seen = speed * 1.2 + speed**2 / (2.0 * decel)
    assert 38.0 <= seen <= 67.0


def test_respect_for_the_limit_gives_up_its_share_of_the_excess():
    assert wanted({}, limit=30.0, speed_limit_compliance=0.0) == pytest.approx(40.0)
    assert wanted({}, limit=30.0, speed_limit_compliance=0.7) == pytest.approx(33.0)
    assert wanted({}, limit=30.0, speed_limit_compliance=1.0) == pytest.approx(30.0)
    assert wanted({}, limit=30.0, speed_limit_compliance=1.0, desired_speed=25.0) == pytest.approx(
        25.0
    )


def test_nobody_wants_to_drive_faster_than_the_vehicle_can():
    lorry = Vehicle(kind="T", speed=20.0, driver={"desired_speed": 40.0})
    p, _ = step_fields(scenario([lorry], road=wide_road()))
    assert float(p.desired_speed[0, 0]) == pytest.approx(25.0)
    assert float(p.passing_speed[0, 0]) == pytest.approx(25.0)


@pytest.mark.parametrize(
    ("weather", "factor"),
    [({}, 1.0), ({"night": 1.0}, 1.2), ({"fog": 80.0}, 1.1), ({"rain": 100.0}, 1.1)],
)
def test_reactions_are_slower_at_night_and_in_haze(weather: dict[str, float], factor: float):
    p, _ = step_fields(scenario([Vehicle(driver={"reaction_time": 1.0})], weather=weather))
    assert float(p.reaction_delay[0, 0]) == round(20.0 * factor)
    assert float(p.urgent_reaction_delay[0, 0]) == 20.0


def test_a_lane_change_takes_as_long_as_the_grip_asks_for():
    quick = Vehicle(driver={"lane_change_duration": 2.5})
    for rain in (0.0, 60.0, 100.0):
        p, q = step_fields(scenario([quick], road=wide_road(), weather={"rain": rain}))
        dared = float(q.max_lateral_accel[0])
        duration = float(p.lane_change_duration[0, 0])
        # Its peak, 5.77 D / T^2, is 0.7 of what the driver dares, or the driver's own is longer.
        assert duration == pytest.approx(max(2.5, math.sqrt(5.77 * 3.5 / (0.7 * dared))), rel=1e-5)


def test_interaction_and_exponent_follow_from_the_driver():
    p, _ = step_fields(scenario([Vehicle(driver={"accel": 1.2, "decel": 2.4})]))
    assert float(p.idm_interaction[0, 0]) == pytest.approx(0.5 / math.sqrt(1.2 * 2.4))
    assert float(p.overspeed_exponent[0, 0]) == pytest.approx(4.0 * 1.2 / 2.4)


def test_left_hand_traffic_is_the_mirror_image():
    road = wide_road(lanes=3)
    one, other = road_parameters(road), road_parameters(road.mirror())
    np.testing.assert_array_equal(one.boundaries, other.boundaries)
    np.testing.assert_array_equal(one.film_path, other.film_path)
    assert (float(one.overtaking_sign), float(other.overtaking_sign)) == (1.0, -1.0)
    weather = {"wind": 50.0, "wind_direction": 0.7}
    mirrored = weather | {"wind_direction": -0.7}
    _, right = step_fields(scenario([Vehicle()], road=road, weather=weather))
    _, left = step_fields(scenario([Vehicle()], road=road.mirror(), weather=mirrored))
    assert float(right.wind_across[0]) == float(left.wind_across[0]) > 0.0
    assert float(right.wind_along[0]) == float(left.wind_along[0])


@pytest.mark.parametrize(("percent", "speed"), [(10.0, 2.0), (60.0, 12.0), (100.0, 20.0)])
def test_the_wind_blows_to_where_it_is_said_to(percent: float, speed: float):
    for angle in (0.0, 1.0, 2.5, -2.0):
        weather = {"wind": percent, "wind_direction": angle}
        _, q = step_fields(scenario([Vehicle()], weather=weather))
        assert float(q.wind_along[0]) == pytest.approx(speed * math.cos(angle), abs=1e-5)
        assert float(q.wind_across[0]) == pytest.approx(speed * math.sin(angle), abs=1e-5)


def test_a_low_sun_ahead_takes_contrast_ahead_and_one_behind_does_so_in_the_mirror():
    low = {"sun_altitude": math.radians(6.0), "cloudiness": 10.0}
    _, ahead = step_fields(scenario([Vehicle()], weather=low | {"sun_azimuth": 0.1}))
    _, behind = step_fields(scenario([Vehicle()], weather=low | {"sun_azimuth": math.pi - 0.1}))
    _, aside = step_fields(scenario([Vehicle()], weather=low | {"sun_azimuth": 1.5}))
    assert float(ahead.log_contrast_sensitivity_ahead[0]) < float(
        aside.log_contrast_sensitivity_ahead[0]
    )
    assert float(ahead.log_contrast_sensitivity_behind[0]) == float(
        aside.log_contrast_sensitivity_behind[0]
    )
    assert float(behind.log_contrast_sensitivity_behind[0]) == pytest.approx(
        float(ahead.log_contrast_sensitivity_ahead[0]), abs=1e-4
    )


def test_a_forced_decision_changes_nothing_else():
    given = step_parameters(scenario([Vehicle()]))
    forced = with_forced_decision(given, 3)
    row = SIMULATION_FIELDS.index("forced_decision")
    assert float(forced.simulation_table[row, 0]) == 3.0
    rest = np.delete(np.arange(len(SIMULATION_FIELDS)), row)
    np.testing.assert_array_equal(forced.simulation_table[rest], given.simulation_table[rest])
    assert float(given.simulation_table[row, 0]) == 0.0


@pytest.mark.parametrize(("interval", "frames"), [(10, 2001), (50, 401), (100, 201)])
def test_the_number_of_frames_follows_from_horizon_and_interval(interval: int, frames: int):
    given = step_parameters(scenario([Vehicle()], frame_interval_ms=interval))
    assert given.num_frames == frames
