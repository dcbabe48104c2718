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
    "situation", SITUATIONS, ids=lambda one: one.name.replace(" ", "-")
)


@cache
def simulated(situation: Situation) -> Trajectories:
    return situation.run(situation.scenario(situation.share), engine.run)


@pytest.mark.parametrize(
    "situation",
    [*SITUATIONS, *FURTHER, *WRITTEN],
    ids=lambda one: one.name.replace(" ", "-"),
)
def test_engine_and_reference_record_the_same_bits(situation):
    scenario = situation.scenario(situation.share)
    expected = situation.run(scenario, reference.run)
    for level in LEVELS:
        run = partial(engine.run, level=level)
        assert not (found := difference(situation.run(scenario, run), expected)), (
            f"{level}: {found}"
        )


CROWDED = {
    "profile.road": "motorway",
    "time.horizon_s": 4.0,
    "time.attempt_deadline_s": 4.0,
    "traffic.spawn_s_m": [50.0, 650.0],
    "starts.min_gap_m": 5.0,
}


@pytest.mark.parametrize("vehicles", [[9, 16], [17, 32]])
def test_the_same_bits_come_out_of_sixteen_and_of_thirty_two_slots(vehicles):
    crowded = load_specification("pinto2023-physical", CROWDED | {"traffic.vehicles": vehicles})
    scenario = ScenarioSource(crowded, load_road("motorway"), 4).sample(
        np.arange(18, dtype=np.uint64)
    )
    assert scenario.num_slots == vehicles[1]
    given = step_parameters(scenario)
    expected = reference.run(scenario, given)
    assert expected.num_frames.max() == 81
    for level in LEVELS:
        found = difference(engine.run(scenario, given, level=level), expected)
        assert not found, f"{level}: {found}"


def test_further_situations_are_what_they_are_called():
    told, *met, two_way, winding, meeting = FURTHER
    pushes = step_parameters(told.scenario(told.share)).simulations.push_accel
    assert (pushes != 0).all()
    for situation in met:
        lane = simulated(situation).states.lane.astype(int)
        changed = (np.diff(lane, axis=2) != 0) & (lane[:, :, 1:] < 3)
        assert changed.any(axis=2).sum() >= 5  # Vehicles that change lanes.
    run = simulated(two_way)
    assert (step_parameters(run.scenario).vehicles.travel_sign < 0).any()
    assert (run.stage == Stage.PULL_OUT).any()
    assert simulated(winding).road.is_curved
    run = simulated(meeting)
    assert run.road.is_curved
    assert run.road.is_two_way
    assert (run.stage == Stage.ABORT).any()
    assert (run.states.lights & int(Lights.HIGH_BEAM)).any()  # Somebody flashes at the ego.


@pytest.mark.parametrize("slots", SLOT_CAPACITIES)
def test_slots_that_hold_nobody_change_nothing(slots):
    whole = simulated(SITUATIONS[0])
    scenario = with_slots(whole.scenario, slots)
    for level in LEVELS:
        runs = engine.run(scenario, step_parameters(scenario), level=level)
        np.testing.assert_array_equal(runs.trace_hash, whole.trace_hash)


def with_slots(scenario: Scenario, slots: int) -> Scenario:
    """The same simulations with more slots, in which there is nobody."""

    def wider(values: np.ndarray) -> np.ndarray:
        more = np.repeat(values[:, -1:], slots - values.shape[1], axis=1)
        return np.concatenate([values, more], axis=1)

    def widened(batch: Any) -> Any:
        names = [one.name for one in dataclasses.fields(batch)]
        return batch.replace(**{name: wider(getattr(batch, name)) for name in names})

    vehicles = widened(scenario.vehicles)
    nobody = np.arange(slots) >= scenario.num_slots
    return scenario.replace(
        vehicles=vehicles.replace(valid=vehicles.valid & ~nobody),
        drivers=widened(scenario.drivers),
        **{
            name: wider(getattr(scenario, name))
            for name in ("start_s", "start_lane", "start_speed")
        },
    )


@each_situation
def test_a_simulation_is_the_same_in_any_batch(situation):
    whole = simulated(situation)
    count = situation.share
    scenario = whole.scenario
    order = np.random.default_rng(1).permutation(count)
    shuffled = situation.run(scenario.select(order), engine.run)
    assert not difference(shuffled, dataclasses.replace(whole.select(order), scenario=scenario))
    for size in (1, 15, 16, 17):
        part = situation.run(scenario.select(slice(3, 3 + size)), engine.run)
        np.testing.assert_array_equal(part.trace_hash, whole.trace_hash[3 : 3 + size])
        longest = part.stage.shape[1]
        np.testing.assert_array_equal(part.states.x, whole.states.x[3 : 3 + size, :, :longest])


