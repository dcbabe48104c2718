"""Properties of every simulation, for any seed and index.

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


def sampled(seed: int, index: list[int]) -> Scenario:
    return sampler.ScenarioSource(
        profiles.load_specification("pinto2023-physical"), ROAD, seed
    ).sample(np.array(index, np.uint64))


def simulated(seed: int, index: list[int]) -> Trajectories:
    return engine.simulate(sampled(seed, index))


def is_recorded_vehicle(run: Trajectories) -> np.ndarray:
    """Recorded frames of existing vehicles, (simulation, vehicle, time)."""
    return run.frame_mask[:, None, :] & run.scenario.vehicles.valid[:, :, None]


def is_undisturbed(run: Trajectories) -> np.ndarray:
    """Recorded frames before each vehicle's first collision, while it keeps to the lanes."""
    touched = run.contacts.partner != NO_VEHICLE
    first_contact = np.where(touched, run.contacts.time, np.iinfo(np.int32).max)
    edges = np.sort(run.road.lane_boundaries)
    d = run.states.d / 1000.0
    psi = run.states.heading / 1e4 - run.road.heading
    is_off_lanes = (d < edges[0] - 0.9) | (d > edges[-1] + 0.9) | (np.abs(psi) > 0.75)
    is_on_lanes = np.cumsum(is_off_lanes & is_recorded_vehicle(run), axis=2) == 0
    return is_recorded_vehicle(run) & is_on_lanes & (run.time_ms < first_contact[:, :, None])


def assert_equal(left_run: Trajectories, right_run: Trajectories) -> None:
    np.testing.assert_array_equal(left_run.trace_hash, right_run.trace_hash)
    np.testing.assert_array_equal(left_run.num_frames, right_run.num_frames)
    mask = left_run.frame_mask
    for name in STATE_NAMES:
        left, right = getattr(left_run.states, name), getattr(right_run.states, name)
        np.testing.assert_array_equal(
            np.where(mask[:, None], left, 0), np.where(mask[:, None], right, 0)
        )
    np.testing.assert_array_equal(
        np.where(mask, left_run.stage, 0), np.where(mask, right_run.stage, 0)
    )


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
    world = sampled(seed, [0, 1, 2]).replace(horizon=np.full(3, 4.0, np.float32))
    batch = reference.simulate(world)
    alone = reference.simulate(world.select(slice(1, 2)))
    np.testing.assert_array_equal(alone.trace_hash[0], batch.trace_hash[1])


@given(seed=seeds, index=indices)
@settings(max_examples=10)
def test_joining_batches_changes_nothing(seed: int, index: list[int]):
    world = sampled(seed, index)
    halves = [world.select(slice(0, 6)), world.select(slice(6, 12))]
    joined = engine.simulate(concatenate(halves))
    np.testing.assert_array_equal(joined.trace_hash, engine.simulate(world).trace_hash)


@pytest.mark.ci
@given(seed=seeds, index=indices)
@settings(max_examples=15)
def test_a_mirrored_world_gives_the_mirror_image_bit_for_bit(seed: int, index: list[int]):
    # Left-hand traffic is right-hand traffic in a mirror: not one rounding may differ.
    world = sampled(seed, index)
    run, mirrored_run = engine.simulate(world), engine.simulate(mirror_scenario(world))
    for name in ("s", "speed", "accel_lon", "lane", "x"):
        np.testing.assert_array_equal(
            getattr(run.states, name), getattr(mirrored_run.states, name), name
        )
    for name in ("d", "y", "wheel_angle", "accel_lat", "yaw_rate"):
        np.testing.assert_array_equal(
            getattr(run.states, name), -getattr(mirrored_run.states, name), name
        )
    is_unmirrored = run.states.heading != -mirrored_run.states.heading
    # The heading lies in (-pi, pi]: pi itself has no mirror image.
    assert (np.abs(run.states.heading[is_unmirrored]) >= round(math.pi * 1e4)).all()
    np.testing.assert_array_equal(run.stage, mirrored_run.stage)
    np.testing.assert_array_equal(run.num_frames, mirrored_run.num_frames)
    np.testing.assert_array_equal(mirror_lights(run.states.lights), mirrored_run.states.lights)
    for field in dataclasses.fields(run.contacts):
        np.testing.assert_array_equal(
            getattr(run.contacts, field.name), getattr(mirrored_run.contacts, field.name)
        )


