"""Weather that acts by pushes in place of its physics, and egos that are told to change lanes."""

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


def drawn(preset: str, count: int = COUNT, **changes: Any) -> ot.Scenario:
    return ot.sample(
        "pinto2023",
        num_simulations=count,
        seed=SEED,
        overrides={"weather.presets": {preset: 1}, **changes},
    )


@pytest.mark.parametrize("preset", ["HardRainNight", "CloudyNight", "MidRainyNight"])
def test_without_a_push_storm_and_rain_are_a_clear_night(preset: str):
    here, there = (ot.simulate(drawn(one, **NO_PUSH)) for one in (preset, "ClearNight"))
    assert (here.trace_hash == there.trace_hash).all()


def test_physics_is_as_it_was_for_a_profile_without_pushes():
    scenario = ot.sample("motorway", num_simulations=8, seed=SEED)
    assert with_effective_weather(scenario) is scenario
    assert not step_parameters(scenario).simulations.push_accel.any()


@pytest.mark.parametrize("preset", ["ClearNight", "SoftRainNight", "MidRainyNight", "HardRainNoon"])
def test_the_interval_is_the_stated_one_over_the_mean_of_rain_and_wind(preset: str):
    one = weather_presets()[preset]
    share = (one.precipitation_percent + one.wind_intensity_percent) / 200.0
    q = step_parameters(drawn(preset, **{"weather.pushes.interval_s": 0.8})).simulations
    assert 0.05 / q.push_rate == pytest.approx(0.8 / share, rel=1e-5)
    assert q.push_duty_cycle == pytest.approx(0.2 * share / 0.8, rel=1e-5)


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_pushes_go_where_the_wind_blows_to_on_either_side_of_the_road(is_mirrored: bool):
    scenario = drawn("HardRainNight")
    road = scenario.road.mirror() if is_mirrored else scenario.road
    pushed = step_parameters(scenario.replace(road=road)).simulations.push_accel
    left = np.sin(scenario.weather.wind_direction) > 0
    towards_fast_side = pushed > 0  # The fast side is on the left in right-hand traffic.
    assert (towards_fast_side == (left != is_mirrored)).all()


def test_vehicles_drift_to_the_side_of_the_wind_and_are_steered_back():
    """Paired with the same simulations without pushes, before anybody meets anybody."""
    changes = {"traffic.vehicles": [2, 2], "drivers.fixed.min_speed_gain_mps": 100.0}
    changes |= {"weather.pushes.sight_m": 1000.0, "starts.allow_doomed": False}
    calm = ot.simulate(drawn("HardRainNoon", **changes, **{"weather.pushes.accel_mps2": 0.0}))
    windy = ot.simulate(drawn("HardRainNoon", **changes, **{"weather.pushes.accel_mps2": 2.0}))
    frames = 100
    apart = (windy.states.d[:, :2, :frames] - calm.states.d[:, :2, :frames]) / 1000.0
    wheels = windy.scenario.vehicles.kind[:, :2] < 5  # Who leans answers by leaning.
    side = np.sign(np.sin(windy.scenario.weather.wind_direction))[:, None]
    drift = (apart.mean(axis=2) * side)[wheels]
    assert np.median(drift) > 0.04
    assert (drift > 0.0).mean() > 0.9
    assert np.abs(apart[wheels]).max() < 1.0, "lane keeping holds the lane"


def test_sight_is_cut_by_night_under_clouds_and_towards_the_sun():
    def cut(preset: str) -> Any:
        return step_parameters(drawn(preset)).simulations.inverse_lit_range > 0

    for preset in ("ClearNight", "HardRainNoon", "MidRainyNight"):
        assert cut(preset).all(), preset
    assert not cut("ClearNoon").any()
    sunset = drawn("ClearSunset")
    assert (cut("ClearSunset") == sunset.weather.low_sun).all()
    assert sunset.weather.low_sun.any()


def test_nobody_is_noticed_beyond_the_sight():
    changes = {"weather.pushes.sight_m": 20.0, "traffic.vehicles": [2, 2]}
    said = ot.label(ot.simulate(drawn("ClearNight", 256, **changes)))
    begun = said.events.attempt != NEVER
    gap = np.asarray(said.matched_features.distance)[begun]
    assert begun.sum() > 20
    assert gap.max() <= 20.5
    far = ot.label(ot.simulate(drawn("ClearNoon", 256, **changes)))
    assert np.asarray(far.matched_features.distance)[far.events.attempt != NEVER].max() > 40.0


def test_lamps_are_on_by_night_alone():
    night, rain = (ot.simulate(drawn(one, 8)) for one in ("ClearNight", "HardRainNoon"))
    assert (night.states.lights[:, EGO_SLOT, 0] & Lights.LOW_BEAM).all()
    assert not (rain.states.lights[:, EGO_SLOT, 0] & Lights.LOW_BEAM).any()


def test_egos_that_are_told_look_at_nobody_beside_them():
    """With and without the others in their lanes they pull out at the same decision."""
    full = drawn("ClearNoon", 512, **{"traffic.vehicles": [6, 6]})
    full = full.select((full.start_lane[:, 2:] != full.start_lane[:, :1]).all(axis=1))
    valid = full.vehicles.valid & (np.arange(full.num_slots) < 2)
    alone = full.replace(vehicles=full.vehicles.replace(valid=valid))
    first = [_pulls_out(ot.simulate(one)) for one in (full, alone)]
    assert (first[0] == first[1]).mean() > 0.97  # Some are hit first.
    assert (first[0] >= 0).sum() > 100


def test_egos_that_are_told_give_nothing_up():
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
        ot.sample("motorway", num_simulations=4, seed=1, overrides=one)
        for one in (SHORT, SHORT | changes)
    )
    assert plain.pushes is None
    assert pushed.pushes is not None
    assert pushed.pushes.accel == 2.0
    runs, twin = engine.simulate(pushed), ot.simulate(pushed, simulator="reference")
    assert (runs.trace_hash == twin.trace_hash).all()


@pytest.mark.ci
def test_a_data_set_remembers_its_pushes(tmp_path: Any):
    short = {"time.horizon_s": 4.0, "time.attempt_deadline_s": 4.0}
    for keep in ("frames", "features"):
        data = ot.generate_dataset(
            "pinto2023", num_simulations=6, seed=1, out=tmp_path / keep, keep=keep, overrides=short
        )
        before = data.labels()
        again = ot.load_dataset(tmp_path / keep)
        assert again.scenario(2).pushes == ot.sample("pinto2023", num_simulations=3, seed=1).pushes
        assert len(again.states(2)) > 0
        ot.relabel_dataset(tmp_path / keep)
        assert ot.load_dataset(tmp_path / keep).labels().equals(before)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"weather.pushes.accel_mps2": -1.0}, "accel_mps2"),
        ({"weather.pushes.interval_s": 0.0}, "interval_s"),
        ({"weather.pushes.sight": 3.0}, "sight_m"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(change: dict[str, float], says: str):
    with pytest.raises(ConfigError, match=says) as caught:
        ot.sample("pinto2023", num_simulations=1, seed=1, overrides=change)
    assert "\n" not in str(caught.value)
