"""Evaluations of drivers: weights, intervals, conflicts and lane changes with known results."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.multitest import multipletests

from overtaking.analysis.evaluation import bootstrap, competent, measures
from overtaking.analysis.evaluation.benchmark import hash_of, names, read
from overtaking.analysis.evaluation.lane_changes import needed_braking
from overtaking.analysis.evaluation.origins import Origin, _Scene
from overtaking.analysis.evaluation.run import scenes_of
from overtaking.core.errors import ConfigError
from overtaking.model.trajectories import Lights
from overtaking.recordings.roads import load_road
from overtaking.scenarios import profiles
from overtaking.scenarios.sampler import ScenarioSource

NIGHTS = [
    {
        "name": "nights",
        "share": 0.5,
        "powers": {"ego_driving_style": 0.35},
        "parts": {"sun": [0.0, 0.5]},
        "shifts": {"ego_time_gap": -0.5},
    }
]

FEW_VEHICLES = {"traffic.vehicles": [2, 12], "traffic.sight_m": [5.0, 10.0]}
"""A small number saves time; the ego's short sight distance makes so few vehicles sufficient."""


@pytest.fixture(scope="module")
def full_and_scene_batches():
    """Motorway scenarios weighted with the ego, and the same scenes weighted without it."""
    spec = profiles.load_specification("motorway", {"proposal": NIGHTS, **FEW_VEHICLES})
    road, index = load_road(spec.road), np.arange(3000, dtype=np.uint64)
    return [
        ScenarioSource(specification, road, 5).sample(index)
        for specification in (spec, scenes_of(spec))
    ]


def is_low_sun(scenes) -> np.ndarray:
    """Whether a scene is from the half of sun altitudes that the proposal draws more often.

    The sun is a monotonic function of its random number, so that an altitude separates the halves.
    """
    is_low = scenes.weight < 1.0
    assert scenes.weather.sun_altitude[is_low].max() < scenes.weather.sun_altitude[~is_low].min()
    return is_low


def test_the_weight_of_a_scene_is_the_inverse_ratio_of_its_draws(full_and_scene_batches):
    """Share 0.5 comes from the lower half: r = 2 there, 0 elsewhere, w = 1 / (0.5 + 0.5 r)."""
    _, scenes = full_and_scene_batches
    is_low = is_low_sun(scenes)
    np.testing.assert_allclose(scenes.weight[is_low], 2.0 / 3.0, rtol=1e-5)
    np.testing.assert_allclose(scenes.weight[~is_low], 2.0, rtol=1e-5)


def test_the_mean_weight_over_egos_is_the_weight_of_the_scene(full_and_scene_batches):
    """The proposal changes the ego at low sun only, so weights spread around 2 / 3 only there."""
    full, scenes = full_and_scene_batches
    np.testing.assert_array_equal(full.weather.sun_altitude, scenes.weather.sun_altitude)
    is_low = is_low_sun(scenes)
    np.testing.assert_allclose(full.weight[~is_low], 2.0, rtol=1e-5)  # No draw changed there.
    weight = full.weight[is_low]
    assert np.ptp(weight) > 0.5
    standard_error = weight.std() / np.sqrt(len(weight))
    # A third of the draws at low sun are natural: weighting restores the mean over the ego.
    assert abs(weight.mean() - 2.0 / 3.0) < 4.0 * standard_error


def test_weighted_shares_equal_shares_of_unweighted_sampling(full_and_scene_batches):
    _, scenes = full_and_scene_batches
    is_low = is_low_sun(scenes)
    # Share 0.5 comes from the lower half, and half of the other draws fall into it.
    assert is_low.mean() == pytest.approx(0.75, abs=0.04)
    standard_error = 0.5 / np.sqrt(len(is_low))
    assert abs((scenes.weight * is_low).mean() - 0.5) < 4.0 * standard_error
    natural_spec = profiles.load_specification("motorway", FEW_VEHICLES)
    natural_batch = ScenarioSource(natural_spec, load_road(natural_spec.road), 6).sample(
        np.arange(3000, dtype=np.uint64)
    )
    highest_low_sun = scenes.weather.sun_altitude[is_low].max()
    assert (
        abs((natural_batch.weather.sun_altitude <= highest_low_sun).mean() - 0.5)
        < 4.0 * standard_error
    )
    for trait in ("time_gap", "reaction_time", "gap_demand_factor"):
        weighted_values, natural_values = (
            getattr(batch.drivers, trait)[:, 0] for batch in (scenes, natural_batch)
        )
        assert tuple(stats.ks_2samp(weighted_values, natural_values))[1] > 1e-3


def test_a_proposal_that_changes_only_the_ego_leaves_all_scene_weights_at_one():
    ego = [{"name": "ego", "share": 0.4, "powers": {"ego_driving_style": 0.3}}]
    spec = profiles.load_specification("motorway", {"proposal": ego, **FEW_VEHICLES})
    scenes = ScenarioSource(scenes_of(spec), load_road(spec.road), 1).sample(
        np.arange(50, dtype=np.uint64)
    )
    np.testing.assert_array_equal(scenes.weight, 1.0)