@given(seed=seeds, index=indices, steps=st.integers(1, 400))
@settings(max_examples=10)
def test_a_shift_along_the_road_changes_nothing_else(seed: int, index: list[int], steps: int):
    # Starts and the shift are multiples of 1/16 m, so that the differences of positions keep their
    # bits at first; later each position is rounded to a float32 of up to a kilometre, 6e-5 m.
    world = dry(sampled(seed, index))
    grid = np.rint(world.start_s * np.float32(16.0)) / np.float32(16.0)
    shift = np.float32(steps * 0.0625)
    placed = [world.replace(start_s=start) for start in (grid, grid + shift)]
    run, shifted_run = (
        engine.run(scene, step_parameters(scene, EnabledEffects(gusts=False))) for scene in placed
    )
    differences = shifted_by(run, shifted_run, float(shift))
    # A last bit may change a decision at its threshold: of 6,000 simulations 0.5 % differ by
    # more than 10 mm, so four of twelve have a probability of 4e-7.
    differences = np.sort(differences)
    assert differences[6] <= 5
    assert differences[-4] <= 10


def dry(world: Scenario) -> Scenario:
    """The same scenario without rain and puddles.

    Puddles have fixed positions, and sliding magnifies the last bit of a position to centimetres.
    """
    zeros = np.zeros_like(world.weather.rain)
    return world.replace(weather=world.weather.replace(rain=zeros, puddles=zeros))


def shifted_by(left_run: Trajectories, right_run: Trajectories, shift: float) -> np.ndarray:
    """Largest difference of s, d or speed after undoing a shift, (simulation,) [mm, mm/s]."""
    frames = min(left_run.stage.shape[1], right_run.stage.shape[1])
    valid = (
        (is_recorded_vehicle(left_run)[:, :, :frames])
        & (is_recorded_vehicle(right_run)[:, :, :frames])
    )
    differences = np.zeros(len(left_run.num_frames))
    for name in ("s", "d", "speed"):
        left, right = (
            getattr(run.states, name)[:, :, :frames].astype(float) for run in (left_run, right_run)
        )
        left = left + (shift * 1000.0 if name == "s" else 0.0)
        differences = np.maximum(
            differences, np.where(valid, np.abs(left - right), 0.0).max(axis=(1, 2))
        )
    return np.where(left_run.num_frames == right_run.num_frames, differences, np.inf)


@pytest.mark.ci
@given(seed=seeds, index=indices, order=st.permutations(range(1, 6)))
# The ego hits two crashed vehicles within one step of 10 ms.
@example(seed=551, index=[*range(11), 1637903], order=[1, 2, 4, 3, 5])
@settings(max_examples=10)
def test_the_order_of_the_other_vehicles_is_irrelevant(
    seed: int, index: list[int], order: list[int]
):
    # Random numbers and glance times belong to slots. The test switches their effects off: gusts,
    # wander in the lane, errors of judgement and looks over the shoulder. Ties between equally near
    # neighbours do not occur in drawn scenarios.
    world = sampled(seed, index)
    shuffle = np.array([0, *order])
    reordered_world = reorder_scenario(world, shuffle)
    run, reordered_run = (
        engine.run(scene, without_errors(scene)) for scene in (world, reordered_world)
    )
    # Which of two vehicles comes first decides the rounding of the impulse between them, so the
    # equality of bits ends with the first contact in a simulation.
    first_contact = np.where(
        reordered_run.contacts.partner != NO_VEHICLE, reordered_run.contacts.time, 10**9
    ).min(axis=1)
    untouched = (
        is_recorded_vehicle(reordered_run)
        & (reordered_run.time_ms < first_contact[:, None])[:, None, :]
    )
    for name in STATE_NAMES:
        recorded = getattr(run.states, name)[:, shuffle]
        np.testing.assert_array_equal(
            recorded[untouched], getattr(reordered_run.states, name)[untouched], name
        )
    np.testing.assert_array_equal(run.num_frames, reordered_run.num_frames)
    renamed = new_slots(shuffle)[run.contacts.partner[:, shuffle]]
    np.testing.assert_array_equal(
        renamed == NO_VEHICLE, reordered_run.contacts.partner == NO_VEHICLE
    )
    is_first_contact = reordered_run.contacts.time == first_contact[:, None]
    np.testing.assert_array_equal(
        renamed[is_first_contact], reordered_run.contacts.partner[is_first_contact]
    )


