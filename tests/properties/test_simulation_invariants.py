"""What must hold for every simulation, whatever was drawn.

Scenarios are drawn from the study's profile, at any seed and index: they contain all vehicle types,
all weathers, overtakes and accidents. The engine runs them; it is bit for bit the reference.
"""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.support.forces import SPEED_ERROR, bounds
from tests.support.transformations import (
    mirror_lights,
    mirror_scenario,
    new_slots,
    reorder_scenario,
)

from overtaking.model.batch import concatenate
from overtaking.model.known_roads import known_road
from overtaking.model.trajectories import NO_VEHICLE, Stage, States, Trajectories
from overtaking.recordings.roads import load_road
from overtaking.scenarios import profiles, sampler
from overtaking.sim import branching, engine, reference
from overtaking.world.constants import EnabledEffects, model_constants
from overtaking.world.step_parameters import VEHICLE_FIELDS, StepParameters, step_parameters

if TYPE_CHECKING:
    from overtaking.model.scenario import Scenario

ROAD = known_road("town06").extend_to(3_000.0)
STATE_NAMES = [field.name for field in dataclasses.fields(States)]

seeds = st.integers(0, 2**64 - 1)
indices = st.lists(st.integers(0, 2**40), min_size=12, max_size=12, unique=True)


def drawn(seed: int, index: list[int]) -> Scenario:
    return sampler.ScenarioSource(
        profiles.load_specification("pinto2023-physical"), ROAD, seed
    ).sample(np.array(index, np.uint64))


def simulated(seed: int, index: list[int]) -> Trajectories:
    return engine.simulate(drawn(seed, index))


def present(ran: Trajectories) -> np.ndarray:
    """Frames that were recorded of vehicles that exist, (simulation, vehicle, time)."""
    return ran.frame_mask[:, None, :] & ran.scenario.vehicles.valid[:, :, None]


def sound(ran: Trajectories) -> np.ndarray:
    """The same, before each vehicle's first collision and while it keeps to the lanes."""
    touched = ran.contacts.partner != NO_VEHICLE
    until = np.where(touched, ran.contacts.time, np.iinfo(np.int32).max)
    edges = np.sort(ran.road.lane_boundaries)
    d = ran.states.d / 1000.0
    psi = ran.states.heading / 1e4 - ran.road.heading
    lost = (d < edges[0] - 0.9) | (d > edges[-1] + 0.9) | (np.abs(psi) > 0.75)
    kept = np.cumsum(lost & present(ran), axis=2) == 0
    return present(ran) & kept & (ran.time_ms < until[:, :, None])


def assert_equal(one: Trajectories, other: Trajectories) -> None:
    np.testing.assert_array_equal(one.trace_hash, other.trace_hash)
    np.testing.assert_array_equal(one.num_frames, other.num_frames)
    both = one.frame_mask
    for name in STATE_NAMES:
        left, right = getattr(one.states, name), getattr(other.states, name)
        np.testing.assert_array_equal(
            np.where(both[:, None], left, 0), np.where(both[:, None], right, 0)
        )
    np.testing.assert_array_equal(np.where(both, one.stage, 0), np.where(both, other.stage, 0))


@pytest.mark.ci
@given(seed=seeds, index=indices)
@settings(max_examples=10)
def test_the_same_seed_gives_the_same_bits(seed: int, index: list[int]):
    assert_equal(simulated(seed, index), simulated(seed, index))


@pytest.mark.ci
@given(seed=seeds, index=indices)
@settings(max_examples=10)
def test_a_simulation_is_the_same_in_any_batch(seed: int, index: list[int]):
    batch = simulated(seed, index)
    order = [7, 2, 11]
    for k in order:
        alone = simulated(seed, [index[k]])
        np.testing.assert_array_equal(alone.trace_hash[0], batch.trace_hash[k])
        assert alone.num_frames[0] == batch.num_frames[k]
    shuffled = simulated(seed, [index[k] for k in order])
    np.testing.assert_array_equal(shuffled.trace_hash, batch.trace_hash[order])


@pytest.mark.ci
@given(seed=seeds)
@settings(max_examples=3)
def test_the_reference_gives_the_same_simulation_alone_and_in_a_batch(seed: int):
    world = drawn(seed, [0, 1, 2]).replace(horizon=np.full(3, 4.0, np.float32))
    batch = reference.simulate(world)
    alone = reference.simulate(world.select(slice(1, 2)))
    np.testing.assert_array_equal(alone.trace_hash[0], batch.trace_hash[1])