@pytest.mark.ci
def test_holms_correction_equals_statsmodels():
    p_values = [0.001, 0.2, 0.012, float("nan"), 0.04, 0.013, 0.9]
    numbers = [value for value in p_values if value == value]
    expected = np.asarray(multipletests(numbers, method="holm")[1], np.float64)
    adjusted = [value for value in bootstrap.holm(p_values) if value == value]
    np.testing.assert_allclose(adjusted, expected)


@pytest.mark.parametrize("number", [0, 1, 7])
def test_intervals_of_few_weighted_events_follow_the_gamma_method(number):
    rng = np.random.default_rng(3)
    weight = rng.uniform(0.3, 2.0, 400)
    num_events = np.zeros(400)
    num_events[:number] = 1.0
    parts = weight * num_events / weight.sum()
    rate, variance, largest_part = parts.sum(), (parts**2).sum(), weight.max() / weight.sum()
    upper_rate, upper_variance = rate + largest_part, variance + largest_part**2
    high = stats.gamma.ppf(0.975, upper_rate**2 / upper_variance, scale=upper_variance / upper_rate)
    low = stats.gamma.ppf(0.025, rate**2 / variance, scale=variance / rate) if number else 0.0
    assert bootstrap.rare_interval(weight, num_events) == pytest.approx((low, high), rel=1e-6)


def test_intervals_of_paired_differences_equal_the_standard_error():
    rng = np.random.default_rng(1)
    scene_values = rng.normal(10.0, 3.0, 500)
    columns = {
        name: {"part": scene_values + rng.normal(mean_difference, 0.5, 500), "whole": np.ones(500)}
        for name, mean_difference in (("a", 0.07), ("b", 0.0))
    }
    resampled = bootstrap.Resampled(np.ones(500), columns)
    (ratio_a, repeats_a), (ratio_b, repeats_b) = (
        resampled.ratio(driver, "part", "whole") for driver in "ab"
    )
    low, high = bootstrap.interval(repeats_a - repeats_b)
    difference = columns["a"]["part"] - columns["b"]["part"]
    standard_error = difference.std(ddof=1) / np.sqrt(500)
    assert ratio_a - ratio_b == pytest.approx(difference.mean())
    assert high - low == pytest.approx(2.0 * 1.96 * standard_error, rel=0.1)
    expected_p = 2.0 * stats.norm.sf(abs(ratio_a - ratio_b) / standard_error)
    assert expected_p > 1e-6
    assert bootstrap.two_sided(ratio_a - ratio_b, repeats_a - repeats_b) == pytest.approx(
        expected_p, rel=0.4
    )


def test_the_effective_number_of_scenes_follows_kish():
    effective, largest_share = bootstrap.concentration(np.array([3.0, 1.0, 0.0]))
    # (3 + 1)^2 / (9 + 1) = 1.6; 3 / 4 = 0.75.
    assert (effective, largest_share) == (pytest.approx(1.6), 0.75)


def test_a_follower_with_the_needed_braking_ends_with_a_time_gap_of_one_second():
    ego_speed, follower_speed, gap = 25.0, 33.0, 48.0
    deceleration = float(
        needed_braking(np.array([gap]), np.array([ego_speed]), np.array([follower_speed]))[0]
    )
    # The follower reacts after 0.4 s (UN R79, 5.6.4.7).
    time, step, speed = 0.0, 1e-4, follower_speed
    while speed > ego_speed:
        gap -= (speed - ego_speed) * step
        speed -= deceleration * step if time > 0.4 else 0.0
        time += step
    assert gap == pytest.approx(1.0 * ego_speed, abs=0.01)
    decelerations = needed_braking(
        np.array([np.inf, 5.0, 5.0]), np.full(3, ego_speed), np.array([40.0, 20.0, 30.0])
    )
    np.testing.assert_array_equal(decelerations, [0.0, 0.0, np.inf])


def two_vehicle_run(
    gap: float, *, speed: float = 30.0, partner_speed: float = 10.0, frames: int = 40
):
    """The ego and a partner, both 4 m long, in one lane at constant speeds, 20 frames a second.

    Args:
        gap: Distance between the ego's front and the partner's rear at time 0 [m].
        speed: Speed of the ego [m/s].
        partner_speed: Speed of the partner [m/s].
        frames: Number of frames.
    """
    time = 0.05 * np.arange(frames)
    s = np.stack([speed * time, gap + 4.0 + partner_speed * time])
    shape = (1, 2, frames)
    states = SimpleNamespace(
        s=np.rint(1e3 * s).astype(np.int32)[None],
        d=np.zeros(shape, np.int32),
        speed=np.rint(1e3 * np.array([speed, partner_speed]))[None, :, None].repeat(frames, 2),
        accel_lon=np.zeros(shape, np.int16),
        lane=np.ones(shape, np.uint8),
        lights=np.zeros(shape, np.uint8),
    )
    vehicles = SimpleNamespace(
        length=np.full((1, 2), 4.0), width=np.full((1, 2), 1.8), valid=np.ones((1, 2), bool)
    )
    road = SimpleNamespace(
        lane_boundaries=(-5.25, -1.75, 1.75, 5.25), num_lanes=3, overtaking_sign=1
    )
    scenario = SimpleNamespace(frame_interval_ms=50, vehicles=vehicles)
    return SimpleNamespace(states=states, scenario=scenario, road=road)


