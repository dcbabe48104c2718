"""Weather that acts by pushes instead of physics, and egos that follow a script."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import overtaking as ot
from overtaking.core.errors import ConfigError
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import Lights, Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim import engine
from overtaking.world.step_parameters import step_parameters
from overtaking.world.weather_parameters import with_effective_weather

COUNT, SEED = 64, 5
SHORT = {"time.horizon_s": 2.0, "time.attempt_deadline_s": 2.0}
PUSHES = {"accel_mps2": 2.0, "duration_s": 0.2, "interval_s": 1.0, "sight_m": 40.0}
NO_PUSH = {"weather.pushes.accel_mps2": 0.0}


def sample_preset(preset: str, count: int = COUNT, **changes: Any) -> ot.Scenario:
    return ot.sample(
        "pinto2023",
        num_simulations=count,
        seed=SEED,
        overrides={"weather.presets": {preset: 1}, **changes},
    )


@pytest.mark.parametrize("preset", ["HardRainNight", "CloudyNight", "MidRainyNight"])
def test_without_a_push_storm_and_rain_are_a_clear_night(preset: str):
    stormy, clear = (ot.simulate(sample_preset(name, **NO_PUSH)) for name in (preset, "ClearNight"))
    assert (stormy.trace_hash == clear.trace_hash).all()


def test_a_profile_without_pushes_has_physical_weather():
    scenario = ot.sample("motorway", num_simulations=8, seed=SEED)
    assert with_effective_weather(scenario) is scenario
    assert not step_parameters(scenario).simulations.push_accel.any()


@pytest.mark.parametrize("preset", ["ClearNight", "SoftRainNight", "MidRainyNight", "HardRainNoon"])
def test_the_interval_is_the_stated_one_over_the_mean_of_rain_and_wind(preset: str):
    weather = weather_presets()[preset]
    share = (weather.precipitation_percent + weather.wind_intensity_percent) / 200.0
    simulations = step_parameters(
        sample_preset(preset, **{"weather.pushes.interval_s": 0.8})
    ).simulations
    assert 0.05 / simulations.push_rate == pytest.approx(0.8 / share, rel=1e-5)
    assert simulations.push_duty_cycle == pytest.approx(0.2 * share / 0.8, rel=1e-5)


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_pushes_go_where_the_wind_blows_to_on_either_side_of_the_road(is_mirrored: bool):
    scenario = sample_preset("HardRainNight")
    road = scenario.road.mirror() if is_mirrored else scenario.road
    pushed = step_parameters(scenario.replace(road=road)).simulations.push_accel
    left = np.sin(scenario.weather.wind_direction) > 0
    towards_fast_side = pushed > 0  # The fast side is on the left in right-hand traffic.
    assert (towards_fast_side == (left != is_mirrored)).all()


def test_vehicles_drift_to_the_side_of_the_wind_and_are_steered_back():
    """Paired with the same simulations without pushes, before vehicles meet."""
    changes = {"traffic.vehicles": [2, 2], "drivers.fixed.min_speed_gain_mps": 100.0}
    changes |= {"weather.pushes.sight_m": 1000.0, "starts.allow_doomed": False}
    calm = ot.simulate(
        sample_preset("HardRainNoon", **changes, **{"weather.pushes.accel_mps2": 0.0})
    )
    windy = ot.simulate(
        sample_preset("HardRainNoon", **changes, **{"weather.pushes.accel_mps2": 2.0})
    )
    frames = 100
    displacement = (windy.states.d[:, :2, :frames] - calm.states.d[:, :2, :frames]) / 1000.0
    wheels = windy.scenario.vehicles.kind[:, :2] < 5  # Two-wheelers correct by leaning.
    side = np.sign(np.sin(windy.scenario.weather.wind_direction))[:, None]
    drift = (displacement.mean(axis=2) * side)[wheels]
    assert np.median(drift) > 0.04
    assert (drift > 0.0).mean() > 0.9
    assert np.abs(displacement[wheels]).max() < 1.0, "lane keeping holds the lane"


def test_sight_is_cut_by_night_under_clouds_and_towards_the_sun():
    def is_sight_reduced(preset: str) -> Any:
        return step_parameters(sample_preset(preset)).simulations.inverse_lit_range > 0

    for preset in ("ClearNight", "HardRainNoon", "MidRainyNight"):
        assert is_sight_reduced(preset).all(), preset
    assert not is_sight_reduced("ClearNoon").any()
    sunset = sample_preset("ClearSunset")
    assert (is_sight_reduced("ClearSunset") == sunset.weather.low_sun).all()
    assert sunset.weather.low_sun.any()


def test_no_vehicle_is_detected_beyond_the_sight():
    changes = {"weather.pushes.sight_m": 20.0, "traffic.vehicles": [2, 2]}
    labelled = ot.label(ot.simulate(sample_preset("ClearNight", 256, **changes)))
    has_attempt = labelled.events.attempt != NEVER
    gap = np.asarray(labelled.matched_features.distance)[has_attempt]
    assert has_attempt.sum() > 20
    assert gap.max() <= 20.5
    by_day = ot.label(ot.simulate(sample_preset("ClearNoon", 256, **changes)))
    assert np.asarray(by_day.matched_features.distance)[by_day.events.attempt != NEVER].max() > 40.0


def test_lamps_are_on_by_night_alone():
    night, rain = (ot.simulate(sample_preset(name, 8)) for name in ("ClearNight", "HardRainNoon"))
    assert (night.states.lights[:, EGO_SLOT, 0] & Lights.LOW_BEAM).all()
    assert not (rain.states.lights[:, EGO_SLOT, 0] & Lights.LOW_BEAM).any()


def test_scripted_egos_ignore_vehicles_beside_them():
    """Egos pull out at the same decision with and without vehicles in the other lanes."""
    full = sample_preset("ClearNoon", 512, **{"traffic.vehicles": [6, 6]})
    full = full.select((full.start_lane[:, 2:] != full.start_lane[:, :1]).all(axis=1))
    valid = full.vehicles.valid & (np.arange(full.num_slots) < 2)
    alone = full.replace(vehicles=full.vehicles.replace(valid=valid))
    first = [_pulls_out(ot.simulate(scenario)) for scenario in (full, alone)]
    assert (first[0] == first[1]).mean() > 0.97  # Some egos have a collision before.
    assert (first[0] >= 0).sum() > 100


def test_scripted_egos_cancel_nothing():
    runs = ot.simulate(ot.sample("pinto2023", num_simulations=1024, seed=SEED))
    assert not ((runs.stage == Stage.ABORT) & runs.frame_mask).any()
    assert ((runs.stage == Stage.DONE) & runs.frame_mask).any()


def _pulls_out(runs: ot.Trajectories) -> Any:
    """The first frame of the lane change, -1 without one."""
    is_out = (runs.stage == Stage.PULL_OUT) & runs.frame_mask
    return np.where(is_out.any(axis=1), is_out.argmax(axis=1), -1)


@pytest.mark.ci
def test_any_profile_may_have_pushes():
    changes = {f"weather.pushes.{name}": value for name, value in PUSHES.items()}
    plain, pushed = (
        ot.sample("motorway", num_simulations=4, seed=1, overrides=overrides)
        for overrides in (SHORT, SHORT | changes)
    )
    assert plain.pushes is None
    assert pushed.pushes is not None
    assert pushed.pushes.accel == 2.0
    runs, twin = engine.simulate(pushed), ot.simulate(pushed, simulator="reference")
    assert (runs.trace_hash == twin.trace_hash).all()


@pytest.mark.ci
def test_a_data_set_stores_its_pushes(tmp_path: Any):
    short = {"time.horizon_s": 4.0, "time.attempt_deadline_s": 4.0}
    for keep in ("frames", "features"):
        data = ot.generate_dataset(
            "pinto2023", num_simulations=6, seed=1, out=tmp_path / keep, keep=keep, overrides=short
        )
        before = data.labels()
        reloaded = ot.load_dataset(tmp_path / keep)
        assert (
            reloaded.scenario(2).pushes == ot.sample("pinto2023", num_simulations=3, seed=1).pushes
        )
        assert len(reloaded.states(2)) > 0
        ot.relabel_dataset(tmp_path / keep)
        assert ot.load_dataset(tmp_path / keep).labels().equals(before)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weather.pushes.accel_mps2": -1.0}, "accel_mps2"),
        ({"weather.pushes.interval_s": 0.0}, "interval_s"),
        ({"weather.pushes.sight": 3.0}, "sight_m"),
    ],
)
def test_impossible_pushes_are_rejected_in_one_line(change: dict[str, float], message: str):
    with pytest.raises(ConfigError, match=message) as raised:
        ot.sample("pinto2023", num_simulations=1, seed=1, overrides=change)
    assert "\n" not in str(raised.value)
