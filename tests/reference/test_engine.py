"""The engine records the same bits as the readable reference, whatever the batch and the CPU."""

from __future__ import annotations

import dataclasses
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from overtaking import _core
from overtaking.core.arrays import Buffers
from overtaking.model.scenario import SLOT_CAPACITIES
from overtaking.model.trajectories import Lights, ManoeuvreKind, Stage
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import branching, engine, reference
from overtaking.world.step_parameters import step_parameters

from .scenes import WRITTEN
from .situations import FURTHER, SITUATIONS, SMALL, Situation, arrays, difference, turned_round

if TYPE_CHECKING:
    from overtaking.model.scenario import Scenario
    from overtaking.model.trajectories import Trajectories

pytestmark = pytest.mark.ci

LEVELS = [name for name, available in _core.simd_levels() if available]

each_situation = pytest.mark.parametrize(
    "situation", SITUATIONS, ids=lambda item: item.name.replace(" ", "-")
)


@cache
def simulated(situation: Situation) -> Trajectories:
    return situation.run(situation.scenario(situation.share), engine.run)


@pytest.mark.parametrize(
    "situation",
    [*SITUATIONS, *FURTHER, *WRITTEN],
    ids=lambda item: item.name.replace(" ", "-"),
)
def test_engine_and_reference_record_the_same_bits(situation):
    scenario = situation.scenario(situation.share)
    expected = situation.run(scenario, reference.run)
    for level in LEVELS:
        run = partial(engine.run, level=level)
        assert not (mismatch := difference(situation.run(scenario, run), expected)), (
            f"{level}: {mismatch}"
        )


CROWDED = {
    "profile.road": "motorway",
    "time.horizon_s": 4.0,
    "time.attempt_deadline_s": 4.0,
    "traffic.spawn_s_m": [50.0, 650.0],
    "starts.min_gap_m": 5.0,
}


@pytest.mark.parametrize("vehicles", [[9, 16], [17, 32]])
def test_engine_and_reference_record_the_same_bits_with_16_and_32_slots(vehicles):
    crowded = load_specification("pinto2023-physical", CROWDED | {"traffic.vehicles": vehicles})
    scenario = ScenarioSource(crowded, load_road("motorway"), 4).sample(
        np.arange(18, dtype=np.uint64)
    )
    assert scenario.num_slots == vehicles[1]
    parameters = step_parameters(scenario)
    expected = reference.run(scenario, parameters)
    assert expected.num_frames.max() == 81
    for level in LEVELS:
        mismatch = difference(engine.run(scenario, parameters, level=level), expected)
        assert not mismatch, f"{level}: {mismatch}"


def test_further_situations_show_the_events_in_their_names():
    pushed, *lane_changing, two_way, winding, curved_two_way = FURTHER
    pushes = step_parameters(pushed.scenario(pushed.share)).simulations.push_accel
    assert (pushes != 0).all()
    for situation in lane_changing:
        lane = simulated(situation).states.lane.astype(int)
        is_lane_change = (np.diff(lane, axis=2) != 0) & (lane[:, :, 1:] < 3)
        assert is_lane_change.any(axis=2).sum() >= 5  # Vehicles that change lanes.
    run = simulated(two_way)
    assert (step_parameters(run.scenario).vehicles.travel_sign < 0).any()
    assert (run.stage == Stage.PULL_OUT).any()
    assert simulated(winding).road.is_curved
    run = simulated(curved_two_way)
    assert run.road.is_curved
    assert run.road.is_two_way
    assert (run.stage == Stage.ABORT).any()
    assert (
        run.states.lights & int(Lights.HIGH_BEAM)
    ).any()  # An oncoming driver flashes at the ego.


@pytest.mark.parametrize("slots", SLOT_CAPACITIES)
def test_empty_slots_change_nothing(slots):
    full_run = simulated(SITUATIONS[0])
    scenario = with_slots(full_run.scenario, slots)
    for level in LEVELS:
        run = engine.run(scenario, step_parameters(scenario), level=level)
        np.testing.assert_array_equal(run.trace_hash, full_run.trace_hash)