@given(seed=seeds, index=indices)
@settings(max_examples=10)
def test_joining_batches_changes_nothing(seed: int, index: list[int]):
    world = drawn(seed, index)
    halves = [world.select(slice(0, 6)), world.select(slice(6, 12))]
    joined = engine.simulate(concatenate(halves))
    np.testing.assert_array_equal(joined.trace_hash, engine.simulate(world).trace_hash)


@pytest.mark.ci
@given(seed=seeds, index=indices)
@settings(max_examples=15)
def test_a_mirrored_world_gives_the_mirror_image_bit_for_bit(seed: int, index: list[int]):
    # Left-hand traffic is right-hand traffic in a mirror: not one rounding may differ.
    world = drawn(seed, index)
    one, other = engine.simulate(world), engine.simulate(mirror_scenario(world))
    for name in ("s", "speed", "accel_lon", "lane", "x"):
        np.testing.assert_array_equal(getattr(one.states, name), getattr(other.states, name), name)
    for name in ("d", "y", "wheel_angle", "accel_lat", "yaw_rate"):
        np.testing.assert_array_equal(getattr(one.states, name), -getattr(other.states, name), name)
    turned = one.states.heading != -other.states.heading
    # The heading lies in (-pi, pi]: pi itself has no mirror image.
    assert (np.abs(one.states.heading[turned]) >= round(math.pi * 1e4)).all()
    np.testing.assert_array_equal(one.stage, other.stage)
    np.testing.assert_array_equal(one.num_frames, other.num_frames)
    np.testing.assert_array_equal(mirror_lights(one.states.lights), other.states.lights)
    for field in dataclasses.fields(one.contacts):
        np.testing.assert_array_equal(
            getattr(one.contacts, field.name), getattr(other.contacts, field.name)
        )


@given(seed=seeds, index=indices, steps=st.integers(1, 400))
@settings(max_examples=10)
def test_a_shift_along_the_road_changes_nothing_else(seed: int, index: list[int], steps: int):
    # Starts and the shift are multiples of 1/16 m, so that the differences of places keep their
    # bits at first; later each place is rounded to a float32 of up to a kilometre, 6e-5 m.
    world = dry(drawn(seed, index))
    grid = np.rint(world.start_s * np.float32(16.0)) / np.float32(16.0)
    shift = np.float32(steps * 0.0625)
    placed = [world.replace(start_s=start) for start in (grid, grid + shift)]
    one, other = (
        engine.run(each, step_parameters(each, EnabledEffects(gusts=False))) for each in placed
    )
    away = shifted_by(one, other, float(shift))
    # A last bit may tip a decision whose threshold it sits on: of 6,000 simulations 0.5 % differ by
    # more than 10 mm, so four of twelve have a probability of 4e-7.
    away = np.sort(away)
    assert away[6] <= 5
    assert away[-4] <= 10


def dry(world: Scenario) -> Scenario:
    """The same without puddles, which have their places, and without a road so wet that vehicles
    slide, which magnifies the last bit of a place to centimetres.
    """
    none = np.zeros_like(world.weather.rain)
    return world.replace(weather=world.weather.replace(rain=none, puddles=none))


def shifted_by(one: Trajectories, other: Trajectories, shift: float) -> np.ndarray:
    """Largest difference of place, offset or speed but for a shift, (simulation,) [mm, mm/s]."""
    frames = min(one.stage.shape[1], other.stage.shape[1])
    valid = (present(one)[:, :, :frames]) & (present(other)[:, :, :frames])
    away = np.zeros(len(one.num_frames))
    for name in ("s", "d", "speed"):
        left, right = (
            getattr(ran.states, name)[:, :, :frames].astype(float) for ran in (one, other)
        )
        left = left + (shift * 1000.0 if name == "s" else 0.0)
        away = np.maximum(away, np.where(valid, np.abs(left - right), 0.0).max(axis=(1, 2)))
    return np.where(one.num_frames == other.num_frames, away, np.inf)


