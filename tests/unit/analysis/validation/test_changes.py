"""Lane changes and reactions in recordings that are written by hand."""

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

SECOND = 20
LANE_MM, LENGTH_M = 3500, 4.4


def still(*starts: tuple[float, float], horizon: float = 40.0) -> Trajectories:
    """Vehicles at constant speed in the slow lane: place [m] and speed [m/s] of each."""
    vehicles = [
        Vehicle(s=s, lane=0, speed=speed, driver={"desired_speed": speed}) for s, speed in starts
    ]
    world = scenario(vehicles, road=wide_road(), horizon=horizon)
    runs = engine.run(world, step_parameters(world))
    frames = np.arange(runs.states.s.shape[2])
    states = {name: np.zeros_like(getattr(runs.states, name)) for name in ("lane", "lights")}
    states |= {name: np.zeros_like(runs.states.s) for name in ("accel_lon", "accel_lat")}
    s, speed = np.zeros_like(runs.states.s), np.zeros_like(runs.states.speed)
    for slot, (place, pace) in enumerate(starts):
        s[0, slot], speed[0, slot] = 1e3 * (place + pace * frames / SECOND), 1e3 * pace
    d = np.repeat(runs.states.d[:, :, :1], len(frames), axis=2)
    small = {name: states[name].astype(np.int16) for name in ("accel_lon", "accel_lat")}
    none = np.full_like(runs.contacts.partner, NO_VEHICLE)
    return runs.replace(
        num_frames=np.array([len(frames)], np.int32) * 0 + round(horizon * SECOND),
        states=runs.states.replace(
            s=s, speed=speed, d=d, lane=states["lane"], lights=states["lights"], **small
        ),
        contacts=runs.contacts.replace(partner=none),
    )


def moved(runs: Trajectories, *ways: tuple[float, float], slot: int = 0) -> Trajectories:
    """A vehicle whose shift in lanes is given at times [s], lights on from the first on."""
    times, shifts = zip(*ways, strict=True)
    shift = np.interp(np.arange(runs.states.d.shape[2]) / SECOND, times, shifts)
    return changed(
        runs,
        d=lambda d: d[0, slot].__iadd__(np.round(LANE_MM * shift).astype(np.int32)),
        lane=lambda lane: np.copyto(lane[0, slot], (shift >= 0.5).astype(np.uint8)),
    )


def changed(runs: Trajectories, **edits: Callable[[np.ndarray], Any]) -> Trajectories:
    """The recording with arrays that are changed in place."""
    arrays = {name: getattr(runs.states, name).copy() for name in edits}
    for name, edit in edits.items():
        edit(arrays[name])
    return runs.replace(states=runs.states.replace(**arrays))


def signalling(runs: Trajectories, begin: float, end: float, light: Lights) -> Trajectories:
    frames = slice(round(begin * SECOND), round(end * SECOND))
    return changed(runs, lights=lambda lights: lights[0, 0, frames].fill(int(light)))


def counted(runs: Trajectories, module: Any = changes) -> Tally:
    tally = Tally()
    module.count(tally, Batch.of(runs))
    return tally


def total(tally: Tally, name: str) -> float:
    return float(tally.total(name).sum())


OUT = ((10.0, 0.0), (15.0, 1.0))
OUT_AND_BACK = (*OUT, (20.0, 1.0), (25.0, 0.0))


def test_a_change_that_is_taken_back_soon_is_undone():
    tally = counted(moved(still((100.0, 25.0)), *OUT_AND_BACK))
    assert total(tally, "changes") == 2.0
    # The way back is followed by 17.5 s of record: it is watched as well, and stands.
    assert (total(tally, "watched"), total(tally, "undone")) == (2.0, 1.0)


def test_a_change_that_passes_another_is_not_undone():
    tally = counted(moved(still((100.0, 30.0), (400.0, 10.0)), *OUT_AND_BACK))
    assert (total(tally, "watched"), total(tally, "undone")) == (2.0, 0.0)


def test_a_change_back_after_long_is_not_undone():
    late = (*OUT, (30.0, 1.0), (35.0, 0.0))
    tally = counted(moved(still((100.0, 25.0), horizon=60.0), *late))
    assert (total(tally, "watched"), total(tally, "undone")) == (2.0, 0.0)


def test_a_change_whose_next_seconds_are_not_recorded_is_not_watched():
    tally = counted(moved(still((100.0, 25.0), horizon=20.0), *OUT))
    assert (total(tally, "changes"), total(tally, "watched")) == (1.0, 0.0)


HALFWAY = ((10.0, 0.0), (12.0, 0.3), (14.0, 0.0))


def test_a_signalled_move_that_comes_back_before_the_line_is_given_up():
    tally = counted(signalling(moved(still((100.0, 25.0)), *HALFWAY), 9.0, 12.5, LEFT))
    assert (total(tally, "begun"), total(tally, "given_up")) == (1.0, 1.0)