def with_slots(scenario: Scenario, slots: int) -> Scenario:
    """The same simulations with more, empty slots."""

    def add_slots(values: np.ndarray) -> np.ndarray:
        empty_slots = np.repeat(values[:, -1:], slots - values.shape[1], axis=1)
        return np.concatenate([values, empty_slots], axis=1)

    def with_more_slots(batch: Any) -> Any:
        names = [field.name for field in dataclasses.fields(batch)]
        return batch.replace(**{name: add_slots(getattr(batch, name)) for name in names})

    vehicles = with_more_slots(scenario.vehicles)
    is_empty_slot = np.arange(slots) >= scenario.num_slots
    return scenario.replace(
        vehicles=vehicles.replace(valid=vehicles.valid & ~is_empty_slot),
        drivers=with_more_slots(scenario.drivers),
        **{
            name: add_slots(getattr(scenario, name))
            for name in ("start_s", "start_lane", "start_speed")
        },
    )


@each_situation
def test_a_simulation_is_the_same_in_any_batch(situation):
    full_run = simulated(situation)
    count = situation.share
    scenario = full_run.scenario
    order = np.random.default_rng(1).permutation(count)
    shuffled = situation.run(scenario.select(order), engine.run)
    assert not difference(shuffled, dataclasses.replace(full_run.select(order), scenario=scenario))
    for size in (1, 15, 16, 17):
        part = situation.run(scenario.select(slice(3, 3 + size)), engine.run)
        np.testing.assert_array_equal(part.trace_hash, full_run.trace_hash[3 : 3 + size])
        longest = part.stage.shape[1]
        np.testing.assert_array_equal(part.states.x, full_run.states.x[3 : 3 + size, :, :longest])


def test_reused_memory_changes_nothing():
    buffers = Buffers()
    for situation in sorted(SITUATIONS, key=lambda situation: -simulated(situation).states.x.size):
        expected = simulated(situation)
        run = lambda *arguments: engine.run(*arguments, buffers=buffers)  # noqa: E731
        assert not difference(situation.run(expected.scenario, run), expected)


def test_frames_after_the_end_of_a_simulation_are_zero_in_reused_memory():
    specification, buffers = load_specification("pinto2023-physical"), Buffers()
    road, num_frames = load_road(specification.road), []
    for first in range(0, 192, 48):
        index = np.arange(first, first + 48, dtype=np.uint64)
        run = engine.simulate(ScenarioSource(specification, road, 3).sample(index), buffers=buffers)
        is_recorded = run.frame_mask[:, None] & run.scenario.vehicles.valid[:, :, None]
        for field in dataclasses.fields(run.states):
            assert not getattr(run.states, field.name)[~is_recorded].any(), field.name
        num_frames.append(run.num_frames.copy())
    assert (num_frames[0] > num_frames[1]).any()  # The buffers held longer simulations before.


def test_recorded_states_are_read_only():
    run = simulated(SITUATIONS[0])
    with pytest.raises(ValueError, match="read-only"):
        run.states.x[0, 0, 0] = 1


def test_the_situations_contain_all_stages_manoeuvres_and_vehicle_kinds():
    runs = [simulated(situation) for situation in SITUATIONS]
    assert sum(len(run.num_frames) for run in runs) == SMALL
    stages = set(np.concatenate([run.stage[run.frame_mask] for run in runs]))
    assert stages == {int(stage) for stage in Stage}
    kinds = set(np.concatenate([run.percepts.kind[run.percepts.valid] for run in runs]))
    assert kinds == {int(kind) for kind in ManoeuvreKind}
    ends = [run.stage[np.arange(len(run.num_frames)), run.num_frames - 1] for run in runs]
    assert Stage.DONE in np.concatenate(ends)
    bodies = [run.scenario.vehicles for run in runs]
    assert set(np.concatenate([body.kind[body.valid] for body in bodies])) == set(VehicleKind)
    counts = {int(count) for run in runs for count in run.scenario.num_vehicles}
    assert counts == {2, 3, 4, 5, 6, 7, 8}
    assert {run.scenario.frame_interval_ms for run in runs} == {10, 50, 100}
    assert {run.road.overtaking_sign for run in runs} == {1.0, -1.0}


def test_the_situations_have_collisions_of_every_kind():
    runs = [simulated(situation) for situation in SITUATIONS]
    hits = [run.contacts.partner != 255 for run in runs]
    assert sum(int(is_hit[:, 0].sum()) for is_hit in hits) >= 10  # The ego and another one.
    assert (
        sum(int((is_hit.any(axis=1) & ~is_hit[:, 0]).sum()) for is_hit in hits) >= 3
    )  # Two others.
    two_wheelers = sum(
        int((is_hit & run.scenario.vehicles.two_wheeler).sum())
        for is_hit, run in zip(hits, runs, strict=True)
    )
    assert two_wheelers >= 3