@pytest.mark.ci
@given(seed=seeds, index=indices, order=st.permutations(range(1, 6)))
# Two that have crashed into each other are hit by the ego, both within one step of 10 ms.
@example(seed=551, index=[*range(11), 1637903], order=[1, 2, 4, 3, 5])
@settings(max_examples=10)
def test_the_order_of_the_other_vehicles_is_irrelevant(
    seed: int, index: list[int], order: list[int]
):
    # Random numbers and turns of looking belong to slots. What they drive is switched off: gusts,
    # wander in the lane, errors of judgement and looks over the shoulder. Ties between equally near
    # neighbours do not occur in drawn scenarios.
    world = drawn(seed, index)
    shuffle = np.array([0, *order])
    other = reorder_scenario(world, shuffle)
    one, two = (engine.run(each, without_errors(each)) for each in (world, other))
    # Which of two vehicles comes first decides the rounding of the impulse between them, so the
    # equality of bits ends with the first contact in a simulation.
    until = np.where(two.contacts.partner != NO_VEHICLE, two.contacts.time, 10**9).min(axis=1)
    untouched = present(two) & (two.time_ms < until[:, None])[:, None, :]
    for name in STATE_NAMES:
        recorded = getattr(one.states, name)[:, shuffle]
        np.testing.assert_array_equal(
            recorded[untouched], getattr(two.states, name)[untouched], name
        )
    np.testing.assert_array_equal(one.num_frames, two.num_frames)
    renamed = new_slots(shuffle)[one.contacts.partner[:, shuffle]]
    np.testing.assert_array_equal(renamed == NO_VEHICLE, two.contacts.partner == NO_VEHICLE)
    first = two.contacts.time == until[:, None]
    np.testing.assert_array_equal(renamed[first], two.contacts.partner[first])


def without_errors(world: Scenario):
    given_ = step_parameters(world, EnabledEffects(gusts=False, distance_error=False))
    quiet = given_.constants.replace(lane_deviation=0.0, glance_stagger=0.0)
    vehicle = given_.vehicle_table.copy()
    vehicle[VEHICLE_FIELDS.index("checks_blind_spot")] = 1.0
    return dataclasses.replace(given_, constants=quiet, vehicle_table=vehicle)


@pytest.mark.ci
@given(seed=seeds, index=indices)
@settings(max_examples=20)
def test_speeds_are_never_negative_and_accelerations_stay_physical(seed: int, index: list[int]):
    ran = simulated(seed, index)
    assert (ran.states.speed[present(ran)] >= 0).all()
    least, most = acceleration_shares(ran, step_parameters(ran.scenario))
    assert least >= 0.0
    assert most <= 1.0


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("max_brake_force", 0.9),
        ("launch_force", 0.9),
        ("power", 0.9),
        ("drag", 1.1),
        ("rolling", 1.1),
    ],
)
def test_bounds_of_acceleration_are_exceeded_if_one_force_is_a_tenth_off(name: str, factor: float):
    world = drawn(0, list(range(300)))
    given_ = step_parameters(world)
    ran = engine.run(world, given_)
    least, most = acceleration_shares(ran, given_)
    assert least >= 0.0
    assert most <= 1.0
    other = given_.vehicle_table.copy()
    other[VEHICLE_FIELDS.index(name)] *= np.float32(factor)
    least, most = acceleration_shares(ran, dataclasses.replace(given_, vehicle_table=other))
    assert least < 0.0 or most > 1.0


def acceleration_shares(ran: Trajectories, given_: StepParameters) -> tuple[float, float]:
    """Least and largest place of an acceleration between its bounds, which are 0 and 1."""
    seen = present(ran)
    seen[:, :, 0] = False  # The first frame comes before the first step.
    limits = bounds(ran, given_, driven=sound(ran))
    along = (ran.states.accel_lon / 1000.0 - limits.backward) / (limits.forward - limits.backward)
    across = 0.5 + 0.5 * ran.states.accel_lat / 1000.0 / limits.sideward
    every = np.concatenate([along[seen], across[seen]])
    return float(every.min()), float(every.max())


@given(seed=seeds, index=indices)
@settings(max_examples=20)
def test_the_world_position_is_that_of_the_road_to_the_rounding(seed: int, index: list[int]):
    ran = simulated(seed, index)
    valid = present(ran)
    x, y = ran.road.to_world(ran.states.s[valid] / 1000.0, ran.states.d[valid] / 1000.0)
    # Both are rounded to a millimetre, and float32 at up to 1.2 km to another 0.1 mm.
    np.testing.assert_allclose(ran.states.x[valid] / 1000.0, x, atol=1.2e-3)
    np.testing.assert_allclose(ran.states.y[valid] / 1000.0, y, atol=1.2e-3)


@pytest.mark.ci
@given(seed=seeds, index=indices)
@settings(max_examples=20)
def test_the_recorded_lane_is_the_roads(seed: int, index: list[int]):
    ran = simulated(seed, index)
    valid = present(ran)
    d = ran.states.d[valid] / 1000.0
    expected = ran.road.lane_index(d)
    expected = np.where(expected < 0, 255, expected)
    near_a_border = np.abs(d[:, None] - ran.road.lane_boundaries).min(axis=1) < 1e-3
    same = ran.states.lane[valid] == expected
    assert (same | near_a_border).all()


