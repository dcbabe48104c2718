"""What is counted in recordings that are known by construction."""

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


def counted(*vehicles: Vehicle, horizon: float = 20.0, changes: dict | None = None) -> Tally:
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


def follower(gap: float, speed: float, ahead: float) -> tuple[Vehicle, Vehicle]:
    lead = Vehicle(s=500.0, lane=0, speed=ahead, driver={"desired_speed": ahead})
    length = 4.4
    return Vehicle(
        s=500.0 - gap - length, lane=0, speed=speed, driver={"desired_speed": speed}
    ), lead


def frozen(values: np.ndarray) -> np.ndarray:
    """The first frame over and over."""
    return np.repeat(values[:, :, :1], values.shape[2], axis=2)


def test_the_time_gap_is_bumper_to_bumper_over_the_speed():
    stand = dict.fromkeys(("s", "speed"), frozen)
    tally = counted(*follower(45.0, 30.0, 30.0), changes=stand)
    assert quantile(tally.total("gap_times"), 0.5, traffic.GAP_WIDTH) == pytest.approx(
        1.5, abs=0.02
    )
    assert tally.total("critical")[0] == 0.0
    assert tally.total("behind")[0] > 0.0


@pytest.mark.parametrize(("gap", "is_critical"), [(29.0, True), (31.0, False)])
def test_a_time_to_collision_below_three_seconds_is_critical(gap, is_critical):
    stand = dict.fromkeys(("s", "speed"), frozen)
    tally = counted(*follower(gap, 30.0, 20.0), changes=stand)
    share = tally.total("critical")[0] / tally.total("behind")[0]
    assert share == float(is_critical)


def test_a_way_is_the_speed_over_the_time():
    tally = counted(*follower(200.0, 25.0, 25.0), horizon=10.0)
    assert tally.total("metres")[0] == pytest.approx(2 * 25.0 * 10.0, rel=0.05)


@pytest.mark.parametrize("duration", [4.0, 6.0, 9.0])
def test_a_lane_change_lasts_as_long_as_it_moves_visibly(duration):
    def moves(d: np.ndarray) -> np.ndarray:
        t = np.clip((np.arange(d.shape[2]) * 0.05 - 5.0) / duration, 0.0, 1.0)
        quintic = t**3 * (10.0 - 15.0 * t + 6.0 * t * t)
        moved = d.copy()
        moved[:, 0] = d[:, 0, :1] + (3500.0 * quintic).astype(np.int32)
        return moved

    def lane(lanes: np.ndarray) -> np.ndarray:
        changed = lanes.copy()
        changed[:, 0] = np.arange(lanes.shape[2]) * 0.05 >= 5.0 + 0.5 * duration
        return changed

    tally = counted(*follower(200.0, 25.0, 25.0), changes={"d": moves, "lane": lane})
    assert tally.total("changes")[0] == 1.0
    # The quintic's speed 30 D/T u^2 (1 - u)^2 is above 0.15 m/s between u and 1 - u.
    root = np.sqrt(0.15 * duration / (30.0 * 3.5))
    u = 0.5 - np.sqrt(0.25 - root)
    found = np.flatnonzero(tally.total("durations")) * lane_changes.CHANGE_WIDTH
    assert found == pytest.approx((1.0 - 2.0 * u) * duration, abs=0.25)


def test_a_figure_is_judged_by_both_of_its_limits():
    tally = counted(*follower(45.0, 30.0, 30.0))
    by_name = {figure.name: figure for figure in figures(tally, None)}
    assert by_name["lane_changes_per_km"].met is False  # Nobody changed lanes.
    assert by_name["short_ttc"].met is True
    assert by_name["impossible_accel"].value == 0.0
    assert by_name["accidents"].met is None  # Too few km for a verdict.
    assert by_name["accidents"].needs_km == 1e6
    assert by_name["passing_speed"].values()["value"] is None


def test_figures_are_plain_numbers_for_machines():
    tally = counted(*follower(45.0, 30.0, 30.0))
    rows = [figure.values() for figure in figures(tally, None)]
    assert json.loads(json.dumps(rows, allow_nan=False)) == rows


def test_a_figure_shows_its_limits_in_its_own_unit():
    by_name = {figure.name: figure for figure in figures(Tally(), None)}
    passing, without = by_name["passing_speed"], by_name["accidents_no_contact"]
    assert (passing.unit, passing.target_low) == ("km/h", pytest.approx(15.0))
    assert (without.unit, without.target_low, without.source) == ("1/Mkm", None, "")
    assert by_name["short_ttc"].unit == ""


def in_lanes(*lanes: int):
    """Changes of a recording: the lane of each vehicle, all standing where they began."""

    def set_lanes(lane: np.ndarray) -> np.ndarray:
        changed = lane.copy()
        changed[0, : len(lanes)] = np.array(lanes, np.uint8)[:, None]
        return changed

    return {"lane": set_lanes, "s": frozen, "speed": frozen}


@pytest.mark.parametrize(
    ("ahead", "share"),
    [(-24.0, 0.5), (-16.0, 0.0), (30.0, 0.0), (120.0, 0.0), (130.0, 0.5)],
)
def test_the_lane_on_the_right_is_free_from_just_behind_to_five_seconds_ahead(ahead, share):
    # At 25 m/s five seconds are 125 m; the other car is in the slowest lane, left of no lane.
    cars = [
        Vehicle(s=500.0 + place, lane=0, speed=25.0, driver={"desired_speed": 25.0})
        for place in (0.0, ahead)
    ]
    tally = counted(*cars, changes=in_lanes(1, 0))
    found = tally.total("left_time")[0] / tally.total("car_time")[0]
    assert found == pytest.approx(share)


def test_a_way_by_day_is_not_driven_at_night():
    tally = counted(*follower(200.0, 25.0, 25.0))
    assert tally.total("night_metres")[0] == 0.0
    assert tally.total("metres")[0] == tally.total("changed_metres")[0] > 0.0
