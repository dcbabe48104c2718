"""Lane changes, hard braking and near crashes in recordings with states that the test writes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.analysis.validation import changes, conflicts
from overtaking.analysis.validation.changes import HEADWAY_WIDTH, SPACE_WIDTH
from overtaking.analysis.validation.tally import Tally, quantile
from overtaking.analysis.validation.traffic import Batch
from overtaking.model.trajectories import NO_VEHICLE, Lights
from overtaking.sim import engine
from overtaking.world.step_parameters import step_parameters

if TYPE_CHECKING:
    from collections.abc import Callable

    from overtaking.model.trajectories import Trajectories

FRAMES_PER_S = 20
LANE_MM, LENGTH_M = 3500, 4.4


def steady_traffic(*starts: tuple[float, float], horizon: float = 40.0) -> Trajectories:
    """Vehicles at constant speed in the slow lane, without lights and contacts.

    Args:
        starts: Station [m] and speed [m/s] of each vehicle.
        horizon: Duration [s].
    """
    vehicles = [
        Vehicle(s=s, lane=0, speed=speed, driver={"desired_speed": speed}) for s, speed in starts
    ]
    world = scenario(vehicles, road=wide_road(), horizon=horizon)
    runs = engine.run(world, step_parameters(world))
    frames = np.arange(runs.states.s.shape[2])
    states = {name: np.zeros_like(getattr(runs.states, name)) for name in ("lane", "lights")}
    states |= {name: np.zeros_like(runs.states.s) for name in ("accel_lon", "accel_lat")}
    s, speed = np.zeros_like(runs.states.s), np.zeros_like(runs.states.speed)
    for slot, (start_s, constant_speed) in enumerate(starts):
        s[0, slot], speed[0, slot] = (
            1e3 * (start_s + constant_speed * frames / FRAMES_PER_S),
            1e3 * constant_speed,
        )
    d = np.repeat(runs.states.d[:, :, :1], len(frames), axis=2)
    no_accelerations = {name: states[name].astype(np.int16) for name in ("accel_lon", "accel_lat")}
    no_partner = np.full_like(runs.contacts.partner, NO_VEHICLE)
    return runs.replace(
        num_frames=np.array([len(frames)], np.int32) * 0 + round(horizon * FRAMES_PER_S),
        states=runs.states.replace(
            s=s, speed=speed, d=d, lane=states["lane"], lights=states["lights"], **no_accelerations
        ),
        contacts=runs.contacts.replace(partner=no_partner),
    )


def with_shift(runs: Trajectories, *points: tuple[float, float], slot: int = 0) -> Trajectories:
    """The recording with one vehicle shifted to the left.

    Args:
        runs: The recording.
        points: Times [s] and shifts [lanes], between which the shift is linear.
        slot: Slot of the vehicle.
    """
    times, shifts = zip(*points, strict=True)
    shift = np.interp(np.arange(runs.states.d.shape[2]) / FRAMES_PER_S, times, shifts)
    return with_edits(
        runs,
        d=lambda d: d[0, slot].__iadd__(np.round(LANE_MM * shift).astype(np.int32)),
        lane=lambda lane: np.copyto(lane[0, slot], (shift >= 0.5).astype(np.uint8)),
    )


def with_edits(runs: Trajectories, **edits: Callable[[np.ndarray], Any]) -> Trajectories:
    """The recording with states edited in place by a function each."""
    arrays = {name: getattr(runs.states, name).copy() for name in edits}
    for name, edit in edits.items():
        edit(arrays[name])
    return runs.replace(states=runs.states.replace(**arrays))


def with_indicator(runs: Trajectories, begin: float, end: float, light: Lights) -> Trajectories:
    frames = slice(round(begin * FRAMES_PER_S), round(end * FRAMES_PER_S))
    return with_edits(runs, lights=lambda lights: lights[0, 0, frames].fill(int(light)))


def tally_of(runs: Trajectories, module: Any = changes) -> Tally:
    tally = Tally()
    module.count(tally, Batch.of(runs))
    return tally


def total(tally: Tally, name: str) -> float:
    return float(tally.total(name).sum())


LEFT_CHANGE = ((10.0, 0.0), (15.0, 1.0))
LEFT_CHANGE_AND_BACK = (*LEFT_CHANGE, (20.0, 1.0), (25.0, 0.0))


def test_a_lane_change_with_a_return_soon_after_is_undone():
    # `undone_time` in validation.toml is 15 s; this return is 10 s after the change.
    tally = tally_of(with_shift(steady_traffic((100.0, 25.0)), *LEFT_CHANGE_AND_BACK))
    assert total(tally, "changes") == 2.0
    # The record ends 17.5 s after the change back, so that change is watched too, and not undone.
    assert (total(tally, "watched"), total(tally, "undone")) == (2.0, 1.0)


def test_a_lane_change_to_pass_a_slower_vehicle_is_not_undone():
    tally = tally_of(
        with_shift(steady_traffic((100.0, 30.0), (400.0, 10.0)), *LEFT_CHANGE_AND_BACK)
    )
    assert (total(tally, "watched"), total(tally, "undone")) == (2.0, 0.0)


def test_a_lane_change_with_a_late_return_is_not_undone():
    late_return = (*LEFT_CHANGE, (30.0, 1.0), (35.0, 0.0))
    tally = tally_of(with_shift(steady_traffic((100.0, 25.0), horizon=60.0), *late_return))
    assert (total(tally, "watched"), total(tally, "undone")) == (2.0, 0.0)


def test_a_lane_change_shortly_before_the_end_of_the_record_is_not_watched():
    tally = tally_of(with_shift(steady_traffic((100.0, 25.0), horizon=20.0), *LEFT_CHANGE))
    assert (total(tally, "changes"), total(tally, "watched")) == (1.0, 0.0)


ABORTED_CHANGE = ((10.0, 0.0), (12.0, 0.3), (14.0, 0.0))


def test_a_signalled_move_that_returns_before_the_line_is_an_aborted_lane_change():
    tally = tally_of(
        with_indicator(with_shift(steady_traffic((100.0, 25.0)), *ABORTED_CHANGE), 9.0, 12.5, LEFT)
    )
    assert (total(tally, "begun"), total(tally, "given_up")) == (1.0, 1.0)


LEFT, RIGHT = Lights.INDICATOR_LEFT, Lights.INDICATOR_RIGHT


@pytest.mark.parametrize(
    ("points", "light", "num_begun"),
    [
        (LEFT_CHANGE, LEFT, 1.0),  # Completed.
        (LEFT_CHANGE, RIGHT, 0.0),  # The indicator points to the other side.
        # A wander of 0.35 m; a lane change begins with `begun_shift`, 0.5 m.
        (((10.0, 0.0), (12.0, 0.1), (14.0, 0.0)), LEFT, 0.0),
        (ABORTED_CHANGE, LEFT | RIGHT, 0.0),  # A wreck with hazard lamps.
    ],
)
def test_other_lateral_moves_are_no_aborted_lane_changes(points, light, num_begun):
    tally = tally_of(
        with_indicator(with_shift(steady_traffic((100.0, 25.0)), *points), 9.0, 15.0, light)
    )
    assert (total(tally, "begun"), total(tally, "given_up")) == (num_begun, 0.0)


def test_the_gap_at_the_start_of_a_lane_change_is_to_the_leader_in_the_old_lane():
    tally = tally_of(with_shift(steady_traffic((100.0, 25.0), (140.0, 25.0)), *LEFT_CHANGE))
    gap = quantile(tally.total("start_gaps"), 0.5, SPACE_WIDTH)
    assert gap == pytest.approx(40.0 - LENGTH_M, abs=0.5)
    headway = quantile(tally.total("start_headways"), 0.5, HEADWAY_WIDTH)
    assert headway == pytest.approx((40.0 - LENGTH_M) / 25.0, abs=0.02)
    assert total(tally, "return_gaps") == 0.0


def test_the_gap_at_the_return_is_to_the_follower_in_the_entered_lane():
    return_points = ((0.0, 1.0), (10.0, 1.0), (15.0, 0.0))
    tally = tally_of(with_shift(steady_traffic((100.0, 25.0), (50.0, 20.0)), *return_points))
    # The return ends at 15 s; until then the gap grows by 5 m/s.
    gap = quantile(tally.total("return_gaps"), 0.5, SPACE_WIDTH)
    assert gap == pytest.approx(50.0 + 5.0 * 15.0 - LENGTH_M, abs=2.0)
    headway = quantile(tally.total("return_headways"), 0.5, HEADWAY_WIDTH)
    assert headway == pytest.approx(gap / 20.0, abs=0.1)
    assert total(tally, "start_gaps") == 0.0


def with_braking(runs: Trajectories, begin: float, end: float, deceleration: float) -> Trajectories:
    frames = slice(round(begin * FRAMES_PER_S), round(end * FRAMES_PER_S))
    return with_edits(
        runs, accel_lon=lambda accel_lon: accel_lon[0, 0, frames].fill(round(-1e3 * deceleration))
    )


@pytest.mark.parametrize(
    ("deceleration", "expected"), [(3.9, (0.0, 0.0)), (4.1, (1.0, 0.0)), (6.1, (1.0, 1.0))]
)
def test_braking_above_4_is_hard_and_above_6_metres_per_second_squared_very_hard(
    deceleration, expected
):
    tally = tally_of(
        with_braking(steady_traffic((100.0, 25.0)), 10.0, 12.0, deceleration), conflicts
    )
    assert (total(tally, "hard_braking"), total(tally, "very_hard_braking")) == expected


def test_hard_braking_again_within_half_a_second_is_the_same_episode():
    # `same_episode` is 1 s.
    runs = with_braking(
        with_braking(steady_traffic((100.0, 25.0)), 10.0, 11.0, 5.0), 11.5, 12.0, 5.0
    )
    assert total(tally_of(runs, conflicts), "hard_braking") == 1.0
    assert total(tally_of(with_braking(runs, 14.0, 14.5, 5.0), conflicts), "hard_braking") == 2.0


def approach(gap: float) -> Trajectories:
    """A follower approaches its leader at 10 m/s; after 10 s the gap is `gap` [m]."""
    return steady_traffic((100.0, 25.0), (100.0 + LENGTH_M + gap + 100.0, 15.0), horizon=11.0)


@pytest.mark.parametrize(("gap", "num_near_crashes"), [(14.5, 1.0), (15.5, 0.0)])
def test_hard_braking_with_a_time_to_collision_below_1_5_s_is_a_near_crash(gap, num_near_crashes):
    runs = with_braking(approach(gap), 10.0, 10.05, 4.5)
    assert total(tally_of(runs, conflicts), "near_crashes") == num_near_crashes


def test_hard_steering_is_a_near_crash_and_an_approach_without_reaction_is_not():
    frame = 10 * FRAMES_PER_S
    steers = with_edits(
        approach(14.0), accel_lat=lambda accel_lat: accel_lat[0, 0, frame:].fill(-4100)
    )
    assert total(tally_of(steers, conflicts), "near_crashes") == 1.0
    assert total(tally_of(steers, conflicts), "hard_braking") == 0.0
    assert total(tally_of(approach(14.0), conflicts), "near_crashes") == 0.0


def test_hard_braking_that_ends_in_contact_is_no_near_crash():
    runs = with_braking(approach(14.0), 10.0, 10.5, 4.5)
    partner, time = runs.contacts.partner.copy(), runs.contacts.time.copy()
    partner[0, 0], time[0, 0] = 1, 14_000
    # The contact at 14 s follows the braking within `accident_follows`, 5 s.
    collision = runs.replace(contacts=runs.contacts.replace(partner=partner, time=time))
    assert total(tally_of(collision, conflicts), "near_crashes") == 0.0
    assert total(tally_of(collision, conflicts), "hard_braking") == 1.0