@pytest.mark.ci
@given(seed=seeds, index=indices)
@settings(max_examples=20)
def test_places_change_as_fast_as_the_speed_says(seed: int, index: list[int]):
    ran = simulated(seed, index)
    valid = sound(ran)[:, :, 1:] & sound(ran)[:, :, :-1]
    moved = np.hypot(np.diff(ran.states.s, axis=2), np.diff(ran.states.d, axis=2)) / 0.05
    speed = ran.states.speed.astype(float)
    mean = 0.5 * (speed[:, :, 1:] + speed[:, :, :-1])
    # A frame lasts 50 ms: rounding of two places by 0.5 mm each gives 28 mm/s, and the mean of
    # two speeds is that of two velocities up to how far they turn.
    assert np.abs(moved - mean)[valid].max() <= 100.0


@given(seed=seeds, index=indices)
@settings(max_examples=20)
def test_speed_changes_as_fast_as_the_acceleration_says(seed: int, index: list[int]):
    ran = simulated(seed, index)
    valid = sound(ran)[:, :, 1:] & sound(ran)[:, :, :-1]
    speed = ran.states.speed.astype(float)
    change = np.abs(np.diff(speed, axis=2)) / 0.05
    size = np.hypot(ran.states.accel_lon.astype(float), ran.states.accel_lat)
    most = np.maximum(size[:, :, 1:], size[:, :, :-1])
    # What is recorded is the last of five steps; within a frame the emergency jerk adds
    # 0.5 m/s^2 on average. A vehicle that creeps stands at once.
    stops = float(model_constants().standstill) * 1000.0 / 0.05 * (speed[:, :, 1:] == 0)
    assert (change - most - stops)[valid].max() <= 500.0


@pytest.mark.parametrize(("seed", "index"), [(219, 239), (1136812, 795287715)])
def test_a_gust_of_a_gale_stops_bicycles_as_fast_as_its_drag_says(seed: int, index: int):
    """At 114 km/h in gusts of 43 m/s drag alone slows a rider by 17 m/s^2."""
    ran = simulated(seed, [index])
    assert np.abs(ran.states.accel_lon[present(ran)]).max() > 10_000
    least, most = acceleration_shares(ran, step_parameters(ran.scenario))
    assert least >= 0.0
    assert most <= 1.0


@given(seed=seeds, index=indices)
# A bicycle at 14 km/h on water, which gusts of a gale push from one side and then from the other.
@example(seed=382215, index=[*range(12)])
@settings(max_examples=10)
def test_nothing_jumps_without_a_collision(seed: int, index: list[int]):
    ran = simulated(seed, index)
    valid = sound(ran)[:, :, 1:] & sound(ran)[:, :, :-1]
    jumps = {"s": 4_000, "d": 800, "yaw_rate": most_turn(ran), "wheel_angle": 220}
    for name, most in jumps.items():
        change = np.abs(np.diff(getattr(ran.states, name).astype(int), axis=2))
        assert (change <= most)[valid].all(), name


def most_turn(ran: Trajectories) -> np.ndarray:
    """Largest change of the yaw rate in a frame, (simulation, vehicle, time - 1) [1e-4 rad/s].

    The tyres of four wheels turn a body against its inertia. A two-wheeler is a point mass: its yaw
    rate is its lateral acceleration over its speed, the side wind pushes it at once, and friction
    alone limits it, to either side.
    """
    given_ = step_parameters(ran.scenario)
    grip = bounds(ran, given_, sound(ran)).sideward
    speed = ran.states.speed / 1000.0 - SPEED_ERROR
    turn = 1e4 * grip / np.maximum(speed, given_.constants.slip_speed)
    rides = ran.scenario.vehicles.two_wheeler[:, :, None]
    return np.where(rides, turn[:, :, 1:] + turn[:, :, :-1], 4_000)


@pytest.mark.ci
@given(seed=seeds, index=indices)
@settings(max_examples=10)
def test_frames_at_decisions_show_the_same_states(seed: int, index: list[int]):
    world = drawn(seed, index)
    fine = engine.simulate(world.replace(frame_interval_ms=50))
    for interval in (100, 200):
        coarse = engine.simulate(world.replace(frame_interval_ms=interval))
        every = interval // 50
        for name in STATE_NAMES:
            shown = getattr(coarse.states, name)
            frames = shown.shape[2]
            thinned = getattr(fine.states, name)[:, :, ::every][:, :, :frames]
            valid = present(coarse)[:, :, : thinned.shape[2]]
            np.testing.assert_array_equal(
                shown[:, :, : thinned.shape[2]][valid], thinned[valid], name
            )
        expected = (fine.num_frames - 1) // every + 1
        np.testing.assert_array_equal(coarse.num_frames, expected)