def test_a_competent_driver_avoids_contact_if_the_gap_exceeds_its_stopping_formula():
    """UN R157: evaluation 0.4 s, delay 0.75 s, a ramp of 0.6 s to 0.774 g, then full braking."""
    speed_difference, deceleration, jerk = 20.0, 7.593, 12.65
    ramp = deceleration / jerk
    needed_gap = speed_difference * (1.15 + ramp) - jerk * ramp**3 / 6.0
    needed_gap += (speed_difference - 0.5 * deceleration * ramp) ** 2 / (2.0 * deceleration)
    for extra_gap, expected in ((0.3, True), (-0.3, False)):
        is_prevented = competent.prevents(
            two_vehicle_run(needed_gap + extra_gap), 0, 1, 0, 20, friction=1.0, waits_for_risk=False
        )
        assert is_prevented is expected
    assert not competent.prevents(
        two_vehicle_run(needed_gap + 0.3), 0, 1, 0, 20, friction=0.4, waits_for_risk=False
    )


def test_a_competent_driver_reacts_to_a_cut_in_only_below_2_s_to_collision():
    """At 60 m and 20 m/s the time to collision falls below 2 s after 1 s, too late for braking."""
    prevented_by_waiting, prevented_at_once = (
        competent.prevents(
            two_vehicle_run(60.0), 0, 1, 0, 20, friction=1.0, waits_for_risk=waits_for_risk
        )
        for waits_for_risk in (True, False)
    )
    assert (prevented_by_waiting, prevented_at_once) == (False, True)


def origin_of(runs, frame: int = 39):
    batch = SimpleNamespace(runs=runs, interval_s=0.05)
    return _Scene(batch, 0, frame, 1).origin()


def test_the_origin_of_a_conflict_is_an_approach_a_lane_change_a_cut_in_or_braking():
    assert origin_of(two_vehicle_run(40.0))[0] is Origin.OWN_APPROACH
    assert origin_of(two_vehicle_run(-20.0))[0] is Origin.FROM_BEHIND

    ego_change = two_vehicle_run(40.0)
    ego_change.states.lane[0, 0, :20] = 0
    assert origin_of(ego_change)[0] is Origin.OWN_CHANGE

    cut_in = two_vehicle_run(40.0)
    cut_in.states.lane[0, 1, :20] = 0
    cut_in.states.d[0, 1] = np.rint(np.interp(np.arange(40), [0, 5, 35], [-3500, -3500, 0]))
    origin, perceived = origin_of(cut_in)
    assert origin is Origin.CUT_IN
    # UN R157: other drivers perceive a cut-in from 0.375 m beside the centre of the lane.
    assert cut_in.states.d[0, 1, perceived] > -3500 + 375 >= cut_in.states.d[0, 1, perceived - 1]

    partner_braking = two_vehicle_run(40.0)
    partner_braking.states.accel_lon[0, 1, 25:] = -3000
    partner_braking.states.lights[0, 1, 22:] = Lights.BRAKE
    assert origin_of(partner_braking) == (Origin.BRAKING, 22)


def test_time_gained_is_the_lead_in_distance_over_the_speed_of_the_slower_driver(monkeypatch):
    monkeypatch.setattr(measures, "_last_sound", lambda _: np.array([39]))
    fast_run, slow_run = two_vehicle_run(90.0, speed=30.0), two_vehicle_run(90.0, speed=20.0)
    # 10 m/s for 39 frames of 0.05 s is the lead; the slow ego needs 1 / 20 s per metre.
    assert measures.gained(fast_run, slow_run)[0] == pytest.approx(0.5 * 39 * 0.05, rel=1e-3)


def test_a_benchmark_of_another_profile_model_or_endpoint_is_refused(tmp_path):
    for name in names():
        assert read(name).parts
    profile_path = Path(profiles.__file__).with_name("profiles").joinpath("motorway.toml")
    assert hash_of(profiles.load_specification(profile_path)) == hash_of(
        profiles.load_specification("motorway")
    )
    benchmark_text = (
        Path(bootstrap.__file__).with_name("benchmarks").joinpath("overtake.toml").read_text()
    )
    for old, new, message in (
        ('sha256 = "', 'sha256 = "0', "the profile"),
        ('model_version = "2"', 'model_version = "1"', "model"),
        ('"gained"', '"won"', "endpoints"),
        ("version = 1", "", "a benchmark"),
    ):
        assert old in benchmark_text
        changed = tmp_path / "changed.toml"
        changed.write_text(benchmark_text.replace(old, new, 1))
        with pytest.raises(ConfigError, match=message):
            read(changed)
    with pytest.raises(ConfigError, match="overtake"):
        read("overtakes")


def test_the_error_for_a_missing_benchmark_file_names_its_path(tmp_path):
    with pytest.raises(ConfigError, match=r"missing\.toml: .*readable TOML file.*correct the path"):
        read(tmp_path / "missing.toml")