LEFT, RIGHT = Lights.INDICATOR_LEFT, Lights.INDICATOR_RIGHT


@pytest.mark.parametrize(
    ("way", "light", "begun"),
    [
        (OUT, LEFT, 1.0),  # Completed.
        (OUT, RIGHT, 0.0),  # To the other side.
        (((10.0, 0.0), (12.0, 0.1), (14.0, 0.0)), LEFT, 0.0),  # Wandering.
        (HALFWAY, LEFT | RIGHT, 0.0),  # A wreck with hazard lamps.
    ],
)
def test_what_is_not_given_up(way, light, begun):
    tally = counted(signalling(moved(still((100.0, 25.0)), *way), 9.0, 15.0, light))
    assert (total(tally, "begun"), total(tally, "given_up")) == (begun, 0.0)


def test_the_gap_at_the_start_is_to_the_leader_in_the_old_lane():
    tally = counted(moved(still((100.0, 25.0), (140.0, 25.0)), *OUT))
    gap = quantile(tally.total("start_gaps"), 0.5, SPACE_WIDTH)
    assert gap == pytest.approx(40.0 - LENGTH_M, abs=0.5)
    headway = quantile(tally.total("start_headways"), 0.5, HEADWAY_WIDTH)
    assert headway == pytest.approx((40.0 - LENGTH_M) / 25.0, abs=0.02)
    assert total(tally, "return_gaps") == 0.0


def test_the_gap_at_the_return_is_from_who_is_behind_in_the_entered_lane():
    back = ((0.0, 1.0), (10.0, 1.0), (15.0, 0.0))
    tally = counted(moved(still((100.0, 25.0), (50.0, 20.0)), *back))
    # The motion is visible from 10 s to 15 s, 5 m/s apart.
    gap = quantile(tally.total("return_gaps"), 0.5, SPACE_WIDTH)
    assert gap == pytest.approx(50.0 + 5.0 * 15.0 - LENGTH_M, abs=2.0)
    headway = quantile(tally.total("return_headways"), 0.5, HEADWAY_WIDTH)
    assert headway == pytest.approx(gap / 20.0, abs=0.1)
    assert total(tally, "start_gaps") == 0.0


def braking(runs: Trajectories, begin: float, end: float, hard: float) -> Trajectories:
    frames = slice(round(begin * SECOND), round(end * SECOND))
    return changed(runs, accel_lon=lambda along: along[0, 0, frames].fill(round(-1e3 * hard)))


@pytest.mark.parametrize(
    ("hard", "expected"), [(3.9, (0.0, 0.0)), (4.1, (1.0, 0.0)), (6.1, (1.0, 1.0))]
)
def test_hard_braking_is_counted_by_episodes(hard, expected):
    tally = counted(braking(still((100.0, 25.0)), 10.0, 12.0, hard), conflicts)
    assert (total(tally, "hard_braking"), total(tally, "very_hard_braking")) == expected


def test_braking_again_at_once_is_the_same_episode():
    runs = braking(braking(still((100.0, 25.0)), 10.0, 11.0, 5.0), 11.5, 12.0, 5.0)
    assert total(counted(runs, conflicts), "hard_braking") == 1.0
    assert total(counted(braking(runs, 14.0, 14.5, 5.0), conflicts), "hard_braking") == 2.0


def at_ten_seconds(gap: float) -> Trajectories:
    """A vehicle that closes in at 10 m/s on its leader, which is so far ahead after 10 s."""
    return still((100.0, 25.0), (100.0 + LENGTH_M + gap + 100.0, 15.0), horizon=11.0)


@pytest.mark.parametrize(("gap", "near"), [(14.5, 1.0), (15.5, 0.0)])
def test_a_near_crash_is_little_time_and_hard_braking(gap, near):
    runs = braking(at_ten_seconds(gap), 10.0, 10.05, 4.5)
    assert total(counted(runs, conflicts), "near_crashes") == near


def test_steering_as_hard_is_a_near_crash_too_and_neither_is_none():
    frame = 10 * SECOND
    steers = changed(at_ten_seconds(14.0), accel_lat=lambda a: a[0, 0, frame:].fill(-4100))
    assert total(counted(steers, conflicts), "near_crashes") == 1.0
    assert total(counted(steers, conflicts), "hard_braking") == 0.0
    assert total(counted(at_ten_seconds(14.0), conflicts), "near_crashes") == 0.0


def test_what_ends_in_contact_is_no_near_crash():
    runs = braking(at_ten_seconds(14.0), 10.0, 10.5, 4.5)
    partner, time = runs.contacts.partner.copy(), runs.contacts.time.copy()
    partner[0, 0], time[0, 0] = 1, 14_000
    hit = runs.replace(contacts=runs.contacts.replace(partner=partner, time=time))
    assert total(counted(hit, conflicts), "near_crashes") == 0.0
    assert total(counted(hit, conflicts), "hard_braking") == 1.0
