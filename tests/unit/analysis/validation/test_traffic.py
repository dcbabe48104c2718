"""Traffic figures of recordings that are known by construction."""

from __future__ import annotations

import json

import numpy as np
import pytest
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.analysis.validation import accidents, conflicts, traffic
from overtaking.analysis.validation import changes as lane_changes
from overtaking.analysis.validation.figures import figures
from overtaking.analysis.validation.tally import Tally, quantile
from overtaking.analysis.validation.traffic import Batch
from overtaking.sim import engine
from overtaking.world.step_parameters import step_parameters


def tally_of(*vehicles: Vehicle, horizon: float = 20.0, changes: dict | None = None) -> Tally:
    world = scenario(list(vehicles), road=wide_road(), horizon=horizon)
    runs = engine.run(world, step_parameters(world))
    if changes:
        runs = runs.replace(
            states=runs.states.replace(
                **{name: change(getattr(runs.states, name)) for name, change in changes.items()}
            )
        )
    tally, batch = Tally(), Batch.of(runs)
    for part in (traffic, lane_changes, conflicts, accidents):
        part.count(tally, batch)
    return tally


def follower_and_leader(gap: float, speed: float, leader_speed: float) -> tuple[Vehicle, Vehicle]:
    leader = Vehicle(s=500.0, lane=0, speed=leader_speed, driver={"desired_speed": leader_speed})
    length = 4.4
    return Vehicle(
        s=500.0 - gap - length, lane=0, speed=speed, driver={"desired_speed": speed}
    ), leader


def repeat_first_frame(values: np.ndarray) -> np.ndarray:
    """States in which all frames equal the first one."""
    return np.repeat(values[:, :, :1], values.shape[2], axis=2)


def test_the_time_gap_is_the_bumper_distance_over_the_speed():
    fixed = dict.fromkeys(("s", "speed"), repeat_first_frame)
    tally = tally_of(*follower_and_leader(45.0, 30.0, 30.0), changes=fixed)
    # 45 m at 30 m/s.
    assert quantile(tally.total("gap_times"), 0.5, traffic.GAP_WIDTH) == pytest.approx(
        1.5, abs=0.02
    )
    assert tally.total("critical")[0] == 0.0
    assert tally.total("behind")[0] > 0.0


@pytest.mark.parametrize(("gap", "is_critical"), [(29.0, True), (31.0, False)])
def test_a_time_to_collision_below_three_seconds_is_critical(gap, is_critical):
    fixed = dict.fromkeys(("s", "speed"), repeat_first_frame)
    tally = tally_of(*follower_and_leader(gap, 30.0, 20.0), changes=fixed)
    share = tally.total("critical")[0] / tally.total("behind")[0]
    assert share == float(is_critical)


def test_the_distance_driven_is_speed_times_time():
    tally = tally_of(*follower_and_leader(200.0, 25.0, 25.0), horizon=10.0)
    # Two vehicles.
    assert tally.total("metres")[0] == pytest.approx(2 * 25.0 * 10.0, rel=0.05)


@pytest.mark.parametrize("duration", [4.0, 6.0, 9.0])
def test_a_lane_change_lasts_as_long_as_its_lateral_speed_exceeds_15_cm_per_second(duration):
    def shift_ego(d: np.ndarray) -> np.ndarray:
        t = np.clip((np.arange(d.shape[2]) * 0.05 - 5.0) / duration, 0.0, 1.0)
        quintic = t**3 * (10.0 - 15.0 * t + 6.0 * t * t)
        shifted = d.copy()
        shifted[:, 0] = d[:, 0, :1] + (3500.0 * quintic).astype(np.int32)
        return shifted

    def change_lane(lanes: np.ndarray) -> np.ndarray:
        changed = lanes.copy()
        changed[:, 0] = np.arange(lanes.shape[2]) * 0.05 >= 5.0 + 0.5 * duration
        return changed

    tally = tally_of(
        *follower_and_leader(200.0, 25.0, 25.0), changes={"d": shift_ego, "lane": change_lane}
    )
    assert tally.total("changes")[0] == 1.0
    # The quintic's speed 30 D/T u^2 (1 - u)^2 is above 0.15 m/s between u and 1 - u.
    root = np.sqrt(0.15 * duration / (30.0 * 3.5))
    u = 0.5 - np.sqrt(0.25 - root)
    measured = np.flatnonzero(tally.total("durations")) * lane_changes.CHANGE_WIDTH
    assert measured == pytest.approx((1.0 - 2.0 * u) * duration, abs=0.25)


def test_a_figure_outside_either_limit_misses_its_target():
    tally = tally_of(*follower_and_leader(45.0, 30.0, 30.0))
    by_name = {figure.name: figure for figure in figures(tally, None)}
    assert by_name["lane_changes_per_km"].met is False  # No vehicle changed lanes.
    assert by_name["short_ttc"].met is True
    assert by_name["impossible_accel"].value == 0.0
    assert by_name["accidents"].met is None  # Too few km for a verdict.
    assert by_name["accidents"].needs_km == 1e6
    assert by_name["passing_speed"].values()["value"] is None


def test_the_values_of_figures_are_strict_json():
    tally = tally_of(*follower_and_leader(45.0, 30.0, 30.0))
    rows = [figure.values() for figure in figures(tally, None)]
    assert json.loads(json.dumps(rows, allow_nan=False)) == rows


def test_a_figure_shows_its_limits_in_its_own_unit():
    by_name = {figure.name: figure for figure in figures(Tally(), None)}
    passing, without = by_name["passing_speed"], by_name["accidents_no_contact"]
    assert (passing.unit, passing.target_low) == ("km/h", pytest.approx(15.0))
    assert (without.unit, without.target_low, without.source) == ("1/Mkm", None, "")
    assert by_name["short_ttc"].unit == ""


def in_lanes(*lanes: int):
    """Changes of a recording: the lane of each vehicle, and constant stations and speeds."""

    def set_lanes(lane: np.ndarray) -> np.ndarray:
        lanes_of_all = lane.copy()
        lanes_of_all[0, : len(lanes)] = np.array(lanes, np.uint8)[:, None]
        return lanes_of_all

    return {"lane": set_lanes, "s": repeat_first_frame, "speed": repeat_first_frame}


@pytest.mark.parametrize(
    ("distance_ahead", "share"),
    [(-24.0, 0.5), (-16.0, 0.0), (30.0, 0.0), (120.0, 0.0), (130.0, 0.5)],
)
def test_the_right_lane_is_free_without_a_car_from_just_behind_to_five_seconds_ahead(
    distance_ahead, share
):
    # Five seconds at 25 m/s are 125 m. The other car, half of the driving time, is in the slowest
    # lane and can be left of no free lane.
    cars = [
        Vehicle(s=500.0 + distance, lane=0, speed=25.0, driver={"desired_speed": 25.0})
        for distance in (0.0, distance_ahead)
    ]
    tally = tally_of(*cars, changes=in_lanes(1, 0))
    measured = tally.total("left_time")[0] / tally.total("car_time")[0]
    assert measured == pytest.approx(share)


def test_distance_driven_by_day_is_not_counted_as_night():
    tally = tally_of(*follower_and_leader(200.0, 25.0, 25.0))
    assert tally.total("night_metres")[0] == 0.0
    assert tally.total("metres")[0] == tally.total("changed_metres")[0] > 0.0
