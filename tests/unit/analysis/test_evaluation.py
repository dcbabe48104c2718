"""Evaluations of drivers: weights, intervals, conflicts and lane changes, against known answers."""

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
"""Few vehicles are drawn faster; the ego sees a short distance, so that they are enough."""


@pytest.fixture(scope="module")
def drawn():
    spec = profiles.load_specification("motorway", {"proposal": NIGHTS, **FEW_VEHICLES})
    road, index = load_road(spec.road), np.arange(3000, dtype=np.uint64)
    return [ScenarioSource(one, road, 5).sample(index) for one in (spec, scenes_of(spec))]


def below(scenes) -> np.ndarray:
    """Scenes from the part that is bent; an edge apart, as the sun is a function of its number."""
    low = scenes.weight < 1.0
    assert scenes.weather.sun_altitude[low].max() < scenes.weather.sun_altitude[~low].min()
    return low


def test_weights_are_those_of_the_scene_alone(drawn):
    """Half are drawn from the lower half: r = 2 there and 0 elsewhere, w = 1 / (0.5 + 0.5 r)."""
    _, scenes = drawn
    low = below(scenes)
    np.testing.assert_allclose(scenes.weight[low], 2.0 / 3.0, rtol=1e-5)
    np.testing.assert_allclose(scenes.weight[~low], 2.0, rtol=1e-5)


def test_the_ego_is_integrated_out(drawn):
    """The mean weight of all egos that a scene may have is the weight of the scene."""
    full, scenes = drawn
    np.testing.assert_array_equal(full.weather.sun_altitude, scenes.weather.sun_altitude)
    low = below(scenes)
    np.testing.assert_allclose(full.weight[~low], 2.0, rtol=1e-5)  # Nothing was bent there.
    weight = full.weight[low]
    assert np.ptp(weight) > 0.5
    error = weight.std() / np.sqrt(len(weight))
    # Of what is drawn there a third is as met: weighting gives back the mean over the ego.
    assert abs(weight.mean() - 2.0 / 3.0) < 4.0 * error


def test_weighted_shares_are_those_that_brute_force_knows(drawn):
    _, scenes = drawn
    low = below(scenes)
    assert low.mean() == pytest.approx(0.75, abs=0.04)
    error = 0.5 / np.sqrt(len(low))
    assert abs((scenes.weight * low).mean() - 0.5) < 4.0 * error
    natural = profiles.load_specification("motorway", FEW_VEHICLES)
    met = ScenarioSource(natural, load_road(natural.road), 6).sample(
        np.arange(3000, dtype=np.uint64)
    )
    edge = scenes.weather.sun_altitude[low].max()
    assert abs((met.weather.sun_altitude <= edge).mean() - 0.5) < 4.0 * error
    for one in ("time_gap", "reaction_time", "gap_demand_factor"):
        own, theirs = (getattr(each.drivers, one)[:, 0] for each in (scenes, met))
        assert tuple(stats.ks_2samp(own, theirs))[1] > 1e-3


def test_a_component_that_bends_the_ego_only_changes_nothing():
    ego = [{"name": "ego", "share": 0.4, "powers": {"ego_driving_style": 0.3}}]
    spec = profiles.load_specification("motorway", {"proposal": ego, **FEW_VEHICLES})
    some = ScenarioSource(scenes_of(spec), load_road(spec.road), 1).sample(
        np.arange(50, dtype=np.uint64)
    )
    np.testing.assert_array_equal(some.weight, 1.0)


@pytest.mark.ci
def test_holm_is_that_of_statsmodels():
    p = [0.001, 0.2, 0.012, float("nan"), 0.04, 0.013, 0.9]
    known = [one for one in p if one == one]
    expected = np.asarray(multipletests(known, method="holm")[1], np.float64)
    found = [one for one in bootstrap.holm(p) if one == one]
    np.testing.assert_allclose(found, expected)


@pytest.mark.parametrize("number", [0, 1, 7])
def test_intervals_of_few_events_are_those_of_the_gamma_method(number):
    rng = np.random.default_rng(3)
    weight = rng.uniform(0.3, 2.0, 400)
    happened = np.zeros(400)
    happened[:number] = 1.0
    parts = weight * happened / weight.sum()
    rate, variance, most = parts.sum(), (parts**2).sum(), weight.max() / weight.sum()
    more, spread = rate + most, variance + most**2
    high = stats.gamma.ppf(0.975, more**2 / spread, scale=spread / more)
    low = stats.gamma.ppf(0.025, rate**2 / variance, scale=variance / rate) if number else 0.0
    assert bootstrap.rare_interval(weight, happened) == pytest.approx((low, high), rel=1e-6)


def test_paired_intervals_are_narrower_and_cover():
    rng = np.random.default_rng(1)
    scene = rng.normal(10.0, 3.0, 500)
    columns = {
        name: {"part": scene + rng.normal(more, 0.5, 500), "whole": np.ones(500)}
        for name, more in (("a", 0.07), ("b", 0.0))
    }
    drawn = bootstrap.Resampled(np.ones(500), columns)
    (a, many), (b, others) = (drawn.ratio(one, "part", "whole") for one in "ab")
    low, high = bootstrap.interval(many - others)
    difference = columns["a"]["part"] - columns["b"]["part"]
    error = difference.std(ddof=1) / np.sqrt(500)
    assert a - b == pytest.approx(difference.mean())
    assert high - low == pytest.approx(2.0 * 1.96 * error, rel=0.1)
    expected = 2.0 * stats.norm.sf(abs(a - b) / error)
    assert expected > 1e-6
    assert bootstrap.two_sided(a - b, many - others) == pytest.approx(expected, rel=0.4)