def without_errors(world: Scenario):
    parameters = step_parameters(world, EnabledEffects(gusts=False, distance_error=False))
    quiet = parameters.constants.replace(lane_deviation=0.0, glance_stagger=0.0)
    vehicle = parameters.vehicle_table.copy()
    vehicle[VEHICLE_FIELDS.index("checks_blind_spot")] = 1.0
    return dataclasses.replace(parameters, constants=quiet, vehicle_table=vehicle)


@pytest.mark.ci
@given(seed=seeds, index=indices)
@settings(max_examples=20)
def test_speeds_are_never_negative_and_accelerations_stay_within_physical_bounds(
    seed: int, index: list[int]
):
    run = simulated(seed, index)
    assert (run.states.speed[is_recorded_vehicle(run)] >= 0).all()
    least, most = acceleration_shares(run, step_parameters(run.scenario))
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
    world = sampled(0, list(range(300)))
    parameters = step_parameters(world)
    run = engine.run(world, parameters)
    least, most = acceleration_shares(run, parameters)
    assert least >= 0.0
    assert most <= 1.0
    changed_table = parameters.vehicle_table.copy()
    changed_table[VEHICLE_FIELDS.index(name)] *= np.float32(factor)
    least, most = acceleration_shares(
        run, dataclasses.replace(parameters, vehicle_table=changed_table)
    )
    assert least < 0.0 or most > 1.0


def acceleration_shares(run: Trajectories, parameters: StepParameters) -> tuple[float, float]:
    """Least and largest acceleration as a share, with 0 and 1 at its lower and upper bound."""
    is_recorded = is_recorded_vehicle(run)
    is_recorded[:, :, 0] = False  # The first frame comes before the first step.
    limits = bounds(run, parameters, driven=is_undisturbed(run))
    along = (run.states.accel_lon / 1000.0 - limits.backward) / (limits.forward - limits.backward)
    across = 0.5 + 0.5 * run.states.accel_lat / 1000.0 / limits.sideward
    shares = np.concatenate([along[is_recorded], across[is_recorded]])
    return float(shares.min()), float(shares.max())


@given(seed=seeds, index=indices)
@settings(max_examples=20)
def test_the_world_position_equals_the_road_position_up_to_rounding(seed: int, index: list[int]):
    run = simulated(seed, index)
    valid = is_recorded_vehicle(run)
    x, y = run.road.to_world(run.states.s[valid] / 1000.0, run.states.d[valid] / 1000.0)
    # Both are rounded to a millimetre, and float32 at up to 1.2 km to another 0.1 mm.
    np.testing.assert_allclose(run.states.x[valid] / 1000.0, x, atol=1.2e-3)
    np.testing.assert_allclose(run.states.y[valid] / 1000.0, y, atol=1.2e-3)


@pytest.mark.ci
@given(seed=seeds, index=indices)
@settings(max_examples=20)
def test_the_recorded_lane_is_the_lane_of_the_road_at_the_vehicle(seed: int, index: list[int]):
    run = simulated(seed, index)
    valid = is_recorded_vehicle(run)
    d = run.states.d[valid] / 1000.0
    expected = run.road.lane_index(d)
    expected = np.where(expected < 0, 255, expected)
    is_near_border = np.abs(d[:, None] - run.road.lane_boundaries).min(axis=1) < 1e-3
    is_same = run.states.lane[valid] == expected
    assert (is_same | is_near_border).all()