@pytest.mark.ci
@given(seed=seeds, index=indices)
@settings(max_examples=10)
def test_frames_between_decisions_come_from_shorter_steps_of_nearly_the_same_motion(
    seed: int, index: list[int]
):
    world = drawn(seed, index)
    fine = engine.simulate(world.replace(frame_interval_ms=10))
    usual = engine.simulate(world.replace(frame_interval_ms=50))
    # One second, before decisions part ways. The step promises 0.6 % of what is travelled.
    travelled = usual.states.s[:, :, :21].astype(np.int64)
    apart = np.abs(travelled - fine.states.s[:, :, :101:5])
    way = np.abs(travelled - travelled[:, :, :1]).max(axis=2, keepdims=True)
    assert (apart <= 0.006 * way + 2)[sound(usual)[:, :, :21]].all()


@given(seed=seeds, index=indices, frame=st.integers(0, 150))
@settings(max_examples=10)
def test_a_branch_with_nothing_changed_has_the_same_trace(seed: int, index: list[int], frame: int):
    world = drawn(seed, index)
    undisturbed = engine.simulate(world)
    again = branching.branch(world, frame)
    np.testing.assert_array_equal(again.trace_hash, undisturbed.trace_hash)


@given(seed=seeds, index=indices, frame=st.integers(20, 100))
@settings(max_examples=5)
def test_a_branch_changes_nothing_before_its_frame(seed: int, index: list[int], frame: int):
    world = drawn(seed, index)
    one = engine.simulate(world)
    two = branching.branch(world, frame, decision=branching.ForcedDecision.STAY)
    for name in STATE_NAMES:
        left, right = (getattr(ran.states, name)[:, :, :frame] for ran in (one, two))
        valid = present(one)[:, :, :frame]
        np.testing.assert_array_equal(left[valid], right[valid], name)


@given(seed=seeds, index=indices)
@settings(max_examples=20)
def test_simulations_end_by_the_rules(seed: int, index: list[int]):
    ran = simulated(seed, index)
    for i in range(len(index)):
        stages = ran.stage[i, : ran.num_frames[i]]
        ends = [float(ran.scenario.horizon[i])]
        for stage, after in ((Stage.DONE, 3.0), (Stage.CRASHED, 2.0)):
            if (stages == stage).any():
                ends.append(int(np.argmax(stages == stage)) * 0.05 + after)
        if stages[-1] == Stage.FOLLOW:
            # Who waits at the deadline ends there, for the first time or again after giving up;
            # who signals goes on a little, and then goes or gives up.
            waited = (len(stages) - 1) * 0.05
            assert float(ran.scenario.attempt_deadline[i]) - 1e-6 <= waited <= ends[0] + 1e-6
            continue
        # The stage is recorded with its frame, the instant lies up to 50 ms before it.
        assert (len(stages) - 1) * 0.05 == pytest.approx(min(ends), abs=0.051)


@given(seed=seeds, index=indices)
@settings(max_examples=10)
def test_stages_follow_each_other_as_the_state_machine_allows(seed: int, index: list[int]):
    allowed = {
        Stage.FOLLOW: {Stage.PULL_OUT},
        Stage.PULL_OUT: {Stage.PASS, Stage.ABORT},
        Stage.PASS: {Stage.RETURN, Stage.ABORT},
        Stage.RETURN: {Stage.DONE, Stage.PASS},
        Stage.ABORT: {Stage.FOLLOW, Stage.PASS},
        Stage.DONE: set(),
        Stage.CRASHED: set(),
    }
    ran = simulated(seed, index)
    for i in range(len(index)):
        stages = ran.stage[i, : ran.num_frames[i]]
        for now, then in pairwise(stages):
            if now != then and then != Stage.CRASHED:
                assert Stage(then) in allowed[Stage(now)]


def test_a_real_map_gives_the_same_simulations_as_the_road_known_by_name():
    world = sampler.ScenarioSource(
        profiles.load_specification("pinto2023-physical"), load_road("town06"), 3
    ).sample(np.arange(8, dtype=np.uint64))
    again = world.replace(road=known_road("town06"))
    np.testing.assert_array_equal(
        engine.simulate(world).trace_hash, engine.simulate(again).trace_hash
    )