def test_the_effective_number_is_that_of_kish():
    effective, largest = bootstrap.concentration(np.array([3.0, 1.0, 0.0]))
    assert (effective, largest) == (pytest.approx(1.6), 0.75)


def test_the_follower_that_brakes_so_keeps_what_is_asked():
    own, behind, gap = 25.0, 33.0, 48.0
    braking = float(needed_braking(np.array([gap]), np.array([own]), np.array([behind]))[0])
    time, step, speed = 0.0, 1e-4, behind
    while speed > own:
        gap -= (speed - own) * step
        speed -= braking * step if time > 0.4 else 0.0
        time += step
    assert gap == pytest.approx(1.0 * own, abs=0.01)
    none = needed_braking(
        np.array([np.inf, 5.0, 5.0]), np.full(3, own), np.array([40.0, 20.0, 30.0])
    )
    np.testing.assert_array_equal(none, [0.0, 0.0, np.inf])


def world(gap: float, *, speed: float = 30.0, other: float = 10.0, frames: int = 40):
    """Two vehicles of 4 m in a lane, at constant speeds, 20 frames a second."""
    time = 0.05 * np.arange(frames)
    s = np.stack([speed * time, gap + 4.0 + other * time])
    shape = (1, 2, frames)
    states = SimpleNamespace(
        s=np.rint(1e3 * s).astype(np.int32)[None],
        d=np.zeros(shape, np.int32),
        speed=np.rint(1e3 * np.array([speed, other]))[None, :, None].repeat(frames, 2),
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


def test_the_competent_driver_needs_the_room_that_its_formula_says():
    """Two speeds apart by 20 m/s: 1.15 s, then a ramp of 0.6 s to 0.774 g, until they are equal."""
    apart, braking, jerk = 20.0, 7.593, 12.65
    ramp = braking / jerk
    room = apart * (1.15 + ramp) - jerk * ramp**3 / 6.0
    room += (apart - 0.5 * braking * ramp) ** 2 / (2.0 * braking)
    for more, expected in ((0.3, True), (-0.3, False)):
        found = competent.prevents(
            world(room + more), 0, 1, 0, 20, friction=1.0, waits_for_risk=False
        )
        assert found is expected
    assert not competent.prevents(
        world(room + 0.3), 0, 1, 0, 20, friction=0.4, waits_for_risk=False
    )


def test_it_waits_for_two_seconds_in_a_cut_in():
    """At 60 m and 20 m/s it is a risk after 1 s, which is later than the evaluation."""
    patient, alert = (
        competent.prevents(world(60.0), 0, 1, 0, 20, friction=1.0, waits_for_risk=waits)
        for waits in (True, False)
    )
    assert (patient, alert) == (False, True)


def origin(runs, frame: int = 39):
    batch = SimpleNamespace(runs=runs, interval_s=0.05)
    return _Scene(batch, 0, frame, 1).origin()


def test_who_began_a_conflict():
    assert origin(world(40.0))[0] is Origin.OWN_APPROACH
    assert origin(world(-20.0))[0] is Origin.FROM_BEHIND

    own = world(40.0)
    own.states.lane[0, 0, :20] = 0
    assert origin(own)[0] is Origin.OWN_CHANGE

    enters = world(40.0)
    enters.states.lane[0, 1, :20] = 0
    enters.states.d[0, 1] = np.rint(np.interp(np.arange(40), [0, 5, 35], [-3500, -3500, 0]))
    found, perceived = origin(enters)
    assert found is Origin.CUT_IN
    assert enters.states.d[0, 1, perceived] > -3500 + 375 >= enters.states.d[0, 1, perceived - 1]

    brakes = world(40.0)
    brakes.states.accel_lon[0, 1, 25:] = -3000
    brakes.states.lights[0, 1, 22:] = Lights.BRAKE
    assert origin(brakes) == (Origin.BRAKING, 22)


def test_time_gained_is_the_way_ahead_over_the_speed_of_who_stays(monkeypatch):
    monkeypatch.setattr(measures, "_last_sound", lambda _: np.array([39]))
    fast, slow = world(90.0, speed=30.0), world(90.0, speed=20.0)
    assert measures.gained(fast, slow)[0] == pytest.approx(0.5 * 39 * 0.05, rel=1e-3)


def test_benchmarks_are_of_this_version_and_refuse_another(tmp_path):
    for name in names():
        assert read(name).parts
    text = Path(profiles.__file__).with_name("profiles").joinpath("motorway.toml")
    assert hash_of(profiles.load_specification(text)) == hash_of(
        profiles.load_specification("motorway")
    )
    kept = Path(bootstrap.__file__).with_name("benchmarks").joinpath("overtake.toml").read_text()
    for old, new, said in (
        ('sha256 = "', 'sha256 = "0', "the profile"),
        ('model_version = "2"', 'model_version = "1"', "model"),
        ('"gained"', '"won"', "endpoints"),
        ("version = 1", "", "a benchmark"),
    ):
        assert old in kept
        changed = tmp_path / "changed.toml"
        changed.write_text(kept.replace(old, new, 1))
        with pytest.raises(ConfigError, match=said):
            read(changed)
    with pytest.raises(ConfigError, match="overtake"):
        read("overtakes")


def test_the_error_for_a_missing_benchmark_file_names_its_path(tmp_path):
    with pytest.raises(ConfigError, match=r"missing\.toml: .*readable TOML file.*correct the path"):
        read(tmp_path / "missing.toml")