@pytest.mark.ci
@given(seed=seeds, index=indices)
@settings(max_examples=20)
def test_positions_change_at_the_recorded_speed(seed: int, index: list[int]):
    run = simulated(seed, index)
    valid = is_undisturbed(run)[:, :, 1:] & is_undisturbed(run)[:, :, :-1]
    displacement_speed = (
        np.hypot(np.diff(run.states.s, axis=2), np.diff(run.states.d, axis=2)) / 0.05
    )
    speed = run.states.speed.astype(float)
    mean = 0.5 * (speed[:, :, 1:] + speed[:, :, :-1])
    # A frame lasts 50 ms: rounding of two places by 0.5 mm each gives 28 mm/s, and the mean of
    # two speeds differs from the mean velocity by the turn within the frame.
    assert np.abs(displacement_speed - mean)[valid].max() <= 100.0


@given(seed=seeds, index=indices)
@settings(max_examples=20)
def test_speeds_change_at_most_at_the_recorded_acceleration(seed: int, index: list[int]):
    run = simulated(seed, index)
    valid = is_undisturbed(run)[:, :, 1:] & is_undisturbed(run)[:, :, :-1]
    speed = run.states.speed.astype(float)
    change = np.abs(np.diff(speed, axis=2)) / 0.05
    accel = np.hypot(run.states.accel_lon.astype(float), run.states.accel_lat)
    largest_accel = np.maximum(accel[:, :, 1:], accel[:, :, :-1])
    # The recorded acceleration is from the last of five steps; within a frame the emergency jerk
    # adds 0.5 m/s^2 on average. A creeping vehicle stands still at once.
    stops = float(model_constants().standstill) * 1000.0 / 0.05 * (speed[:, :, 1:] == 0)
    assert (change - largest_accel - stops)[valid].max() <= 500.0


@pytest.mark.parametrize(("seed", "index"), [(219, 239), (1136812, 795287715)])
def test_a_gust_of_a_gale_slows_a_bicycle_only_by_its_drag(seed: int, index: int):
    """At 114 km/h in gusts of 43 m/s drag alone slows a rider by 17 m/s^2."""
    run = simulated(seed, [index])
    assert np.abs(run.states.accel_lon[is_recorded_vehicle(run)]).max() > 10_000
    least, most = acceleration_shares(run, step_parameters(run.scenario))
    assert least >= 0.0
    assert most <= 1.0


@given(seed=seeds, index=indices)
# A bicycle at 14 km/h on water, which gusts of a gale push from one side and then from the other.
@example(seed=382215, index=[*range(12)])
@settings(max_examples=10)
def test_positions_and_angles_do_not_jump_without_a_collision(seed: int, index: list[int]):
    run = simulated(seed, index)
    valid = is_undisturbed(run)[:, :, 1:] & is_undisturbed(run)[:, :, :-1]
    jumps = {"s": 4_000, "d": 800, "yaw_rate": largest_yaw_rate_change(run), "wheel_angle": 220}
    for name, limit in jumps.items():
        change = np.abs(np.diff(getattr(run.states, name).astype(int), axis=2))
        assert (change <= limit)[valid].all(), name


def largest_yaw_rate_change(run: Trajectories) -> np.ndarray:
    """Largest change of the yaw rate in a frame, (simulation, vehicle, time - 1) [1e-4 rad/s].

    The tyres of four wheels turn a body against its inertia. A two-wheeler is a point mass: its yaw
    rate is its lateral acceleration over its speed, the side wind pushes it at once, and friction
    alone limits it, to either side.
    """
    parameters = step_parameters(run.scenario)
    grip = bounds(run, parameters, is_undisturbed(run)).sideward
    speed = run.states.speed / 1000.0 - SPEED_ERROR
    turn = 1e4 * grip / np.maximum(speed, parameters.constants.slip_speed)
    is_two_wheeler = run.scenario.vehicles.two_wheeler[:, :, None]
    return np.where(is_two_wheeler, turn[:, :, 1:] + turn[:, :, :-1], 4_000)