def hash_in_plain_integers(run: Trajectories, n: int) -> list[int]:
    """The trace hash as its definition says, with Python's integers and one word at a time."""
    prime_1, prime_2, prime_3 = 2654435761, 2246822519, 3266489917
    word, low = 2**32, 2**32 - 1
    state = [(prime_1 + prime_2) % word, prime_2, 0, -prime_1 % word]

    def rotated(number: int, bits: int) -> int:
        return ((number << bits) | (number >> (32 - bits))) & low

    def mix(numbers: list[int]) -> None:
        for position, number in enumerate(numbers):
            total = (state[position % 4] + (number % word) * prime_2) % word
            state[position % 4] = rotated(total, 13) * prime_1 % word

    valid = np.flatnonzero(run.scenario.vehicles.valid[n])
    states = {
        field.name: getattr(run.states, field.name)[n] for field in dataclasses.fields(run.states)
    }
    for frame in range(int(run.num_frames[n])):
        for slot in valid:
            mix([int(values[slot, frame]) for values in states.values()])
        mix([int(run.stage[n, frame]), int(run.collided_with[n, frame]), frame, 0])
    contacts, percepts = run.contacts, run.percepts
    for slot in valid:
        mix(
            [
                int(values[n, slot])
                for values in (
                    contacts.partner,
                    contacts.time,
                    contacts.impulse,
                    contacts.closing_speed,
                )
            ]
        )
    triples = (
        percepts.slot,
        percepts.is_detected,
        percepts.gap,
        percepts.closing_speed,
        percepts.true_gap,
        percepts.true_closing_speed,
    )
    for k in np.flatnonzero(percepts.valid[n]):
        words = [int(values[n, k, column]) for column in range(3) for values in triples]
        mix([int(percepts.kind[n, k]), int(percepts.time[n, k]), *words])
    total = [(state[k] + rotated(state[(k + 1) % 4], 7)) % word for k in range(4)]
    total = [(number ^ (number >> 15)) * prime_2 % word for number in total]
    total = [(number ^ (number >> 13)) * prime_3 % word for number in total]
    return [number ^ (number >> 16) for number in total]


@pytest.mark.parametrize("name", ["study", "storm", "left-hand traffic"])
def test_the_trace_hash_follows_its_definition_in_plain_integers(name):
    run = simulated(next(situation for situation in SITUATIONS if situation.name == name))
    interesting = np.argsort(
        -run.percepts.valid.sum(axis=1) - 5 * (run.contacts.partner != 255).any(axis=1)
    )
    for n in interesting[:3]:
        assert hash_in_plain_integers(run, n) == run.trace_hash[n].tolist()


@each_situation
def test_a_branch_without_a_change_is_the_undisturbed_simulation(situation):
    scenario = situation.scenario(20)
    undisturbed = engine.simulate(scenario)
    for frame in (0, 1, 7, 40):
        assert not difference(branching.branch(scenario, frame), undisturbed)


@pytest.mark.parametrize("decision", branching.ForcedDecision)
def test_a_branch_equals_a_run_that_changes_parameters_at_its_frame(decision):
    situation = next(situation for situation in SITUATIONS if situation.switch is not None)
    assert situation.switch is not None
    mixed = simulated(situation)
    scenario = mixed.scenario
    has_decision = scenario.scenario_index % len(branching.ForcedDecision) == int(decision)
    frame = situation.switch * 10 // scenario.frame_interval_ms
    weather = turned_round(scenario.weather)
    branched = branching.branch(scenario, frame, decision=decision, weather=weather)
    np.testing.assert_array_equal(branched.trace_hash[has_decision], mixed.trace_hash[has_decision])


def test_a_difference_of_one_bit_is_found():
    run = simulated(SITUATIONS[0])
    for name, values in arrays(run).items():
        changed = values.copy()
        changed.reshape(-1)[-1] ^= changed.dtype.type(1)
        owner, _, field = name.rpartition(".")
        part = getattr(run, owner).replace(**{field: changed}) if owner else changed
        mismatch = difference(run.replace(**{owner or field: part}), run)
        assert mismatch.startswith(name), name