def test_memory_that_is_used_again_leaves_no_trace():
    buffers = Buffers()
    for situation in sorted(SITUATIONS, key=lambda one: -simulated(one).states.x.size):
        expected = simulated(situation)
        run = lambda *given: engine.run(*given, buffers=buffers)  # noqa: E731
        assert not difference(situation.run(expected.scenario, run), expected)


def test_behind_the_end_of_a_simulation_there_is_nothing_whatever_was_in_the_memory():
    given, buffers = load_specification("pinto2023-physical"), Buffers()
    road, lengths = load_road(given.road), []
    for first in range(0, 192, 48):
        index = np.arange(first, first + 48, dtype=np.uint64)
        run = engine.simulate(ScenarioSource(given, road, 3).sample(index), buffers=buffers)
        there = run.frame_mask[:, None] & run.scenario.vehicles.valid[:, :, None]
        for field in dataclasses.fields(run.states):
            assert not getattr(run.states, field.name)[~there].any(), field.name
        lengths.append(run.num_frames.copy())
    assert (lengths[0] > lengths[1]).any()  # Something was there before.


def test_what_was_recorded_cannot_be_overwritten():
    run = simulated(SITUATIONS[0])
    with pytest.raises(ValueError, match="read-only"):
        run.states.x[0, 0, 0] = 1


def test_the_situations_show_everything_that_the_model_does():
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
    hit = [run.contacts.partner != 255 for run in runs]
    assert sum(int(one[:, 0].sum()) for one in hit) >= 10  # The ego and another one.
    assert sum(int((one.any(axis=1) & ~one[:, 0]).sum()) for one in hit) >= 3  # Two others.
    two_wheelers = sum(
        int((one & run.scenario.vehicles.two_wheeler).sum())
        for one, run in zip(hit, runs, strict=True)
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
        for at, number in enumerate(numbers):
            total = (state[at % 4] + (number % word) * prime_2) % word
            state[at % 4] = rotated(total, 13) * prime_1 % word

    valid = np.flatnonzero(run.scenario.vehicles.valid[n])
    states = {
        name.name: getattr(run.states, name.name)[n] for name in dataclasses.fields(run.states)
    }
    for frame in range(int(run.num_frames[n])):
        for slot in valid:
            mix([int(values[slot, frame]) for values in states.values()])
        mix([int(run.stage[n, frame]), int(run.collided_with[n, frame]), frame, 0])
    c, p = run.contacts, run.percepts
    for slot in valid:
        mix([int(values[n, slot]) for values in (c.partner, c.time, c.impulse, c.closing_speed)])
    triples = (p.slot, p.is_detected, p.gap, p.closing_speed, p.true_gap, p.true_closing_speed)
    for k in np.flatnonzero(p.valid[n]):
        words = [int(values[n, k, column]) for column in range(3) for values in triples]
        mix([int(p.kind[n, k]), int(p.time[n, k]), *words])
    total = [(state[k] + rotated(state[(k + 1) % 4], 7)) % word for k in range(4)]
    total = [(number ^ (number >> 15)) * prime_2 % word for number in total]
    total = [(number ^ (number >> 13)) * prime_3 % word for number in total]
    return [number ^ (number >> 16) for number in total]


@pytest.mark.parametrize("name", ["study", "storm", "left-hand traffic"])
def test_the_trace_hash_is_that_of_the_recorded_integers(name):
    run = simulated(next(one for one in SITUATIONS if one.name == name))
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
def test_a_branch_is_the_run_with_other_parameters_from_its_frame_on(decision):
    situation = next(one for one in SITUATIONS if one.switch is not None)
    assert situation.switch is not None
    mixed = simulated(situation)
    scenario = mixed.scenario
    chosen = scenario.scenario_index % len(branching.ForcedDecision) == int(decision)
    frame = situation.switch * 10 // scenario.frame_interval_ms
    weather = turned_round(scenario.weather)
    alone = branching.branch(scenario, frame, decision=decision, weather=weather)
    np.testing.assert_array_equal(alone.trace_hash[chosen], mixed.trace_hash[chosen])


def test_a_difference_of_one_bit_is_found():
    run = simulated(SITUATIONS[0])
    for name, values in arrays(run).items():
        changed = values.copy()
        changed.reshape(-1)[-1] ^= changed.dtype.type(1)
        owner, _, own = name.rpartition(".")
        part = getattr(run, owner).replace(**{own: changed}) if owner else changed
        found = difference(run.replace(**{owner or own: part}), run)
        assert found.startswith(name), name