@pytest.mark.ci
@given(seed=seeds, index=indices)
@settings(max_examples=10)
def test_frames_at_decisions_show_the_same_states(seed: int, index: list[int]):
    world = sampled(seed, index)
    fine = engine.simulate(world.replace(frame_interval_ms=50))
    for interval in (100, 200):
        coarse = engine.simulate(world.replace(frame_interval_ms=interval))
        stride = interval // 50
        for name in STATE_NAMES:
            coarse_values = getattr(coarse.states, name)
            frames = coarse_values.shape[2]
            thinned = getattr(fine.states, name)[:, :, ::stride][:, :, :frames]
            valid = is_recorded_vehicle(coarse)[:, :, : thinned.shape[2]]
            np.testing.assert_array_equal(
                coarse_values[:, :, : thinned.shape[2]][valid], thinned[valid], name
            )
        expected = (fine.num_frames - 1) // stride + 1
        np.testing.assert_array_equal(coarse.num_frames, expected)


@pytest.mark.ci
@given(seed=seeds, index=indices)
@settings(max_examples=10)
def test_shorter_frames_give_nearly_the_same_motion(seed: int, index: list[int]):
    world = sampled(seed, index)
    fine = engine.simulate(world.replace(frame_interval_ms=10))
    usual = engine.simulate(world.replace(frame_interval_ms=50))
    # One second, before decisions differ. The step promises 0.6 % of the travelled distance.
    usual_s = usual.states.s[:, :, :21].astype(np.int64)
    distance = np.abs(usual_s - fine.states.s[:, :, :101:5])
    travelled_distance = np.abs(usual_s - usual_s[:, :, :1]).max(axis=2, keepdims=True)
    assert (distance <= 0.006 * travelled_distance + 2)[is_undisturbed(usual)[:, :, :21]].all()


@given(seed=seeds, index=indices, frame=st.integers(0, 150))
@settings(max_examples=10)
def test_a_branch_with_nothing_changed_has_the_same_trace(seed: int, index: list[int], frame: int):
    world = sampled(seed, index)
    undisturbed = engine.simulate(world)
    branched = branching.branch(world, frame)
    np.testing.assert_array_equal(branched.trace_hash, undisturbed.trace_hash)


@given(seed=seeds, index=indices, frame=st.integers(20, 100))
@settings(max_examples=5)
def test_a_branch_changes_nothing_before_its_frame(seed: int, index: list[int], frame: int):
    world = sampled(seed, index)
    run = engine.simulate(world)
    branched_run = branching.branch(world, frame, decision=branching.ForcedDecision.STAY)
    for name in STATE_NAMES:
        left, right = (
            getattr(trajectories.states, name)[:, :, :frame] for trajectories in (run, branched_run)
        )
        valid = is_recorded_vehicle(run)[:, :, :frame]
        np.testing.assert_array_equal(left[valid], right[valid], name)


@given(seed=seeds, index=indices)
@settings(max_examples=20)
def test_simulations_end_at_the_first_applicable_limit(seed: int, index: list[int]):
    run = simulated(seed, index)
    for i in range(len(index)):
        stages = run.stage[i, : run.num_frames[i]]
        ends = [float(run.scenario.horizon[i])]
        for stage, after in ((Stage.DONE, 3.0), (Stage.CRASHED, 2.0)):
            if (stages == stage).any():
                ends.append(int(np.argmax(stages == stage)) * 0.05 + after)
        if stages[-1] == Stage.FOLLOW:
            # A simulation ends at the deadline if the ego still follows or follows again after an
            # abort. An ego that already indicates has a little longer to pull out or give up.
            waited = (len(stages) - 1) * 0.05
            assert float(run.scenario.attempt_deadline[i]) - 1e-6 <= waited <= ends[0] + 1e-6
            continue
        # A frame records the stage up to 50 ms after its change.
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
    run = simulated(seed, index)
    for i in range(len(index)):
        stages = run.stage[i, : run.num_frames[i]]
        for stage, next_stage in pairwise(stages):
            if stage != next_stage and next_stage != Stage.CRASHED:
                assert Stage(next_stage) in allowed[Stage(stage)]


def test_a_real_map_gives_the_same_simulations_as_the_road_known_by_name():
    world = sampler.ScenarioSource(
        profiles.load_specification("pinto2023-physical"), load_road("town06"), 3
    ).sample(np.arange(8, dtype=np.uint64))
    again = world.replace(road=known_road("town06"))
    np.testing.assert_array_equal(
        engine.simulate(world).trace_hash, engine.simulate(again).trace_hash
    )
